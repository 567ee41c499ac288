"""Inclinometer and accelerometer on the flange: derivatives, what they show, mixed with other data."""

import json
from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout
from exactarm.cli import main
from exactarm.data.dataset import Dataset, dataset_columns, read_dataset, read_planned_poses
from exactarm.design.closure_design import ClosureDesignOptions
from exactarm.design.gravity_design import design_gravity
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING
from exactarm.effects.frames import Frames
from exactarm.errors import InputError
from exactarm.files.table import write_table
from exactarm.identify.calibrate import CalibrationOptions
from exactarm.identify.closures import GRAVITY_ALONE, calibrate_closures
from exactarm.identify.declared import geometry_layout
from exactarm.identify.evaluate import evaluate_closures
from exactarm.measurement.closures import device_of, predict_closures, touches
from exactarm.measurement.contacts import SENSORS
from exactarm.measurement.gravity_sensors import Accelerometer, Inclinometer
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors
from exactarm.simulate.closures import measure_closures
from spoiled_rows import HEADER, PANDA, POSE, assert_refused
from test_closures import ECCENTRICITY, covered, virtual

ANGLE_RAD = 5e-5
SENSE = Sensors(position_m=5e-5, orientation_rad=ANGLE_RAD, counts=0)


def read_by(name: str, seed: int, *effects: str, robot: str = "panda", count: int = 60):
    virtual_robot, random = virtual(robot, seed, *effects)
    return virtual_robot, measure_closures(virtual_robot, name, 2, count, SENSE, random)[0]


def both(one: Dataset, two: Dataset) -> Dataset:
    """Rows of two sorts, each in sessions of its own."""
    stack = lambda name, width: np.concatenate([
        np.full((len(part), width), np.nan) if getattr(part, name) is None else getattr(part, name)
        for part in (one, two)])
    kinds = {name for part in (one, two) for name in part.contacts}
    none = lambda part, name: part.contacts.get(name, np.full(len(part), -1))
    given = {name: stack(name, width) for name, width in (("tilt", 2), ("accel", 3), ("position", 3))
             if getattr(one, name) is not None or getattr(two, name) is not None}
    return Dataset.of_arrays(
        "closures", {name: np.concatenate([one.joints[name], two.joints[name]]) for name in one.joints},
        session=np.concatenate([one.session, two.session + 10]), fixture=one.fixture,
        contacts={name: np.concatenate([none(one, name), none(two, name)]) for name in sorted(kinds)},
        **given,
    )


@pytest.mark.parametrize("cls", SENSORS.values())
@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (9.81, 0.0, 0.0)])
@pytest.mark.slow
def test_derivatives_by_every_parameter_agree_with_differences(cls, gravity):
    """With a tracker's frame in the same session, which gravity does not follow."""
    random = np.random.default_rng(5)
    robot = replace(PANDA, gravity=np.array(gravity))
    mounting = tuple(tuple(map(float, row)) for row in exp(np.array([0.4, -0.3, 0.2])))
    values = random.normal(0.0, 0.03, cls.size())
    base = Placement(exp(np.array([0.3, 0.2, -0.5])), np.array([1.0, 0.2, 0.1]))
    frames = Frames.of(1, base, PANDA.tool, True)
    layout = Layout.of((frames, cls(None, tuple(values), 1, 0, reference=mounting)))
    layout = layout.joined(geometry_layout(robot))
    q = random.uniform(-1.0, 1.0, (8, 7))
    marks = np.array([0, 0, 0, 0, 0, 0, -1, -1])
    position = np.where(marks[:, None] < 0, 0.3, np.nan) * np.ones(3)
    data = Dataset.of_arrays("closures", {"q": q}, contacts={cls.contact: marks}, position=position,
                             **{cls.contact: np.zeros((8, cls.numbers))})
    prediction = predict_closures(robot, layout, data)
    at = lambda x: predict_closures(robot, layout.at(x), data, tangents=False).residual[:, :3]
    assert_derivative(at, layout.values, -prediction.jacobian[:, :3], 1e-4, relative=1e-6)
    turn = np.arange(3, 6)
    np.testing.assert_array_equal(prediction.jacobian[np.ix_(marks == 0, range(3), turn)], 0.0)


def test_a_perfect_sensor_reads_the_direction_of_up():
    """At rest an accelerometer on the base reads g along z; a tilt is an axis' angle above the horizon."""
    data = Dataset.of_arrays("closures", {"q": np.zeros((1, 7))}, contacts={"tilt": np.zeros(1, int),
                             "accel": np.zeros(1, int)}, tilt=np.zeros((1, 2)), accel=np.zeros((1, 3)))
    view = predict_closures(PANDA, Layout.of(()), touches(data), tangents=False).view
    target = view.signals["target_rotation"][0].reshape(3, 3)
    numbers = {}
    for cls in (Accelerometer, Inclinometer):
        sensor = cls(None, tuple(np.zeros(cls.size())), 1, 0)
        numbers[cls] = sensor.numbers_at(view, np.array([0]))[0][0]
    up = target.T @ np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(numbers[Accelerometer], up, atol=1e-12)
    np.testing.assert_allclose(np.sin(numbers[Inclinometer]), up[:2], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "robot"), [("accel", "panda"), ("tilt", "panda"), ("accel", "ur10")])
def test_gravity_alone_recovers_the_angles_of_the_arm(name, robot):
    """Rows never fitted come down to the noise of the sensor; lengths, the first axis and the last one's zero
    are dropped, with the reason."""
    arm, data = read_by(name, 3, robot=robot)
    result = calibrate_closures(arm.nominal, data)
    assert result.fit.fit.converged
    assert result.beside_before["validation"]["tilt_error_rad"] > 10 * ANGLE_RAD
    assert result.beside_after["validation"]["tilt_error_rad"] < 2.0 * ANGLE_RAD  # of two or three: 1.25, 1.6
    dropped = {entry.name: entry.why for entry in result.identifiability.dropped}
    assert {name for name in geometry_layout(arm.nominal).names if name.endswith("_m")} <= set(dropped)
    assert dropped["q_offset_1_rad"].endswith(GRAVITY_ALONE) and GRAVITY_ALONE in result.warnings
    last = arm.nominal.axes
    assert f"q_offset_{last}_rad" in dropped
    assert np.mean(covered(arm, result)) >= 0.8
    if robot == "ur10":  # one zero stands for those of three parallel axes, and knows that it does
        widths = dict(zip(result.names, np.ptp(result.intervals, axis=1)))
        assert {"q_offset_3_rad", "q_offset_4_rad"} <= set(dropped)
        assert widths["q_offset_2_rad"] > 1e-2 > 10 * widths["q_offset_5_rad"]


def test_axes_that_are_not_at_right_angles_are_no_error_of_the_arm():
    """0.3 to 0.5 % across the axes, as data sheets have it: which the arm took before."""
    arm, data = read_by("accel", 3)
    skewed = np.array([[1.0, 0.0, 0.0], [4e-3, 1.0, 0.0], [-3e-3, 5e-3, 1.0]])
    result = calibrate_closures(arm.nominal, replace(data, accel=data.accel @ skewed.T))
    assert result.beside_after["validation"]["tilt_error_rad"] < 2.5 * ANGLE_RAD
    assert np.mean(covered(arm, result)) >= 0.8
    found = dict(zip(map(str, result.fit.layout.names), result.fit.layout.values))
    assert found["session_1.accel_cross_yx"] == pytest.approx(4e-3, abs=5e-4)


@pytest.mark.slow
def test_sockets_and_an_accelerometer_are_one_estimate():
    """Beside one place of the fixture the sensor's angles help the arm at places never touched."""
    robot, random = virtual("panda", 6)
    sockets = measure_closures(robot, "socket", 1, 10, SENSE, random)[0]
    judge = measure_closures(robot, "socket", 3, 15, replace(SENSE, position_m=1e-6), random)[0]
    sensor = measure_closures(robot, "accel", 1, 60, SENSE, random)[0]
    options = CalibrationOptions(compliance=())
    alone = calibrate_closures(robot.nominal, replace(sockets, identification=np.ones(len(sockets), bool)),
                               options)
    data = both(sockets, sensor)
    mixed = calibrate_closures(robot.nominal, replace(data, identification=np.ones(len(data), bool)), options)
    assert mixed.before["identification"].n == len(sockets)
    assert mixed.beside_after["identification"]["tilt_error_rad"] < 2.0 * ANGLE_RAD
    error = lambda result: evaluate_closures(result.robot, judge).overall.mean
    assert error(mixed) < 0.8 * error(alone)


@pytest.mark.slow
def test_a_hidden_cause_shows_in_gravity_and_nothing_is_invented():
    effect = ECCENTRICITY.replace("4e-4", "8e-4").replace("3e-4", "6e-4")
    robot, data = read_by("accel", 4, effect, count=90)
    found = diagnose(robot.nominal, data).findings
    assert [finding.effect.label for finding in found] == ["gear_eccentricity_2"]
    robot, data = read_by("accel", 4, count=60)
    assert diagnose(robot.nominal, data).verdict == NOTHING


@pytest.mark.slow
def test_commands_take_a_gravity_sensor_as_any_kind(tmp_path):
    words = ["--quiet", "--seed", "2", "--out"]
    assert main(["simulate", "panda", "--measure", "closures", "--contact", "tilt", "--places", "2",
                 "--count", "50", "--deviation", "1", "--noise", "1e-4", *words, str(tmp_path / "made")]) == 0
    file = str(tmp_path / "made" / "closures.csv")
    assert main(["calibrate", "panda", file, *words, str(tmp_path / "calibrated")]) == 0
    made = json.loads((tmp_path / "calibrated" / "result.json").read_text())
    before, after = (made[when]["validation"]["tilt_error_rad"] for when in ("before", "after"))
    assert after < 0.3 * before
    calibrated = str(tmp_path / "calibrated" / "robot.toml")
    assert main(["evaluate", calibrated, file, *words, str(tmp_path / "e")]) == 0
    judged = json.loads((tmp_path / "e" / "result.json").read_text())
    assert judged["tilt_error_rad"] < 2e-4 and "base_tilt" not in str(judged)
    assert made["unit"] == judged["unit"] == "rad"
    assert judged["error"]["mean"] == pytest.approx(judged["tilt_error_rad"])
    assert main(["identifiable", "panda", file, *words, str(tmp_path / "i")]) == 0
    assert GRAVITY_ALONE in (tmp_path / "i" / "result.json").read_text()


def test_a_written_file_is_read_back(tmp_path):
    robot, data = read_by("accel", 1, count=5)
    write_table(tmp_path / "rows.csv", dataset_columns(data, robot.nominal))
    again = read_dataset(tmp_path / "rows.csv", robot.nominal)
    np.testing.assert_allclose(again.accel, data.accel, rtol=1e-12)
    assert again.kind == "closures" and set(device_of(touches(again))) == {"accel"}


@pytest.mark.parametrize(("text", "words"), [
    (f"tilt_x_deg,{HEADER}\n1,{POSE}\n", "tilt_y: column missing; expected it beside column tilt_x_deg"),
    (f"tilt_x_deg,tilt_y_deg,{HEADER}\n95,0,{POSE}\n", "row 1, column tilt_x_deg: 1.65806 in SI units"),
    (f"socket,tilt_x_deg,tilt_y_deg,{HEADER}\n0,1,,{POSE}\n", "a reading of one axis alone"),
    (f"accel_x_g,accel_y_g,accel_z_g,{HEADER}\n0,0,1,{POSE}\n", "unknown unit 'g'; expected accel_x_m_s2"),
    (f"tilt_x_deg,tilt_y_deg,{HEADER}\n,,{POSE}\n", "neither a contact nor x, y, z"),
])
def test_wrong_readings_are_refused(tmp_path, text, words):
    assert_refused(tmp_path / "wrong.csv", text, words)


def test_a_mirrored_accelerometer_is_named():
    robot, data = read_by("accel", 1, count=20)
    with pytest.raises(InputError, match="is mirrored: expected right-handed axes"):
        calibrate_closures(robot.nominal, replace(data, accel=-data.accel))


def test_an_accelerometer_in_another_unit_is_named():
    """In g its gain came out as a tenth, and the errors as a tenth of what they were, without a word."""
    robot, data = read_by("accel", 1, count=20)
    for unit in (9.81, 9.81e-3):
        with pytest.raises(InputError, match="at rest; expected some 9.81: is it in g, or in mg"):
            calibrate_closures(robot.nominal, replace(data, accel=data.accel / unit))


def test_an_accelerometer_in_a_motion_is_a_covariate(tmp_path):
    rows = "\n".join(f"{0.01 * k},{0.1 * k},{0.1 * k},0,0,9.81" for k in range(20))
    header = "time_s,theta_1_rad,gyro_z_rad_s,gyro_x_rad_s,gyro_y_rad_s"
    (tmp_path / "run.csv").write_text(f"{header},accel_z_m_s2\n{rows}\n")
    robot = load_robot("racer-7-1.4")
    with pytest.raises(InputError, match="accel_x"):
        read_dataset(tmp_path / "run.csv", robot)
    (tmp_path / "run.csv").write_text(
        f"{header},accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n"
        + "\n".join(row.replace(",9.81", ",0,0,9.81") for row in rows.splitlines()) + "\n")
    data = read_dataset(tmp_path / "run.csv", robot)
    assert data.kind == "gear_run" and data.accel is None and "accel_z_m_s2" in data.covariates


@pytest.mark.parametrize("sensor", SENSORS)
def test_designed_poses_tell_more_than_random_ones(tmp_path, sensor):
    words = ["design", "ur10", "--contact", sensor, "--count", "25", "--tool", "0,0,0.1", "--quiet"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    made = json.loads((tmp_path / "result.json").read_text())
    expected = made["deviation_m"]
    assert expected["design"] < 0.95 * expected["random_poses"] < 0.5 * expected["drawing"]
    assert made["poses"] == 25 and "q_offset_1_rad" in {entry["parameter"] for entry in made["dropped"]}
    planned = read_planned_poses(tmp_path / "poses.csv", load_robot("ur10"))
    assert planned.joints["q"].shape == (25, 6)


@pytest.mark.parametrize(("name", "hidden"), [
    ("ur10", {"q_offset_3_rad", "q_offset_4_rad"}), ("panda", set()),
])
@pytest.mark.slow
def test_a_design_promises_nothing_of_angles_that_no_reading_parts(tmp_path, name, hidden):
    """The zeros of parallel axes turn the sensor alike: 10 mrad each, and 0.02 mm were promised."""
    found = design_gravity(load_robot(name), "accel", ClosureDesignOptions(count=40))
    assert set(map(str, found.hidden)) == hidden and found.deviation[2] < 1e-4
    assert (found.with_hidden > 1e-3) == bool(hidden)
    assert hidden or found.with_hidden == pytest.approx(found.deviation[2])
    assert main(["design", name, "--contact", "accel", "--quiet", "--out", str(tmp_path)]) == 0
    said = "But q_offset_3_rad, q_offset_4_rad turn the sensor" in (tmp_path / "report.html").read_text()
    assert said == bool(hidden)


@pytest.mark.parametrize("down", [1.0, -1.0])
def test_an_inclinometer_that_always_stands_alike_is_mounted_as_it_reads(down):
    """On a SCARA up is one direction of the flange: two axes at right angles had one of them upright. Up
    swings by 1 mrad, which a mounting of the mean cannot follow: 5 of its standard deviations, any seed."""
    up = np.tile([0.0, 0.0, down], (12, 1)) + 1e-3 * np.random.default_rng(3).standard_normal((12, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    lean = exp(np.array([0.1, -0.236, 0.4]))
    reading = np.arcsin(up @ lean.T)[:, :2]
    mounting = Inclinometer(1, None)._mounted(up, reading, None)
    np.testing.assert_allclose(mounting @ mounting.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.arcsin(up @ mounting.T)[:, :2], reading, atol=5e-3)
