"""The load of an arm at rest: gravity with the payload of each row, or the measured torque."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_gear_run, predict_poses
from exactarm.data.dataset import Dataset, read_planned_poses
from exactarm.effects import effect_from_table, library
from exactarm.effects.base_compliance import BaseCompliance
from exactarm.effects.frames import Frames
from exactarm.effects.joint_compliance import JointCompliance, RelativeCompliance
from exactarm.effects.link_compliance import LinkCompliance
from exactarm.effects.payload import Payload
from exactarm.rest_load import RestLoad
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot_file import load_robot
from six_axis import six_axis

ROWS, MASS, CENTRE = 9, 7.0, (0.05, -0.1, 0.2)
SMALL = 2e-3  # of a column: what a deflection of 1e-3 rad does to the load


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def poses(robot, rng, **joints):
    q = rng.uniform(-1.5, 1.5, (ROWS, robot.axes))
    return Dataset.of_arrays("poses", {"q": q} | joints, position=np.zeros((ROWS, 3)))


def with_payload(data, mass, centre=CENTRE):
    names = ("payload_x_m", "payload_y_m", "payload_z_m")
    columns = {"payload_kg": np.broadcast_to(mass, len(data)).astype(float)}
    return replace(data, covariates=columns | {name: np.full(len(data), c) for name, c in zip(names, centre)})


def loaded(robot):
    """The robot with the payload in its last link."""
    return Payload(None, (MASS, *(MASS * np.array(CENTRE)))).bake(robot)


def test_a_payload_column_loads_the_joints_like_a_heavier_last_link(rng):
    robot = six_axis()
    data = poses(robot, rng)
    load, q = RestLoad.of(robot, with_payload(data, MASS)), data.joints["q"]
    np.testing.assert_allclose(load.torque(q), _core.gravity_torque(loaded(robot).core, q, 1), atol=1e-9)
    slope = _core.gravity_torque_jacobian(loaded(robot).core, q, 1)
    np.testing.assert_allclose(load.slope(q), slope, atol=1e-9)


def test_a_payload_without_a_centre_hangs_at_the_flange(rng):
    robot = six_axis()
    data = poses(robot, rng)
    bare = replace(data, covariates={"payload_kg": np.full(ROWS, MASS)})
    at_flange = with_payload(data, MASS, (0.0, 0.0, 0.0))
    torque, same = (RestLoad.of(robot, rows).torque(data.joints["q"]) for rows in (bare, at_flange))
    np.testing.assert_array_equal(torque, same)


def test_the_base_tilts_under_the_payload_of_each_row(rng):
    robot, tilt = six_axis(), Layout.of((BaseCompliance(None, (1e-6,)),))
    data = poses(robot, rng)
    by_column = predict_poses(robot, tilt, with_payload(data, MASS)).position
    np.testing.assert_allclose(by_column, predict_poses(loaded(robot), tilt, data).position, atol=1e-12)
    assert np.max(np.abs(by_column - predict_poses(robot, tilt, data).position)) > 1e-6


def test_a_measured_torque_is_the_load_of_its_axis_and_of_no_other(rng):
    robot = six_axis()
    tau = np.full((ROWS, robot.axes), np.nan)
    tau[:, 1] = rng.normal(0.0, 100.0, ROWS)
    data = poses(robot, rng, tau=tau)
    view = predict_poses(robot, Layout.of(()), data).view
    gravity = _core.gravity_torque(robot.core, view.q, 1)
    np.testing.assert_array_equal(view.torque[:, 1], tau[:, 1])
    np.testing.assert_allclose(np.delete(view.torque, 1, 1), np.delete(gravity, 1, 1))
    assert view.measured_loads.tolist() == [False, True, False, False, False, False]


@pytest.mark.parametrize("name, constant, factor", [
    ("tau_motor", None, lambda joint: joint.ratio), ("current", 0.3, lambda joint: 0.3 * joint.ratio),
])
def test_torques_of_the_motor_side_pass_the_gear(rng, name, constant, factor):
    robot = six_axis().with_joint(1, torque_constant=constant)
    values = np.full((ROWS, robot.axes), np.nan)
    values[:, 1] = rng.normal(0.0, 2.0, ROWS)
    load = RestLoad.of(robot, poses(robot, rng, **{name: values}))
    np.testing.assert_allclose(load.measured[:, 1], values[:, 1] * factor(robot.joints[1]))


def test_a_current_without_a_torque_constant_is_no_load(rng):
    robot = six_axis()
    assert not RestLoad.of(robot, poses(robot, rng, current=rng.normal(0.0, 2.0, (ROWS, 6)))).fixed.any()


@pytest.mark.parametrize("constant", [0.3, None])
def test_a_gear_run_knows_the_load_by_a_current_only_with_the_torque_constant(rng, constant):
    robot = replace(six_axis(), links=None).with_joint(1, torque_constant=constant)
    time = 0.001 * np.arange(400)
    theta = np.zeros((400, 6))
    theta[:, 1] = 40.0 * time
    values = np.full((400, 6), np.nan)
    values[:, 1] = 1.0 + np.sin(3.0 * time)

    def load(**joints):
        gyro = np.zeros((400, 3))
        data = Dataset.of_arrays("gear_run", {"theta": theta} | joints, time=time, gyro=gyro)
        return predict_gear_run(robot, Layout.of(()), data, tangents=False).view.torque

    known = load(tau_motor=(constant or 0.0) * values)
    np.testing.assert_allclose(load(current=values), known, atol=1e-12)
    assert bool(np.any(known)) is (constant is not None)


def test_in_motion_a_measured_torque_is_no_static_load(rng):
    robot = six_axis()
    data = replace(poses(robot, rng, tau=rng.normal(0.0, 9.0, (ROWS, 6))), kind="tracked_motion")
    assert not RestLoad.of(robot, data).fixed.any()


@pytest.mark.parametrize("moments", [False, True])
@pytest.mark.parametrize("measured", [(), (1,)])
@pytest.mark.slow
def test_compliance_under_any_load_passes_the_central_difference(rng, measured, moments):
    guessed = with_generic_masses(replace(six_axis(), links=None))
    tau = np.full((ROWS, 6), np.nan)
    tau[:, list(measured)] = rng.normal(0.0, 300.0, (ROWS, len(measured)))
    data = with_payload(poses(guessed, rng, tau=tau), rng.uniform(0.0, 10.0, ROWS))
    relative = RelativeCompliance.none_of(guessed, 2, own_free=True, moments=moments, cubic_free=True)
    effects = (Frames.of(1, guessed.base, guessed.tool, False),
               JointCompliance.none_of(guessed, 1).with_values((4e-6, 1e-12)),
               relative.with_values((5e-6, 2e-6, -1e-6, 1e-9, *rng.normal(0.0, 1e-6, 12 * moments))))
    layout = Layout.of(effects)
    found = predict_poses(guessed, layout, data)
    steps = [1e-3 * p.plausible for p in layout.parameters]
    function = lambda x: predict_poses(guessed, layout.at(x), data, tangents=False).position
    assert_derivative(function, layout.values, found.jacobian[:, :3], steps, relative=SMALL)


def test_payload_as_a_cause_tells_nothing_of_axes_whose_torque_is_measured(rng):
    robot = six_axis(springs=True)
    data = poses(robot, rng, tau=rng.normal(0.0, 100.0, (ROWS, 6)))
    view = predict_poses(robot, Layout.of((Frames.of(1, robot.base, robot.tool, False),)), data).view
    assert not np.any(view.response(Payload(None, (0.0,) * 4)))


def test_a_payload_hangs_in_the_flange_frame_of_the_controller(tmp_path, rng):
    """The last link of a URDF need not lie as DH frame n does: its payload weighs as a mass of that link."""
    def urdf(mass, centre):
        inertial = (f'<inertial><origin xyz="{centre}" rpy="0 0 0"/><mass value="{mass}"/>'
                    '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>')
        places = [("0 0 0.3", "0 0 1"), ("0.1 0 0.2", "0 1 0"), ("0.4 0 0.1", "-1 0 0")]
        joints = "".join(
            f'<joint name="j{i}" type="revolute"><origin xyz="{xyz}"/><parent link="l{i - 1}"/>'
            f'<child link="l{i}"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="9" velocity="3"/>'
            f'</joint><link name="l{i}">{inertial if i == 3 else ""}</link>'
            for i, (xyz, axis) in enumerate(places, 1)
        )
        return f'<robot name="a"><link name="l0"/>{joints}</robot>'

    (tmp_path / "bare.urdf").write_text(urdf(1e-9, "0 0 0"))
    (tmp_path / "loaded.urdf").write_text(urdf(4.0, "0.01 0.02 0.08"))
    q = rng.uniform(-2.0, 2.0, (ROWS, 3))
    rows = "".join(",".join(map(str, row)) + ",4.0,10,20,80\n" for row in q)
    (tmp_path / "poses.csv").write_text(
        "q_1_rad,q_2_rad,q_3_rad,payload_kg,payload_x_mm,payload_y_mm,payload_z_mm\n" + rows)
    bare, loaded = (load_robot(tmp_path / f"{name}.urdf") for name in ("bare", "loaded"))
    carried = RestLoad.of(bare, read_planned_poses(tmp_path / "poses.csv", bare)).torque(q)
    np.testing.assert_allclose(carried, _core.gravity_torque(loaded.core, q, 1), atol=1e-6)
    assert np.abs(carried[:, 2]).max() > 1.0


def test_relative_compliance_survives_the_robot_file_and_says_what_it_is_relative_to():
    for moments in (False, True):
        effect = RelativeCompliance.none_of(six_axis(), 1, moments=moments, cubic_free=True)
        effect = effect.with_values((4e-6, 1e-6, 0.0, -1e-12, *np.linspace(1e-8, 1e-6, 15 * moments)))
        assert effect_from_table(effect.to_table()) == replace(effect, beside_spring=True)
        assert "generic" in effect.describe()


@pytest.mark.parametrize("name", ["joint_compliance", "base_compliance", "backlash"])
def test_causes_that_need_a_load_are_candidates_under_generic_masses(rng, name):
    robot = replace(six_axis(), links=None)
    guessed = with_generic_masses(robot)
    data = poses(robot, rng)
    layout = Layout.of((Frames.of(1, robot.base, robot.tool, False),))
    candidates = lambda arm: list(library()[name].candidates(arm, predict_poses(arm, layout, data).view))
    assert not candidates(robot) and candidates(guessed)


def test_what_hangs_on_the_distribution_of_masses_is_no_candidate_where_they_are_guessed(rng):
    guessed = with_generic_masses(replace(six_axis(), links=None))
    view = predict_poses(guessed, Layout.of(()), poses(guessed, rng)).view
    for effect in (Payload, LinkCompliance):
        assert not list(effect.candidates(guessed, view)) and list(effect.candidates(six_axis(), view))
