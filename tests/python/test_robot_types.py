"""Every kind of arm that a user may bring, with one hidden cause: it is found, and nothing beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.compensate.law import CompensationModel
from exactarm.data.dataset import Dataset, dataset_columns, read_dataset, read_planned_poses
from exactarm.effects import effect_from_table
from exactarm.effects.declared_ratio import DeclaredRatio
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.files.table import write_table
from exactarm.robot.robot import Joint, Robot
from three_arms import puma

POSES = 90
NOISE_M = 2e-5


def geared(**fields):
    return Joint(ratio=100.0, q_min=-2.5, q_max=2.5, **fields)


def slide(travel_m: float, **fields) -> Joint:
    return Joint(type="prismatic", ratio=600.0, q_min=0.0, q_max=travel_m, **fields)


def seven_axes() -> Robot:
    return ea.load_robot("panda")


def scara() -> Robot:
    return Robot("scara", (geared(d=0.4, a=0.35), geared(a=0.3, alpha=np.pi), slide(0.2), geared()))


def arm_on_a_track() -> Robot:
    arm = replace(puma(), links=None)
    joints = tuple(replace(joint, ratio=100.0) for joint in arm.joints)
    return Robot("track", (slide(3.0, alpha=-np.pi / 2), *joints))


def arm_on_a_turntable() -> Robot:
    arm = replace(puma(), links=None)
    joints = tuple(replace(joint, ratio=100.0) for joint in arm.joints)
    return Robot("turntable", (geared(a=0.6, d=0.2), *joints))


def coupled_wrist() -> Robot:
    """The motor of axis 5 turns axis 6 too, as its robot file declares."""
    arm = replace(puma(), links=None)
    joints = tuple(replace(joint, ratio=100.0) for joint in arm.joints)
    return replace(arm, joints=joints, effects=(JointCoupling(6, (5.0, 0.25)),))


def parallelogram() -> Robot:
    """The motor of axis 2 keeps the forearm upright: it turns axis 3 back."""
    arm = coupled_wrist()
    return replace(arm, effects=(JointCoupling(3, (2.0, -1.0)),))


def turntable() -> Robot:
    return Robot("turntable alone", (Joint(d=0.5, q_min=-2.5, q_max=2.5),))


def positioner() -> Robot:
    return Robot("positioner", (geared(d=0.6, alpha=np.pi / 2), geared(d=0.2)))


def growth_of(size: float):
    return effect_from_table({"effect": "thermal_drift", "form": "growth", "driver": "temperature_degC",
                              "growth_1_per_degC": size})


RUN_OUT = "gear_eccentricity joint={} first_cos_rad=3e-4 first_sin_rad=-2e-4"
LAG = "hysteresis joint={} size_rad=2e-4"
CASES = {
    "seven axes": (seven_axes, RUN_OUT, "gear_eccentricity", 4),
    "scara": (scara, LAG, "hysteresis", 2),
    "track": (arm_on_a_track, RUN_OUT, "gear_eccentricity", 3),
    "turntable": (arm_on_a_turntable, RUN_OUT, "gear_eccentricity", 1),
    "coupled wrist": (coupled_wrist, LAG, "hysteresis", 4),
    "parallelogram": (parallelogram, RUN_OUT, "gear_eccentricity", 2),
}


def test_the_ratio_of_a_motor_is_no_part_of_its_declared_coupling():
    """Else the calibration of a parallelogram had no derivative of axis 3 by the ratio of axis 2."""
    robot = parallelogram()
    layout = Layout.of((DeclaredRatio.of(robot, 1), *robot.effects))
    theta = np.random.default_rng(2).uniform(-150.0, 150.0, (12, robot.axes))
    data = Dataset.of_arrays("poses", {"theta": theta}, position=np.zeros((12, 3)))
    found = predict_poses(robot, layout, data)
    steps = [1e-3 * p.plausible for p in layout.parameters]
    function = lambda x: predict_poses(robot, layout.at(x), data, tangents=False).position
    assert_derivative(function, layout.values, found.jacobian[:, :3], steps)


def counted_from_axis_2() -> Robot:
    """Its controller counts axis 3 from the horizon, as Fanuc's do; no gear ratios are known."""
    arm = replace(puma(), links=None)
    joints = tuple(replace(joint, q_min=-1.5, q_max=1.5) for joint in arm.joints)
    return replace(arm, joints=joints, controller=replace(arm.controller, coupling=((3, 2, 1.0),)))


@pytest.mark.slow
@pytest.mark.parametrize("table", [turntable, positioner])
def test_a_table_of_one_or_two_axes_is_judged_without_a_misleading_word(table):
    """What frames take up is said, a wrong unit is not suspected, and the last axis' run-out is found."""
    axes = table().axes
    effects = [f"gear_eccentricity joint={axes} first_cos_rad=1e-3 first_sin_rad=-1e-3"]
    # of the seeds 5 to 16 the noise of 5 follows time by chance, and diagnosis says so
    made = ea.simulate(table(), count=60, seed=6, noise=NOISE_M, effects=effects)
    lines = ea.calibrate(table(), made.data, threads=1)["warnings"]
    assert not [line for line in lines if "check files" in line or "differ more" in line]
    assert any("no parameter of the robot was identified" in line for line in lines) == (axes == 1)
    diagnosed = ea.diagnose(table(), made.data, threads=1)
    assert [(e["effect"], e["joint"]) for e in diagnosed["effects"]] == [("gear_eccentricity", axes)]


def test_an_arm_that_grows_on_a_track_grows_by_its_links_alone():
    """What a sliding axis has gone is measured by its scale."""
    robot = arm_on_a_track()
    q = np.zeros((3, robot.axes))
    q[2, 0] = 2.5
    warm = {"temperature_degC": np.array([20.0, 40.0, 40.0])}
    data = Dataset.of_arrays("poses", {"q": q}, covariates=warm)

    def at(*effects):
        return predict_poses(robot, Layout.of(effects, estimate=False), data, tangents=False).position

    _, short, far = np.linalg.norm(at(growth_of(1e-5)) - at(), axis=1)
    assert far == pytest.approx(short, rel=1e-6) and short > 5e-5


def test_measured_angles_of_coupled_axes_are_those_that_the_controller_reports(tmp_path):
    """Simulated, written, read, calibrated: the coupling is in the file and out of the geometry."""
    robot = counted_from_axis_2()
    made = ea.simulate(robot, count=60, deviation=1, seed=8, noise=NOISE_M)
    write_table(tmp_path / "measured.csv", dataset_columns(made.data, robot))
    data = read_dataset(tmp_path / "measured.csv", robot)
    plain = replace(robot, controller=replace(robot.controller, coupling=()))
    told = read_dataset(tmp_path / "measured.csv", plain)
    q = data.joints["q"]
    np.testing.assert_allclose(told.joints["q"][:, 2], q[:, 2] - q[:, 1], atol=1e-12)
    np.testing.assert_allclose(np.delete(told.joints["q"], 2, 1), np.delete(q, 2, 1), atol=1e-12)
    result = ea.calibrate(robot, data, seed=8, threads=1)
    assert result.after["validation"].mean < 2.5 * NOISE_M  # the noise's own mean: 1.6


@pytest.mark.slow
def test_designed_poses_of_coupled_axes_are_written_as_the_controller_counts_them(tmp_path):
    robot = counted_from_axis_2()
    table = ea.design(robot, count=20, validation=4).tables["poses.csv"]
    write_table(tmp_path / "poses.csv", table)
    planned = read_planned_poses(tmp_path / "poses.csv", robot)
    q = planned.joints["q"]
    np.testing.assert_allclose(q[:, 2] - q[:, 1], table["q_3_rad"], atol=2e-9)
    assert np.ptp(q[:, 1]) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_hidden_cause_of_every_kind_of_arm_is_found(name):
    build, words, effect, joint = CASES[name]
    effects = [words.format(joint)]
    made = ea.simulate(build(), effects=effects, count=POSES, deviation=1, seed=6, noise=NOISE_M)
    result = ea.diagnose(build(), made.data, seed=6, threads=1)
    assert [(found["effect"], found["joint"]) for found in result["effects"]] == [(effect, joint)]
    assert result["verdict"] == "explained" and result["converged"]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_an_arm_of_any_kind_that_lacks_nothing_gets_nothing(name):
    robot = CASES[name][0]()
    made = ea.simulate(robot, count=POSES, deviation=1, seed=7, noise=NOISE_M)
    result = ea.diagnose(robot, made.data, seed=7, threads=1)
    assert result["verdict"] == "no_undeclared_effect" and result["effects"] == []


WRIST = {(6, 5): -0.5, (5, 4): 0.02, (6, 4): 0.01}  # (turned axis, motor) -> rad per rad


@pytest.mark.slow
def test_all_couplings_of_a_wrist_are_found_and_nothing_beside_them():
    """Half a radian per radian hides most of the geometry: it is searched anew once that is known."""
    robot = replace(coupled_wrist(), effects=())
    effects = [f"joint_coupling joint={turned} motor={motor} coupling_rad_per_rad={size}"
               for (turned, motor), size in WRIST.items()]
    made = ea.simulate(robot, effects=effects, count=POSES, deviation=1, seed=8, noise=NOISE_M)
    result = ea.diagnose(robot, made.data, seed=8, threads=1)
    couplings = [(each["joint"], each["parameters"]) for each in result["effects"]
                 if each["effect"] == "joint_coupling"]
    found = {(joint, int(of["motor"])): of["coupling_rad_per_rad"]["value"] for joint, of in couplings}
    assert found == pytest.approx(WRIST, abs=2e-4) and len(result["effects"]) == len(WRIST)
    assert result["verdict"] == "explained"


def leaning_scara() -> Robot:
    """As it is built: no axis is quite parallel to the next; the table of the maker has no beta."""
    arm = scara()
    leans = [replace(joint, d=0.0, beta=beta) for joint, beta in zip(arm.joints, (-8e-4, 6e-4, -1e-3))]
    return replace(arm, joints=(*leans, arm.joints[3]))


@pytest.mark.slow
def test_a_table_without_the_tilt_of_parallel_axes_is_as_good_as_one_with_it():
    """A SCARA of four parameters a frame stayed at twice its noise and more."""
    made = ea.simulate(leaning_scara(), count=60, seed=8, noise=NOISE_M)
    level = replace(leaning_scara(), joints=tuple(
        joint if joint.beta is None else replace(joint, beta=0.0) for joint in leaning_scara().joints))
    plain, whole = (ea.calibrate(robot, made.data, seed=8, threads=1) for robot in (scara(), level))
    for result in (plain, whole):
        # nor of the target's height, which no pose of parallel axes shows and none needs to
        assert not [line for line in result.warnings if "beta" in line or "another minimum" in line]
        assert result.after["validation"].mean < 2.5 * NOISE_M


SENT = {name: CASES[name][0] for name in ("seven axes", "scara", "track", "turntable")}
SENT["coupled by the controller"] = counted_from_axis_2


@pytest.mark.slow
@pytest.mark.parametrize("name", SENT)
def test_targets_of_every_kind_of_arm_are_reached_after_a_calibration(name):
    """Also of a SCARA whose axes lean: four axes reach the place, not the orientation as well."""
    robot = SENT[name]()
    made = ea.simulate(robot, count=POSES, deviation=1, seed=9, noise=NOISE_M)
    result = ea.calibrate(robot, made.data, seed=9, threads=1)
    assert result["converged"] and result.after["validation"].mean < 2.5 * NOISE_M
    assert not [line for line in result.warnings if "beta" in line]
    q = np.random.default_rng(9).uniform(0.3, 0.7, (6, robot.axes))
    span = np.array([(joint.q_min, joint.q_max) for joint in robot.joints])
    q = span[:, 0] + q * (span[:, 1] - span[:, 0])
    model = CompensationModel.of(result.robot)
    wanted = model.controller.poses(q)
    before, after = (np.linalg.norm(model.reached(each).position - wanted.position, axis=1)
                     for each in (q, ea.command_of(result.robot, q)))
    assert before.mean() > 1e-4 and after.max() < 1e-8


def test_two_arms_in_one_call_are_refused_in_one_clear_line(tmp_path):
    (tmp_path / "other.urdf").write_text("<robot/>")
    with pytest.raises(ea.InputError, match="an arm that it touches is declared in the fixture file"):
        ea.read([tmp_path / "other.urdf", tmp_path / "touches.csv"], "ur10")
