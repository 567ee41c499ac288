"""One meaning of base and flange: what is given and shown of an arm read from a URDF counts from its first
and its last link. The same arm with its frames on DH frame 0 and n does the same with what it is given
moved."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import exactarm as ea
from central_difference import assert_derivative
from exactarm.chain import Layout
from exactarm.commands import loop
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup, Fixture
from exactarm.data.fixture import Partner as Declared
from exactarm.design.camera_design import design_pictures
from exactarm.design.closure_design import ClosureDesignOptions, design_closures
from exactarm.design.line_of_sight import Station
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.diagnose.in_space import errors_in_space
from exactarm.effects.frames import Frames
from exactarm.files.table import write_table
from exactarm.first_aid.drive_model import Motion, MotionSamples
from exactarm.first_aid.load_mistakes import payload_mistakes
from exactarm.first_aid.motion_mistakes import candidates
from exactarm.measurement.partner import Partner
from exactarm.measurement.target import Target
from exactarm.numerics.rotation import exp, log
from exactarm.plan import Line, PlannedPath, PlanOptions, plan_path
from exactarm.plan.trajectory import trajectory_table
from exactarm.robot.controller_frames import base_in_device, joined, target_on_flange, with_target
from exactarm.robot.mdh_frames import relative
from exactarm.robot.robot import Controller, Placement, Robot
from exactarm.robot.urdf import read_urdf, urdf_text
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses
from exactarm.simulate.virtual_robot import placed
from exactarm.view import View
from set_ups import joints_in_limits, true_robot
from set_ups import measured as set_up
from six_axis import six_axis

ARMS = ["ur10", "panda", "racer-7-1.4"]
FIRST = Placement(exp(np.array([0.4, -0.3, 1.2])), np.array([0.3, -0.2, 0.5]))
LAST = Placement(exp(np.array([-1.0, 0.6, 0.4])), np.array([0.05, -0.03, 0.12]))
SQUARE = Placement(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([0.3, -0.2, 0.5]))
TURNED = Placement(LAST.rotation)
POSTURES = {"ur10": (0.3, -1.2, 1.4, 0.3, 1.2, 0.4), "panda": (0.3, -0.4, 0.2, -1.8, 0.3, 1.6, 0.5),
            "racer-7-1.4": (0.3, 1.5, 0.2, 0.2, 1.2, 0.4)}
ANYWHERE = Box(np.full(3, -np.inf))
AXES = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
STOPS = 12


def read_from_urdf(name: str, folder, first: Placement = FIRST, last: Placement = LAST) -> Robot:
    """A shipped arm in a URDF whose first and last links stand elsewhere than its frames 0 and n."""
    text = urdf_text(replace(load_robot(name), base=first, tool=last))
    (folder / "arm.urdf").write_text(text)
    arm = load_robot(f"{folder / 'arm.urdf'}#device:tool")
    return replace(arm, joints=tuple(replace(joint, q_min=joint.q_min or -2.5, q_max=joint.q_max or 2.5)
                                     for joint in arm.joints))


def on_its_dh_frames(arm: Robot) -> Robot:
    """The same arm, whose base and flange are DH frame 0 and n."""
    return replace(arm, controller=replace(arm.controller, base=Placement(), flange=Placement()))


@pytest.fixture(params=ARMS)
def pair(request, tmp_path):
    arm = read_from_urdf(request.param, tmp_path)
    return arm, on_its_dh_frames(arm)


def moved(arm: Robot, points) -> np.ndarray:
    """Points of the arm's base in DH frame 0."""
    base = arm.controller.base
    return (np.asarray(points) - base.position) @ base.rotation


def some_poses(arm: Robot, count: int, seed: int = 1) -> np.ndarray:
    low, high = (np.array([getattr(joint, name) for joint in arm.joints]) for name in ("q_min", "q_max"))
    return np.random.default_rng(seed).uniform(0.7 * low, 0.7 * high, (count, arm.axes))


def posture(arm: Robot) -> np.ndarray:
    """Inside the limits and the reach, not singular."""
    return np.array(POSTURES[arm.name])


def test_the_frames_of_these_arms_are_others_than_those_of_the_tables(pair):
    for frame in (pair[0].controller.base, pair[0].controller.flange):
        assert np.linalg.norm(frame.rotation - np.eye(3)) > 0.1 and np.linalg.norm(frame.position) > 0.01


# -- plans -------------------------------------------------------------------------------------------
def short_path(arm: Robot, q: np.ndarray) -> PlannedPath:
    """From where the flange is at q, 5 cm towards DH frame 0, in the controller's frames."""
    start, way = arm.fk(q), np.array([-0.03, -0.04, 0.0]) @ arm.controller.base.rotation.T
    x, y, z, w = Rotation.from_matrix(start.rotation).as_quat()
    line = Line(start.position, start.position + way)
    return PlannedPath(line, 2.0, rate_hz=100.0, orientation_wxyz=np.array([w, x, y, z]))


@pytest.fixture
def planned(pair):
    """The same motion of both, each in its own frames."""
    q = posture(pair[0])
    paths = [short_path(robot, q) for robot in pair]
    return paths, [plan_path(robot, path, PlanOptions(start=q)) for robot, path in zip(pair, paths)]


def test_a_path_is_that_of_the_flange_in_the_base(pair, planned):
    arm, (one, other) = pair[0], planned[1]
    np.testing.assert_allclose(one.theta, other.theta, atol=1e-7)
    np.testing.assert_allclose(arm.fk(one.q_desired).position, one.reference.position, atol=1e-8)
    assert one.tracking.position_max < 1e-5
    assert not any("frame" in warning for warning in one.warnings)
    table = trajectory_table(one)
    shown = np.column_stack([table[f"{axis}_m"] for axis in "xyz"])
    np.testing.assert_allclose(shown, one.reference.position, atol=1e-5)


def test_a_played_plan_follows_its_own_table(pair, planned, tmp_path):
    write_table(tmp_path / "trajectory.csv", trajectory_table(planned[1][0]))
    played = ea.simulate(pair[0], tmp_path / "trajectory.csv", noise=0, counts=0)
    assert played["tracking"]["position_max_m"] < 1e-5


# -- measurements that are planned -------------------------------------------------------------------
def test_box_station_and_opening_allow_the_same_poses(tmp_path):
    """A box stays one only where the base is turned by right angles; it holds the origin of the flange."""
    arm = with_target(read_from_urdf("ur10", tmp_path, SQUARE, TURNED), [0.05, 0.02, 0.1])
    plain = on_its_dh_frames(arm)
    base, flange = arm.controller.base, arm.controller.flange
    corners = np.array([[-0.6, -0.9, 0.2], [0.9, 0.8, 1.4]])
    lower, upper = np.sort(moved(arm, corners), axis=0)
    station, opening = np.array([2.0, 0.4, 0.8]), np.array([0.3, 1.0, 0.2])
    q = some_poses(arm, 4000)
    kept = PoseSpace.of(arm, Box(*corners), None, Station(station, opening, 1.2))
    same = PoseSpace.of(plain, Box(lower, upper), None,
                        Station(moved(arm, station), flange.rotation @ opening, 1.2))
    allowed = kept.allowed(q)
    assert 20 < allowed.sum() < 2000
    np.testing.assert_array_equal(allowed, same.allowed(q))
    np.testing.assert_allclose(kept.target(q), arm.fk(q, of="target").position, atol=1e-12)
    assert base.rotation @ np.ones(3) == pytest.approx(np.ones(3))  # right angles alone


@pytest.mark.parametrize("name", ARMS)
def test_a_design_puts_the_target_on_the_flange(name, tmp_path):
    arm = read_from_urdf(name, tmp_path, FIRST, TURNED)  # the clearance is that of the flange's origin
    plain = on_its_dh_frames(arm)
    tool = np.array([0.05, 0.02, 0.1])
    there = arm.controller.flange.position + arm.controller.flange.rotation @ tool
    targets = with_target(arm, tool), with_target(plain, there)
    np.testing.assert_allclose(targets[0].tool.matrix, targets[1].tool.matrix, atol=1e-15)
    q = some_poses(arm, 500)
    kept = [PoseSpace.of(robot, ANYWHERE).allowed(q) for robot in targets]
    assert 50 < kept[0].sum() < 500
    np.testing.assert_array_equal(*kept)


@pytest.mark.parametrize("name", ["ur10", "panda"])
def test_seats_of_a_fixture_are_in_the_base(name, tmp_path):
    arm = read_from_urdf(name, tmp_path)
    at = arm.fk(posture(arm), of="target").position
    found = design_closures(arm, ClosureDesignOptions(count=14, at=(tuple(at),), box=ANYWHERE))
    seats = np.array([found.seats[1, int(socket)] for socket in found.socket])
    np.testing.assert_allclose(arm.fk(found.q, of="target").position, seats, atol=1e-7)
    assert np.ptp(seats[:, 2]) < 1e-12  # level in the base


@pytest.mark.slow
def test_a_board_of_a_design_is_in_the_base(tmp_path):
    arm = read_from_urdf("ur10", tmp_path)
    at = arm.fk(posture(arm), of="target")
    setup = CameraSetup(size=(1600, 1200), lens=(1400.0, 1400.0, 800.0, 600.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    before = at.position + 0.4 * at.rotation[:, 2]
    found = design_pictures(arm, setup, ClosureDesignOptions(count=8, at=(tuple(before),), box=ANYWHERE))
    turn, corner = found.cameras[0].frames()[1]
    middle = corner + turn @ (0.5 * setup.square * np.array([setup.columns, setup.rows, 0.0]))
    poses = arm.fk(found.q, of="target")
    seen = [relative(Placement(rotation, position), Placement(position=middle)).position
            for position, rotation in zip(poses.position, poses.rotation)]
    assert np.all(np.array(seen)[:, 2] > 0.1)  # before the lens


# -- frames that are estimated -----------------------------------------------------------------------
def measured(arm: Robot, seed: int = 3, count: int = 60) -> tuple[Robot, Dataset]:
    """A set-up at random, and positions of its target."""
    random = np.random.default_rng(seed)
    true = placed(deviated(arm, 1.0, random, frames=False), random)
    data = measure_poses(VirtualRobot.of(arm, (), true), some_poses(arm, count, seed),
                         Sensors(position_m=2e-5, counts=0), random)
    return true, data


@pytest.mark.slow
def test_base_and_tool_are_shown_of_the_controllers_frames_and_written_of_the_tables(pair):
    arm, plain = pair
    true, data = measured(arm)
    one, other = ea.calibrate(arm, data), ea.calibrate(plain, data)
    for frame in ("base", "tool"):
        for part in ("rotation", "position"):
            np.testing.assert_allclose(getattr(getattr(one.robot, frame), part),
                                       getattr(getattr(other.robot, frame), part), atol=1e-9)
    number = lambda made, name: made["parameters"][f"session_1.{name}"]["value"]
    base = np.array([number(one, f"base_{axis}") for axis in AXES])
    tool = np.array([number(one, f"tool_{axis}_m") for axis in "xyz"])
    shown = base_in_device(one.robot.base, arm.controller)
    np.testing.assert_allclose(base[:3], shown.position, atol=1e-9)
    np.testing.assert_allclose(exp(base[3:]), shown.rotation, atol=1e-9)
    np.testing.assert_allclose(tool, target_on_flange(one.robot.tool, arm.controller).position, atol=1e-9)
    truth = target_on_flange(true.tool, arm.controller).position
    np.testing.assert_allclose(tool, truth, atol=5e-3)
    low, high = one["parameters"]["session_1.tool_x_m"]["ci95"]
    assert low < tool[0] < high < low + 0.01


@pytest.mark.parametrize("count", [9, 12])
def test_estimates_of_frames_are_carried_over_with_their_derivative(count):
    values = np.random.default_rng(4).normal(0.0, 0.8, count)
    names = Frames.of(1, Placement(), Placement(), orientation=count == 12).names
    controller = Controller(base=FIRST, flange=LAST)
    at = lambda v: Frames(None, tuple(v), 1, names).in_frames_of(controller)
    assert_derivative(lambda v: at(v)[0], values, at(values)[1], 1e-5)
    tool = Target(None, tuple(values[:3])).in_frames_of(controller)
    np.testing.assert_allclose(LAST.position + LAST.rotation @ tool[0], values[:3], atol=1e-12)
    np.testing.assert_allclose(tool[1], LAST.rotation.T)
    np.testing.assert_array_equal(Frames(None, tuple(values), 1, names).in_frames_of(Controller())[0], values)


@pytest.mark.slow
def test_error_vectors_are_shown_in_the_base(pair):
    arm, data = pair[0], measured(pair[0])[1]
    calibrated = ea.calibrate(arm, data)
    robot = replace(calibrated.robot, effects=())
    frames = Layout.of((Frames.of(1, robot.base, robot.tool, False),))
    space = errors_in_space(robot, frames, frames, data, "validation", np.ones(len(data), bool))
    q = data.joints["theta"] / robot.controller_ratios + robot.controller_offsets
    np.testing.assert_allclose(space.position, robot.fk(q, of="target").position, atol=1e-9)
    back = base_in_device(robot.base, robot.controller).rotation
    np.testing.assert_allclose((data.position - robot.fk(q, of="target", seen_from="device").position) @ back,
                               space.after, atol=1e-9)


def test_a_certificate_shows_targets_in_the_base(tmp_path):
    arm = read_from_urdf("ur10", tmp_path)
    true, data = measured(arm, count=120)
    made = ea.certify(true, data)
    table = made.tables["residuals.csv"]
    q = data.joints["theta"] / true.controller_ratios + true.controller_offsets
    rows = np.asarray(table["row"]) - data.row[0]
    shown = np.column_stack([table[f"{axis}_base_m"] for axis in "xyz"])
    np.testing.assert_allclose(shown, true.fk(q[rows], of="target").position, atol=2e-3)


def test_a_base_that_turned_about_its_own_origin_is_told_as_turned_alone():
    """About that of the controller: DH frame 0, half a metre away, went too. In the axes that it had."""
    arm, random = six_axis(placed=False), np.random.default_rng(7)
    arm = replace(arm, controller=replace(arm.controller, base=FIRST, flange=LAST))
    truth = with_target(true_robot(arm, random), np.array([0.15, 0.1, 0.2]))
    q, turn = joints_in_limits(arm, 6, random), np.array([0.0, 4e-4, 0.0])
    here = base_in_device(truth.base, truth.controller)
    turned = Placement(exp(turn) @ here.rotation, here.position)
    later = replace(truth, base=joined(turned, truth.controller.base))
    assert np.linalg.norm(later.base.position - truth.base.position) > 1e-4
    before = set_up(arm, [truth], [np.tile(q, (10, 1))], 1e-5, random)
    before = replace(before, covariates={"day": np.repeat(np.arange(1.0, 11.0), len(q))})
    new = [set_up(arm, [later], [q], 1e-5, random) for _ in range(6)]
    cause = ea.check(arm, before, new)["causes"][0]
    assert cause["cause"] == "base"
    found = [cause["parameters"][f"base_{axis}"]["value"] for axis in AXES]
    np.testing.assert_allclose(found[:3], 0.0, atol=4e-5)
    np.testing.assert_allclose(found[3:], log(here.rotation.T @ turned.rotation), atol=4e-5)


def test_the_loop_keeps_its_path_in_the_base_of_the_drawing(tmp_path):
    """An arm that is as drawn, in a set-up somewhere, executes the path without error."""
    arm = measured(read_from_urdf("ur10", tmp_path))[0]
    arm = replace(arm, links=None, joints=tuple(replace(joint, ratio=100.0) for joint in arm.joints))
    path = short_path(arm, posture(arm))
    done = loop._execute("drawn", arm, arm, VirtualRobot.of(arm), path, 1)
    assert done.summary.max < 1e-6


def test_a_mounting_that_is_suspected_is_told_by_the_axes_of_the_base():
    turn = FIRST.rotation
    none = np.zeros((2, 6))
    arm = six_axis(placed=False)
    arm = replace(arm, gravity=np.array([0.0, 0.0, -9.81]), controller=replace(arm.controller, base=FIRST))
    samples = MotionSamples(Motion(arm, none, none, none), none, np.ones(6), np.ones(6), np.zeros(2),
                            np.zeros(2), none, np.zeros(2))
    told = {name: other.motion.robot.gravity for name, other in candidates(samples) if "mounting" in name}
    along = told["gravity along +x of the base (the arm's mounting)"]
    np.testing.assert_allclose(turn @ along, [9.81, 0.0, 0.0], atol=1e-12)


# -- files -------------------------------------------------------------------------------------------
def test_the_urdf_beside_a_robot_file_has_the_links_of_the_source(pair, tmp_path):
    arm = measured(pair[0])[0]
    (tmp_path / "robot.urdf").write_text(urdf_text(arm))
    q = some_poses(arm, 20)
    again = read_urdf(f"{tmp_path / 'robot.urdf'}#base_link:flange")
    np.testing.assert_allclose(again.fk(q).matrix, arm.fk(q).matrix, atol=1e-9)
    whole = read_urdf(f"{tmp_path / 'robot.urdf'}#device:tool")
    there = arm.fk(q, of="target", seen_from="device").matrix
    np.testing.assert_allclose(whole.fk(q).matrix, there, atol=1e-9)
    arm_alone = read_urdf(tmp_path / "robot.urdf")  # failed before: the device was its base
    np.testing.assert_allclose(arm_alone.fk(q).matrix, arm.fk(q).matrix, atol=1e-9)
    np.testing.assert_allclose(arm_alone.fk(q, of="target", seen_from="device").matrix, there, atol=1e-9)


def test_offsets_show_base_and_target_of_the_controller(pair):
    arm = measured(pair[0])[0]
    text = ea.export(arm, format="offsets").contents["offsets.txt"]
    text = text.decode() if isinstance(text, bytes) else text
    for place in (base_in_device(arm.base, arm.controller), target_on_flange(arm.tool, arm.controller)):
        x, y, z = 1e3 * place.position
        assert f"KUKA  {{X {x:.4f},Y {y:.4f},Z {z:.4f}," in text


def test_targets_in_the_frame_of_the_device_are_reached(pair, tmp_path):
    """Base and controller's frames are turned about other axes: their order matters."""
    arm = replace(measured(pair[0])[0], links=None)
    q = posture(arm) + np.random.default_rng(5).uniform(-0.05, 0.05, (6, arm.axes))
    pose = arm.fk(q, of="target", seen_from="device")
    wxyz = np.roll(Rotation.from_matrix(pose.rotation).as_quat(), 1, axis=1)
    columns = {f"q_{i + 1}_rad": q[:, i] + 1e-3 for i in range(arm.axes)}
    columns |= {f"{axis}_m": pose.position[:, i] for i, axis in enumerate("xyz")}
    columns |= {name: wxyz[:, i] for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    write_table(tmp_path / "targets.csv", columns)
    made = ea.compensate(arm.with_controller_frames, tmp_path / "targets.csv", frame="device")
    made.save(tmp_path / "out")
    told = np.genfromtxt(tmp_path / "out" / "targets.csv", delimiter=",", names=True)
    command = np.column_stack([told[f"q_{i + 1}_rad"] for i in range(arm.axes)])
    reached = arm.fk(command, of="target", seen_from="device").position
    np.testing.assert_allclose(reached, pose.position, atol=1e-6)


# -- other arms, loads -------------------------------------------------------------------------------
def test_a_partner_stands_and_holds_its_ball_in_its_controllers_frames(pair):
    arm = pair[0]
    ball, base = np.array([0.02, -0.05, 0.11]), SQUARE
    declared = Declared("other.toml", 0.0254, robot=arm)
    contact = Partner(None, (), 1, 0, declared_as=declared).with_values(
        [*base.position, *np.zeros(3), *ball, 0.0])
    contact = replace(contact, reference=tuple(map(tuple, base.rotation)))
    other = some_poses(arm, STOPS)
    rows = Dataset.of_arrays("closures", {"q": other}, partner=other,
                             contacts={"partner": np.zeros(STOPS, int)})
    signals = {"target": np.zeros((STOPS, 3)), "displacement": np.zeros((STOPS, 6))}
    view = View(arm, replace(rows, fixture=Fixture(partner=declared)), "closures", 1, signals=signals)
    numbers = contact.numbers_at(view, np.arange(STOPS))[0][:, 0]
    poses = arm.fk(other)
    held = base.position + (poses.position + poses.rotation @ ball) @ base.rotation.T
    np.testing.assert_allclose(numbers, np.linalg.norm(held, axis=1) - 0.0254, atol=1e-9)


def test_a_payload_far_from_the_flange_counts_from_the_flange(tmp_path):
    arm = read_from_urdf("ur10", tmp_path)
    there = Placement(position=np.array([0.0, 0.0, 3.0]))
    far = replace(arm, controller=replace(arm.controller, flange=there))
    q = some_poses(far, 5)
    columns = {f"q_{i + 1}_rad": q[:, i] for i in range(6)} | {f"{axis}_m": q[:, 0] for axis in "xyz"}
    write_table(tmp_path / "poses.csv", columns | {"payload_kg": np.full(5, 3.0)})
    assert not list(payload_mistakes(far, ea.read(tmp_path / "poses.csv", far)))


def test_frames_on_those_of_the_tables_change_no_bit():
    odd = Placement(exp(np.array([0.1, 0.2, 0.3])), np.array([-0.0, 1e-17, 3.0]))
    for placement in (odd, Placement()):
        assert joined(placement, Placement()) is placement
        assert target_on_flange(placement, Controller()).matrix.tobytes() == placement.matrix.tobytes()
        assert base_in_device(placement, Controller()).matrix.tobytes() == placement.matrix.tobytes()
