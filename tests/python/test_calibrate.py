"""Calibration: the truth comes back within its intervals, errors reach the noise, bad data are refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import cli
from exactarm.chain import Layout
from exactarm.data.dataset import read_dataset, read_planned_poses, write_dataset
from exactarm.effects.frames import Frames
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.errors import InputError
from exactarm.files.examples import data_path, example
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.declared import geometry_layout
from exactarm.identify.evaluate import evaluate_poses
from exactarm.robot.writer import write_robot
from exactarm.robot_file import load_robot
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis

NOISE_M, NOISE_RAD = 1e-4, 1e-4
FLOOR_M = np.sqrt(3.0) * NOISE_M  # RMS of the Euclidean error that noise alone makes
REPEATS = 40


@pytest.fixture(scope="module")
def arm():
    return six_axis(placed=False)


def all_identify(count):
    return {"identification": np.ones(count, bool)}


def held_out(count, last):
    return {"identification": np.arange(count) < count - last}


def deviated_where_identifiable(nominal, names, rng):
    """`nominal` with every named table parameter off by about its plausible size."""
    layout = geometry_layout(nominal)
    x = layout.values
    for k, (name, parameter) in enumerate(zip(layout.names, layout.parameters)):
        if name in names:
            x[k] += rng.normal(0.0, 0.3 * parameter.plausible)
    robot = nominal
    for effect in layout.at(x).effects:
        robot = effect.bake(robot)
    return robot


def test_compliance_is_never_negative_and_its_bound_is_told(arm):
    """A drive that seemed to stiffen under its load: the estimate stays at zero, with a warning."""
    rng = np.random.default_rng(47)
    rigid = JointCompliance(2, (-4e-6, 0.0))
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 60, rng)], NOISE_M, rng,
                    layout=Layout.of((rigid,), estimate=False), **all_identify(60))
    result = calibrate(arm, data, CalibrationOptions(orientation=False, compliance=(2,)))
    assert dict(zip(result.names, result.fit.fit.x))["joint_compliance_2.linear_rad_per_Nm"] == 0.0
    assert any("joint_compliance_2.linear_rad_per_Nm lies at its bound" in warning
               for warning in result.warnings)


def test_a_soft_spring_that_stands_out_of_the_noise_is_no_noise(arm):
    """80 urad/Nm under a coarse camera: known to 10, more than the 5 that are plausible for a spring, but
    eight times as large all the same; it was dropped. The seed follows that of the tests beside it."""
    rng, noise = np.random.default_rng(49), 2e-3
    spring = Layout.of((JointCompliance(3, (8e-5, 0.0)),), estimate=False)
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 80, rng)], noise, rng,
                    layout=spring, **all_identify(80))
    result = calibrate(arm, data, CalibrationOptions(orientation=False, compliance=(3,)))
    low, high = dict(zip(map(str, result.names), result.intervals))["joint_compliance_3.linear_rad_per_Nm"]
    assert high - low > 2 * 1.96 * 5e-6 and 3e-5 < low < 8e-5 < high


@pytest.mark.parametrize("compliance", [0.0, 4e-5])
def test_springs_of_an_arm_without_masses_are_asked_for(arm, compliance):
    """They are not estimated, and no word was said of it. Any seed: springs leave many times the noise."""
    rng = np.random.default_rng(50)
    springs = Layout.of(tuple(JointCompliance(axis, (compliance, 0.0)) for axis in (2, 3)), estimate=False)
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 80, rng)], NOISE_M, rng,
                    layout=springs, **all_identify(80))
    told = calibrate(replace(arm, links=None), data, CalibrationOptions(orientation=False)).warnings
    assert any("declares no masses, would take" in line for line in told) == (compliance > 0.0)


def test_an_arm_that_hangs_from_the_ceiling_is_asked_for_its_gravity(arm):
    """Its springs give way the other way: what a file that stands on the floor says is asked after."""
    rng = np.random.default_rng(48)
    hangs = replace(arm, gravity=-arm.gravity)
    data = measured(hangs, [at_random_place(hangs, rng)], [joints_in_limits(arm, 60, rng)], NOISE_M, rng,
                    layout=Layout.of((JointCompliance(2, (8e-6, 0.0)),), estimate=False), **all_identify(60))
    told = [calibrate(robot, data, CalibrationOptions(orientation=False, compliance=(2,))).warnings
            for robot in (arm, hangs)]
    assert ["gravity_m_s2" in " ".join(lines) for lines in told] == [True, False]


@pytest.mark.slow
def test_truth_lies_in_19_of_20_intervals(arm):
    rng = np.random.default_rng(40)
    q = joints_in_limits(arm, 60, rng)
    options = CalibrationOptions(orientation=False, compliance=(2, 3))
    pilot = calibrate(arm, measured(arm, [at_random_place(arm, rng)], [q], NOISE_M, rng, **all_identify(60)),
                      options)
    inside = []
    for _ in range(REPEATS):
        true = at_random_place(deviated_where_identifiable(arm, pilot.names, rng), rng)
        springs = Layout.of((JointCompliance(2, (5e-6, 0.0)), JointCompliance(3, (8e-6, 0.0))))
        data = measured(arm, [true], [q], NOISE_M, rng, layout=springs, **all_identify(60))
        result = calibrate(arm, data, options)
        layout = Layout.of((Frames.of(1, true.base, true.tool, False),)).joined(geometry_layout(true)).joined(
            springs
        )
        # a frame with a beta has its d in the tables, and in no layout
        truth = {f"d_{i}_m": joint.d for i, joint in enumerate(true.joints, start=1)}
        truth |= dict(zip(layout.names, layout.values))
        assert result.names == pilot.names and result.fit.fit.converged
        values = np.array([truth[name] for name in result.names])
        inside.append((result.intervals[:, 0] < values) & (values < result.intervals[:, 1]))
    assert 0.92 < np.mean(inside) < 0.98, f"{np.mean(inside):.3f} of {np.size(inside)}"


@pytest.mark.slow
def test_racer_at_the_poses_of_the_source_reaches_the_noise():
    """The 50 poses of the source, 0.1 mm of noise, deviations as its Table 3.8 has them; judged on 40 other
    poses."""
    racer = load_robot("racer-7-1.4")
    planned = read_planned_poses(data_path("racer/thesis_poses.csv"), racer).joints["theta"]
    q = planned / racer.controller_ratios + racer.controller_offsets
    before, after = [], []
    for seed in range(5):
        rng = np.random.default_rng(50 + seed)
        poses = np.concatenate([q, joints_in_limits(racer, 40, rng)])
        result = calibrate(racer, measured(racer, [true_robot(racer, rng)], [poses], NOISE_M, rng,
                                           **held_out(90, 40)))
        before.append(result.before["validation"].rms)
        after.append(result.after["validation"].rms)
    # 33 parameters from 150 numbers: sqrt(1 + 33 / 150) = 1.10 of the noise is the best there is
    assert np.sqrt(np.mean(np.square(after))) < 1.25 * FLOOR_M and min(before) > 5.0 * max(after)


def test_orientation_adds_what_position_cannot_tell(arm):
    rng = np.random.default_rng(60)
    truth, q = true_robot(arm, rng), joints_in_limits(arm, 70, rng)
    data = measured(arm, [truth], [q], NOISE_M, rng, noise_rad=NOISE_RAD, **held_out(70, 20))
    pose, position = (calibrate(arm, data, CalibrationOptions(orientation=use)) for use in (True, False))
    assert pose.orientation and not position.orientation
    assert "session_1.tool_rx_rad" in pose.names and "session_1.tool_rx_rad" not in position.names
    assert pose.fit.sigma_position == pytest.approx(NOISE_M, rel=0.25)
    assert pose.fit.sigma_orientation == pytest.approx(NOISE_RAD, rel=0.25)
    widths = [dict(zip(each.names, np.ptp(each.intervals, axis=1))) for each in (pose, position)]
    shared = [name for name in widths[1] if name.startswith(("session", "a_"))]
    assert all(widths[0][name] < widths[1][name] for name in shared if name in widths[0])
    assert pose.after["validation"].rms < 1.3 * FLOOR_M


def test_sessions_share_the_robot_and_keep_their_frames(arm):
    rng = np.random.default_rng(61)
    true = true_robot(arm, rng)
    places = [at_random_place(true, rng) for _ in range(3)]
    q = [joints_in_limits(arm, 20, rng) for _ in places]
    result = calibrate(arm, measured(arm, places, q, NOISE_M, rng))
    assert sum(name.endswith("base_x_m") for name in result.names) == 3
    assert sum(name == "a_2_m" for name in result.names) == 1
    assert result.fit.fit.freedom == 3 * int(result.identification.sum()) - len(result.names) + int(
        result.fit.fit.at_bound.sum()
    )
    assert result.after["validation"].rms < 1.5 * FLOOR_M < 5.0 * FLOOR_M < result.before["validation"].rms


def test_session_without_identification_rows_is_refused(arm):
    rng = np.random.default_rng(62)
    truth = true_robot(arm, rng)
    q = [joints_in_limits(arm, 30, rng), joints_in_limits(arm, 6, rng)]
    data = measured(arm, [truth, truth], q, NOISE_M, rng, **held_out(36, 6))
    with pytest.raises(InputError, match="session 2 has no identification rows"):
        calibrate(arm, data)


def test_robust_loss_survives_gross_errors(arm):
    rng = np.random.default_rng(63)
    q = joints_in_limits(arm, 100, rng)
    data = measured(arm, [true_robot(arm, rng)], [q], NOISE_M, rng, **held_out(100, 30))
    position = data.position.copy()
    position[:70:12] += rng.normal(0.0, 0.02, (6, 3))
    data = replace(data, position=position)
    robust, plain = (calibrate(arm, data, CalibrationOptions(robust=robust)) for robust in (True, False))
    assert robust.after["validation"].rms < 1.5 * FLOOR_M < 5.0 * FLOOR_M < plain.after["validation"].rms


@pytest.mark.slow
def test_wild_rows_are_noticed_weigh_less_and_are_told(arm):
    rng = np.random.default_rng(63)
    q = joints_in_limits(arm, 100, rng)
    data = measured(arm, [true_robot(arm, rng)], [q], NOISE_M, rng, **held_out(100, 30))
    clean = calibrate(arm, data)
    assert not [line for line in clean.warnings if "Huber" in line or "bound" in line]
    position = data.position.copy()
    position[:70:24] += rng.normal(0.0, 0.02, (3, 3))
    found = calibrate(arm, replace(data, position=position))
    assert found.after["validation"].rms < 1.2 * clean.after["validation"].rms
    assert [line for line in found.warnings if line.startswith("3 of 100 rows miss by more than 8 times")]


def test_repeated_poses_tell_no_more_parameters(arm):
    rng = np.random.default_rng(64)
    q = np.repeat(joints_in_limits(arm, 9, rng), 10, axis=0)
    with pytest.raises(InputError, match="9 different identification poses give 27 numbers"):
        calibrate(arm, measured(arm, [true_robot(arm, rng)], [q], NOISE_M, rng, **all_identify(90)))


def test_repeated_poses_stay_on_one_side(arm):
    rng = np.random.default_rng(65)
    q = np.tile(joints_in_limits(arm, 30, rng), (3, 1))
    result = calibrate(arm, measured(arm, [true_robot(arm, rng)], [q], NOISE_M, rng))
    assert np.all(result.identification.reshape(3, 30) == result.identification[:30])
    assert result.after["validation"].rms < 1.5 * FLOOR_M


@pytest.mark.slow
def test_calibrated_robot_is_as_good_on_fresh_data(arm, tmp_path):
    """Through its file, tables, compliance and all, with only the frames refitted."""
    rng = np.random.default_rng(66)
    true = true_robot(arm, rng)
    springs = Layout.of((JointCompliance(2, (6e-6, 0.0)), JointCompliance(3, (9e-6, 0.0))))
    result = calibrate(arm,
                       measured(arm, [true], [joints_in_limits(arm, 120, rng)], NOISE_M, rng, layout=springs))
    write_robot(tmp_path / "robot.toml", result.robot)
    fresh = measured(arm, [at_random_place(true, rng)], [joints_in_limits(arm, 80, rng)], NOISE_M, rng,
                     layout=springs)
    error = evaluate_poses(load_robot(tmp_path / "robot.toml"), fresh).overall.rms
    assert error == pytest.approx(result.after["validation"].rms, rel=0.2) and error < 1.25 * FLOOR_M
    again = calibrate(load_robot(tmp_path / "robot.toml"), fresh)
    assert again.before["validation"].rms < 1.3 * FLOOR_M


def test_dropped_parameters_are_known_by_name(arm):
    rng = np.random.default_rng(67)
    result = calibrate(arm,
                       measured(arm, [true_robot(arm, rng)], [joints_in_limits(arm, 50, rng)], NOISE_M, rng))
    dropped = set(result.identifiability.dropped_names)
    assert {"d_1_m", "q_offset_1_rad", "d_6_m"} <= dropped and not dropped & set(result.names)
    assert all(entry.why for entry in result.identifiability.dropped)
    tables = dict(zip(geometry_layout(result.robot).names, geometry_layout(result.robot).values))
    start = dict(zip(geometry_layout(arm).names, geometry_layout(arm).values))
    assert all(tables[name] == start[name] for name in dropped if name in start)


def test_says_when_another_minimum_is_as_good():
    """All poses with one orientation of the flange: the target may sit anywhere on it."""
    ur10, rng = load_robot("ur10"), np.random.default_rng(68)
    q = joints_in_limits(ur10, 60, rng)
    q = np.column_stack([np.zeros(60), q[:, 1:3], -q[:, 1] - q[:, 2], np.full(60, -1.2), np.zeros(60)])
    q[:, 0] = 0.3 * rng.choice([-1.0, 1.0], 60)
    data = measured(ur10, [true_robot(ur10, rng)], [q], NOISE_M, rng)
    assert any("another minimum is as good" in warning for warning in calibrate(ur10, data).warnings)


# -- the command -------------------------------------------------------------------------------------
def run(robot, data, folder, capsys, *words):
    """(exit code, lines on standard error, result or None) of the command on files."""
    write_robot(folder / "robot.toml", robot)
    write_dataset(folder / "poses.csv", data, robot)
    out = folder / "out"
    code = cli.main(["calibrate", str(folder / "robot.toml"), str(folder / "poses.csv"), "--out", str(out),
                     "--quiet", *words])
    result = json.loads((out / "result.json").read_text()) if (out / "result.json").exists() else None
    return code, capsys.readouterr().err.strip().splitlines(), result


def test_command_writes_intervals_and_both_errors(arm, tmp_path, capsys):
    rng = np.random.default_rng(70)
    data = measured(arm, [true_robot(arm, rng)], [joints_in_limits(arm, 50, rng)], NOISE_M, rng)
    code, _, result = run(arm, data, tmp_path, capsys, "--compliance", "none")
    assert code == 0
    assert {"before", "after", "parameters", "dropped", "observability"} <= set(result)
    for part in ("before", "after"):
        assert {"n", "mean", "rms", "max", "min", "std"} == set(result[part]["validation"])
    low, high = result["parameters"]["a_2_m"]["ci95"]
    assert low < result["parameters"]["a_2_m"]["value"] < high
    assert set(result["observability"]) == {"O1", "O2", "O3", "O4", "O5"}


@pytest.mark.parametrize("compliance, told", [(None, True), ("1,2,3,4,5,6", False)])
@pytest.mark.slow
def test_declared_springs_that_are_held_are_told(tmp_path, capsys, compliance, told):
    """Words alone: nothing hangs on the seed."""
    made = str(tmp_path / "made")
    assert cli.main(["simulate", "racer-7-1.4", "--count", "40", "--seed", "2", "--out", made]) == 0
    more = () if compliance is None else ("--compliance", compliance)
    assert cli.main(["calibrate", "racer-7-1.4", f"{made}/measured.csv", *more,
                     "--out", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    words = "The declared springs on all six axes were held as they are: `--compliance 1,2,3,4,5,6` estimates"
    assert (words in said) == told


@pytest.mark.parametrize("fault, words", [
    ("few", "different identification poses give"),
    ("millimetres", "millimetres labelled as metres"),
    ("nan", "row 4, column x_m"),
    ("one session too few", "different poses of session 1 to find its frames by: 3; expected at least 4"),
])
@pytest.mark.slow
def test_bad_data_end_with_one_line(arm, tmp_path, capsys, fault, words):
    rng = np.random.default_rng(71)
    count = {"few": 9, "one session too few": 3}.get(fault, 40)
    data = measured(arm, [true_robot(arm, rng)], [joints_in_limits(arm, count, rng)], NOISE_M, rng,
                    **all_identify(count))
    position = data.position.copy()
    if fault == "millimetres":
        position *= 1e3
    if fault == "nan":
        position[3, 0] = np.nan
    code, lines, result = run(arm, replace(data, position=position), tmp_path, capsys)
    assert code == 2 and result is None
    assert len(lines) == 1 and words in lines[0]


# -- real data ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("series, most_m", [
    (("B",), 0.38e-3),  # 0.371 mm at the default seed
    pytest.param(("C",), 0.45e-3, marks=pytest.mark.slow),  # 0.434 mm
    pytest.param(("B", "C"), 0.43e-3, marks=pytest.mark.slow),  # 0.420 mm
])
def test_ur10_under_a_tracker(series, most_m):
    """Held-out mean with geometry and compliance; position and orientation fitted, frames per session."""
    ur10 = load_robot("ur10")
    data = read_dataset([example(f"ur10/series_{name}") for name in series], ur10)
    result = calibrate(ur10, data)
    assert result.after["validation"].mean <= most_m
