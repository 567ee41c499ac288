"""Gear identification on simulated runs of the Racer (thesis speeds and ranges) and on the KR300's two
encoders."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import exactarm as ea
from exactarm import _core
from exactarm.chain import gear_record
from exactarm.cli import main
from exactarm.data.dataset import Dataset, read_dataset, write_dataset
from exactarm.effects.time_delay import TimeDelay
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.identify.evaluate import EVALUATORS
from exactarm.identify.gear import identify_gears
from exactarm.identify.gear_declared import declared_gear_layout, sensor_layout
from exactarm.identify.gear_fit import fit_gear_runs
from exactarm.identify.gear_orders import find_orders
from exactarm.identify.gear_profile import AngleProfile, false_alarm
from exactarm.robot.robot import GearTable
from exactarm.robot_file import load_robot
from gear_simulation import DEGREE, GearRuns, joined, simulate

# joint, speed, margin that leaves the thesis' range of steady motion, orders it names
THESIS = (
    (1, 88.0, 45.0, (85.0, 101.0, 202.0, 303.0)),
    (2, 100.0, 61.0, (83.0, 167.0, 333.0)),
    (3, 61.0, 55.5, (70.0, 140.0, 280.0)),
)


@pytest.fixture(scope="module")
def racer():
    """The Racer with linear springs, as the simulation has them."""
    robot = load_robot("racer-7-1.4")
    for index in range(robot.axes):
        robot = robot.with_joint(index, spring_cubic=0.0)
    return robot


def runs_of(robot, case, **more):
    core = robot.core
    return simulate(robot, case, gravity=lambda q: _core.gravity_torque(core, q), rest=np.zeros(6), **more)


@pytest.fixture(scope="module", params=THESIS, ids=lambda case: f"gear {case[0]}")
def thesis_gear(racer, request):
    joint, speed, margin, orders = request.param
    data = runs_of(racer, GearRuns(joint=joint, speed=speed * DEGREE, runs=12, margin=margin * DEGREE))
    data = replace(data, identification=data.run <= 8)
    plain = racer.with_joint(joint - 1, cw=None, ccw=None, ratio=1.0007 * racer.joints[joint - 1].ratio)
    return joint, orders, data, identify_gears(plain, data)


def excess(rms, noise):
    return np.sqrt(max(rms**2 - noise**2, 0.0))


@pytest.mark.slow
def test_validation_error_falls_to_the_noise(thesis_gear):
    """By 90 % of what is not noise, per direction, without knowing tables or ratio."""
    _, _, _, result = thesis_gear
    assert len(result.gears) == 2
    for gear in result.gears:
        before, after = gear.before["validation"].rms, gear.after["validation"].rms
        assert after <= 1.2 * gear.noise
        assert excess(after, gear.noise) <= 0.1 * excess(before, gear.noise) + 0.25 * gear.noise
        if excess(before, gear.noise) > 12.0 * gear.noise:
            assert after <= 0.1 * before


@pytest.mark.slow
def test_unfiltered_rate_is_left_with_the_noise(racer, thesis_gear):
    """The judged error of the chain with the identified robot: 0.05 deg/s of noise went in."""
    _, _, data, result = thesis_gear
    unseen = data.select(~data.identification)
    assert EVALUATORS["gear_run"](result.robot, unseen).overall.rms < 1.06 * 0.05 * DEGREE


def test_orders_of_the_thesis_are_found(thesis_gear):
    joint, orders, _, result = thesis_gear
    profile = next(iter(result.gears[0].estimate.profiles.values()))
    resolution = 1.0 / profile.range_rev
    for order in orders:
        assert np.min(np.abs(result.gears[0].table.order - order)) < max(0.6 * resolution, 0.5)


def test_ratio_is_found(racer, thesis_gear):
    joint, _, _, result = thesis_gear
    # On a seventh of a turn the level of the harmonics and the ratio are one.
    tolerance = 2e-5 if joint < 3 else 3e-4
    assert abs(result.robot.joints[joint - 1].ratio / racer.joints[joint - 1].ratio - 1.0) < tolerance


def test_alignment_takes_the_side_axes_away(thesis_gear):
    """Table 3.1: side axes below 0.02 deg/s after the alignment."""
    _, _, _, result = thesis_gear
    assert result.alignments
    for entry in result.alignments:
        assert np.all(np.abs(entry.before[:2]) > 0.2 * DEGREE)
        assert np.all(np.abs(entry.after[:2]) < 0.02 * DEGREE)
        np.testing.assert_allclose(entry.angles, (0.02, -0.01), atol=2e-4)


@pytest.mark.slow
def test_both_methods_are_compared_on_held_out_runs(racer):
    fast = runs_of(racer, GearRuns(joint=1, speed=88.0 * DEGREE, runs=4))
    slow = runs_of(racer, GearRuns(joint=1, speed=44.0 * DEGREE, runs=2, first_run=5, seed=9))
    data = joined(fast, slow)
    data = replace(data, identification=data.run <= 2)
    result = identify_gears(racer.with_joint(0, cw=None, ccw=None), data)
    held_out = [entry for entry in result.held_out if not entry.fitted]
    assert {round(entry.speed / DEGREE) for entry in held_out} == {44, 88}
    for entry in held_out:
        assert set(entry.after) == {"refined", "neighbours"}
        assert max(entry.after.values()) < 0.15 * entry.before


@pytest.mark.parametrize(("on_file_s", "meets"), [(0.005, True), (0.0, False)])
@pytest.mark.slow
def test_a_delay_on_file_is_taken_out_at_every_speed(racer, on_file_s, meets):
    """5 ms turn order 101 by 0.8 rad at one speed and 0.4 at the other: without them no table fits both."""
    late = 2
    parts = []
    for first, speed in ((1, 88.0), (5, 44.0)):
        part = runs_of(racer, GearRuns(1, speed * DEGREE, 4, rate_hz=400.0, seed=first, first_run=first))
        for run in np.unique(part.run):
            rows = np.flatnonzero(part.run == run)
            one = part.select(rows[late:])
            parts.append(replace(one, gyro=part.gyro[rows[:-late]]))
    data = joined(*parts)
    data = replace(data, identification=data.run % 4 < 2)
    robot = replace(racer.with_joint(0, cw=None, ccw=None), effects=(TimeDelay(None, (on_file_s,)),))
    gears = identify_gears(robot, data).gears
    after = max(gear.after["validation"].rms / gear.noise for gear in gears)
    assert len(gears) == 2 and (after < 1.25) == meets


def test_no_order_is_invented():
    """Noise alone: with a false alarm of one in a thousand, twenty profiles stay empty."""
    random = np.random.default_rng(6)
    angle = np.arange(3000) * 1e-3
    for _ in range(20):
        sides = [
            AngleProfile(angle, 1.0 + random.normal(0.0, 1e-3, angle.size), np.ones(angle.size),
                         np.arange(angle.size), 1e-3, True)
            for _ in range(2)
        ]
        for side in sides:
            side.value[:] -= side.value.mean() - 1.0
        assert find_orders(sides, (5.0, 400.0), "refined").orders.size == 0
        assert find_orders(sides, (5.0, 400.0), "neighbours").orders.size == 0


def test_false_alarm_is_what_chance_does():
    random = np.random.default_rng(7)
    count, trials, level = 400, 400, 14.0
    angle = 2.0 * np.pi * np.arange(count) / count
    highest = []
    for _ in range(trials):
        power = np.abs(np.fft.rfft(random.normal(size=count))[1:-1]) ** 2 / count
        highest.append(power.max())
    level = np.quantile(highest, 0.9)
    expected = false_alarm(level, 1, 1.0, 1.0, 199.0)
    assert angle.size == count and 0.05 < expected < 0.2


@pytest.mark.slow
def test_bias_is_told_from_the_ratio(racer):
    biased = runs_of(racer, GearRuns(joint=1, speed=60.0 * DEGREE, runs=4, tilt=(0.0, 0.0)))
    biased = replace(biased, gyro=biased.gyro + [0.0, 0.0, 3e-3])
    result = identify_gears(racer, biased)
    estimate = result.gears[0].estimate
    np.testing.assert_allclose(estimate.disturbance, [3e-3], atol=1e-4)
    assert abs(estimate.ratio / racer.joints[0].ratio - 1.0) < 5e-5


@pytest.mark.slow
def test_one_direction_warns_and_leaves_the_other(racer):
    data = runs_of(racer, GearRuns(joint=1, speed=80.0 * DEGREE, runs=6))
    one_way = data.select(data.run % 2 == 1)
    result = identify_gears(racer, one_way)
    assert [gear.side for gear in result.gears] == ["ccw"]
    assert result.robot.joints[0].cw is racer.joints[0].cw
    assert any("one direction" in warning for warning in result.warnings)


def test_upside_down_sensor(racer):
    """The thesis' own sensor reads a negative rate as the motor angle rises."""
    data = runs_of(racer, GearRuns(joint=1, speed=70.0 * DEGREE, runs=2))
    turned = replace(data, gyro=data.gyro * [1.0, -1.0, -1.0])
    error = EVALUATORS["gear_run"](racer, turned).overall.rms
    assert error < 1.05 * 0.05 * DEGREE


def test_declared_model_is_refitted_within_its_intervals(racer):
    data = runs_of(racer, GearRuns(joint=1, speed=88.0 * DEGREE, runs=2, counts=0))
    record = gear_record(racer, data)
    layout = declared_gear_layout(racer, data, record)
    fit = fit_gear_runs(racer, layout, data, record=record)
    truth = np.concatenate([effect.values for effect in layout.effects[:2]])
    found, half = fit.fit.x[: truth.size], np.diff(fit.fit.interval(), axis=1)[: truth.size, 0] / 2.0
    assert np.mean(np.abs(found - truth) <= half) > 0.85
    assert layout.joined(sensor_layout(racer, data, record, bias=True)).size > layout.size


def test_kr300_tells_what_a_constant_ratio_leaves():
    robot = load_robot("kr300")
    data = read_dataset([data_path("kr300/run_A.parquet"), data_path("kr300/run_B.parquet")], robot)
    result = identify_gears(robot, data)
    assert {gear.joint for gear in result.gears} == {1, 2, 3} and result.gears[0].unit == "rad"
    for gear in result.gears:
        beside = dict(zip(gear.samples.disturbance_names, gear.estimate.disturbance))
        assert 2.5e-3 < beside["delay"] < 3.2e-3
        for name in ("identification", "validation"):
            assert 0.4e-3 < gear.before[name].rms < 0.8e-3
            assert gear.after[name].rms <= 1.01 * gear.before[name].rms
            assert gear.rest[name].rms < 0.12e-3
        assert np.all(np.hypot(gear.table.a, gear.table.b) < 0.1)
    second = next(gear for gear in result.gears if gear.joint == 2)
    assert np.min(np.abs(second.table.order / robot.joints[1].ratio - 3.095)) < 0.01


@pytest.mark.slow
def test_command(racer, tmp_path, capsys):
    data = runs_of(racer, GearRuns(joint=1, speed=88.0 * DEGREE, runs=4))
    data = replace(data, identification=data.run <= 2)
    write_dataset(tmp_path / "runs.csv", data, racer)
    assert main(["gear", "racer-7-1.4", str(tmp_path / "runs.csv"), "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert {(gear["joint"], gear["direction"]) for gear in result["gears"]} == {(1, "cw"), (1, "ccw")}
    for gear in result["gears"]:
        assert gear["unit"] == "rad/s"
        low, high = gear["ratio"]["ci95"]
        assert low < gear["ratio"]["value"] < high
        assert set(gear["before"]) == set(gear["after"]) == {"identification", "validation"}
        assert set(gear["before"]["validation"]) == {"n", "mean", "rms", "max", "min", "std"}
        assert all(set(entry) == {"order", "a", "b"} for entry in gear["harmonics"])
    updated = load_robot(tmp_path / "out" / "robot.toml")
    np.testing.assert_allclose(updated.joints[0].cw.a,
                               [e["a"]["value"] for e in result["gears"][0]["harmonics"]], rtol=1e-9)
    assert "never fitted" in capsys.readouterr().out


@pytest.mark.parametrize("joint", (4, 5, 6))
@pytest.mark.slow
def test_quick_wrist_axes_are_left_with_the_noise(racer, joint):
    """Constant ratios, ramps of 1300 deg/s^2: what the filter on the motor angle takes at their corners is no
    error."""
    speed = 0.4 * racer.joints[joint - 1].q_dot_max
    data = runs_of(racer, GearRuns(joint=joint, speed=speed, runs=4))
    data = replace(data, identification=data.run <= 2)
    result = identify_gears(racer, data)
    for gear in result.gears:
        assert not gear.table.order.size
        assert gear.after["validation"].n > 800
        assert gear.after["validation"].rms < 1.2 * gear.noise
    estimate = result.gears[0].estimate
    assert abs(estimate.ratio - racer.joints[joint - 1].ratio) < 4.0 * estimate.ratio_sigma


@pytest.mark.slow
def test_stamps_that_are_rounded_or_jitter_put_nothing_into_the_rate(racer):
    """3 kHz with stamps in whole microseconds, and a logger that scatters its stamps by a tenth of a step."""
    rounded = runs_of(racer, GearRuns(joint=1, speed=120.0 * DEGREE, runs=4, rate_hz=3000.0))
    rounded = replace(rounded, time=np.round(rounded.time, 6))
    scattered = runs_of(racer, GearRuns(joint=1, speed=80.0 * DEGREE, runs=4))
    random = np.random.default_rng(5)
    scattered = replace(scattered, time=scattered.time + random.uniform(-1e-4, 1e-4, len(scattered)))
    for data in (rounded, scattered):
        for gear in identify_gears(racer, replace(data, identification=data.run <= 2)).gears:
            assert gear.after["validation"].rms < 1.2 * gear.noise


@pytest.mark.slow
@pytest.mark.parametrize("read_at_stamps", [False, True])
def test_a_jitter_of_a_fifth_of_a_step_is_taken_out(racer, read_at_stamps):
    """Samples taken evenly and stamped late, or taken when their stamps say."""
    data = runs_of(racer, GearRuns(joint=1, speed=40.0 * DEGREE, runs=4))
    data = replace(data, identification=data.run <= 2)
    random, theta = np.random.default_rng(6), data.joints["theta"].copy()
    stamps = data.time + 2e-4 * random.standard_normal(len(data))
    if read_at_stamps:
        for run in np.unique(data.run):
            rows = data.run == run
            theta[rows] = make_interp_spline(data.time[rows],
                                             theta[rows])(np.clip(stamps[rows], *data.time[rows][[0, -1]]))
    uneven = replace(data, time=stamps, joints=data.joints | {"theta": theta})
    even = identify_gears(racer, data).gears
    for gear, clean in zip(identify_gears(racer, uneven).gears, even):
        assert gear.after["validation"].n > 0.95 * clean.after["validation"].n
        assert gear.after["validation"].rms < 1.2 * gear.noise


@pytest.mark.slow
def test_other_gears_at_other_sampling_rates(racer):
    """Orders between whole numbers, more than a hundred motor revolutions an output one, 500 Hz and 4 kHz."""
    table = GearTable(np.array([12.37, 50.7, 161.3, 322.6]), np.array([5e-4, 1e-3, 2e-3, -1e-3]),
                      np.array([1e-3, -5e-4, 1e-3, 5e-4]))
    robot = racer.with_joint(0, ratio=161.3, cw=table, ccw=table)
    for rate_hz in (500.0, 4000.0):
        data = runs_of(robot, GearRuns(joint=1, speed=60.0 * DEGREE, runs=4, rate_hz=rate_hz))
        data = replace(data, identification=data.run <= 2)
        result = identify_gears(robot.with_joint(0, cw=None, ccw=None, ratio=161.0), data)
        assert abs(result.robot.joints[0].ratio / 161.3 - 1.0) < 5e-5
        for gear in result.gears:
            np.testing.assert_allclose(gear.table.order, table.order, atol=0.1)
            assert gear.after["validation"].rms < 1.2 * gear.noise


def test_a_single_run_is_extrapolated_and_says_so(racer):
    data = runs_of(racer, GearRuns(joint=1, speed=80.0 * DEGREE, runs=1))
    result = identify_gears(racer, data)
    assert any("extrapolated" in warning for warning in result.warnings)


@pytest.mark.parametrize("change", (
    lambda data: replace(data, gyro=data.gyro / DEGREE),
    lambda data: replace(data, joints={"theta": data.joints["theta"] / DEGREE}),
    lambda data: replace(data, gyro=np.zeros_like(data.gyro)),
    lambda data: replace(data, gyro=np.random.default_rng(1).normal(0.0, 1e-3, data.gyro.shape)),
), ids=("gyroscope in degrees", "motor in degrees", "dead gyroscope", "gyroscope elsewhere"))
@pytest.mark.slow
def test_a_reading_that_is_none_of_the_gear_is_refused(racer, change):
    data = runs_of(racer, GearRuns(joint=1, speed=80.0 * DEGREE, runs=2))
    with pytest.raises(InputError, match="axis 1: .* gear ratio of .* 84.86; expected"):
        identify_gears(racer, change(data))


@pytest.mark.parametrize("samples, words", [
    (1, "no axis moves"),  # within a run, as an axis does that has moved
    *((samples, "axis 1: only .* rows") for samples in (2, 5, 60)),
])
@pytest.mark.slow
def test_runs_of_a_few_samples_are_refused(racer, samples, words):
    data = runs_of(racer, GearRuns(joint=1, speed=80.0 * DEGREE, runs=2))
    few = np.concatenate([np.flatnonzero(data.run == run)[500 : 500 + samples] for run in (1, 2)])
    with pytest.raises(InputError, match=words):
        identify_gears(racer, data.select(few))


def test_poses_are_refused(racer, tmp_path):
    poses = Dataset.of_arrays("poses", {"theta": np.zeros((3, 6))}, position=np.zeros((3, 3)))
    write_dataset(tmp_path / "poses.csv", poses, racer)
    assert main(["gear", "racer-7-1.4", str(tmp_path / "poses.csv"), "--out", str(tmp_path / "out")]) == 2


def test_a_robot_that_stands_still_is_refused(racer):
    time = np.arange(0.0, 1.0, 0.001)
    random = np.random.default_rng(8)
    still = Dataset.of_arrays(
        "gear_run", {"theta": np.zeros((time.size, 6))}, time=time,
        gyro=random.normal(0.0, 1e-3, (time.size, 3))
    )
    with pytest.raises(InputError, match="no axis moves"):
        identify_gears(racer, still)


@pytest.mark.slow
def test_the_error_without_the_low_pass_is_that_of_evaluate(racer, tmp_path):
    """3.4 times as large as behind it here, of one run and one robot: both commands say which theirs is."""
    data = runs_of(racer, GearRuns(joint=1, speed=88.0 * DEGREE, runs=4))
    found = ea.gear(racer, data)
    found.save(tmp_path)
    judged = ea.evaluate(tmp_path / "robot.toml", data)
    parts = [part for gear in found["gears"] for part in gear["unfiltered"].values() if part["n"]]
    left = np.sqrt(sum(part["n"] * part["rms"] ** 2 for part in parts) / sum(part["n"] for part in parts))
    assert judged["error"]["rms"] == pytest.approx(left, rel=2e-2)
    behind = [part["rms"] for gear in found["gears"] for part in gear["after"].values() if part["n"]]
    assert max(behind) < 0.5 * left
    assert "behind a low-pass" in found.report.verdict and "Without the low-pass" in found.report.verdict
    assert "low-pass" in judged.report.verdict
