"""A motion of which rows are missing says the same as the whole one: lost samples are filled, stretches that
are kept for validation cut a run into pieces.

Seeds: the first tried, none exchanged.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from exactarm.chain.lost_samples import without_gaps
from exactarm.chain.motion_record import full_record, motion_record
from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.numerics.stamps import blocks
from exactarm.robot_file import load_robot
from motions import fourier_motion, motion_data

STEP_S = 1e-3


@pytest.fixture(scope="module")
def whole():
    robot = load_robot("tx40")
    time, angle, rate, acceleration = fourier_motion(robot, 6.0, 1.0 / STEP_S, seed=3)
    return robot, motion_data(robot, time, angle, acceleration + 0.5 * rate)


def apart(robot, whole, part):
    """Largest deviation of acceleration and torque from those of the whole motion at the same times, over
    their largest values."""
    full, cut = motion_record(robot, whole), motion_record(robot, whole.select(part))
    worst = []
    for name in ("theta_ddot", "torque"):
        a, b = getattr(full, name)[full.keep], getattr(cut, name)[cut.keep]
        at = [np.interp(cut.data.time[cut.keep], full.data.time[full.keep], column) for column in a.T]
        worst.append(np.nanmax(np.abs(np.stack(at, axis=1) - b) / np.nanmax(np.abs(a), axis=0)))
    return max(worst), cut


def test_a_run_without_gaps_is_left_as_it_is():
    time, values = np.arange(100) * STEP_S, np.random.default_rng(1).normal(size=(100, 2))
    (part,) = without_gaps(time, (values,), 1.0)
    assert part.signals[0] is values and np.array_equal(part.row, np.arange(100))


def test_short_gaps_are_filled_and_long_ones_cut():
    time = np.arange(300) * STEP_S
    kept = np.ones(300, bool)
    kept[[50, 51, 52]] = False
    kept[150:200] = False
    values = np.stack([np.sin(20.0 * time), np.full(300, np.nan)], axis=1)
    first, second = without_gaps(time[kept], (values[kept],), 6e-3)
    assert first.time == pytest.approx(time[:150], abs=1e-12)
    assert first.signals[0][:, 0] == pytest.approx(values[:150, 0], abs=20.0**4 * 4e-3**4 / 64)  # of a cubic
    assert np.isnan(first.signals[0][:, 1]).all()
    assert np.array_equal(second.time, time[200:])
    assert np.array_equal(np.flatnonzero(kept)[second.row], np.arange(200, 300))
    nearest = np.flatnonzero(kept)[first.row][48:55]
    assert np.array_equal(nearest[[0, 1, 2, 4, 5, 6]], [48, 49, 49, 53, 53, 54]) and nearest[3] in (49, 53)


def test_lost_samples_change_nothing(whole):
    robot, data = whole
    worst, cut = apart(robot, data, np.random.default_rng(2).random(len(data)) > 0.02)
    assert worst < 1e-3 and len(cut.runs) == 1


def test_rows_of_validation_within_a_run_cut_it(whole):
    robot, data = whole
    worst, cut = apart(robot, data, np.arange(len(data)) % 1500 < 1000)
    assert worst < 5e-3 and len(cut.runs) == 4
    assert cut.keep.sum() * cut.step == pytest.approx(4 * 0.7, rel=0.05)  # less 0.15 s at both ends


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_many_lost_samples_are_seen_on_a_grid_of_stamps(share):
    kept = np.random.default_rng(4).random(2000) > share
    kept[[0, -1]] = True
    (part,) = without_gaps(np.flatnonzero(kept) * STEP_S, (), 20.0 * STEP_S)
    assert part.time == pytest.approx(np.arange(2000) * STEP_S, abs=1e-12)


def test_a_late_stamp_is_no_gap():
    time = np.arange(400) * STEP_S
    time[200] += 0.9 * STEP_S
    assert len(blocks(time)) == 1


@pytest.mark.parametrize("clock", ["jitter", "epoch", "read at its stamps"])
def test_uneven_stamps_do_not_reach_the_acceleration(whole, clock):
    """A tenth of a step of jitter; the seconds since 1970 in a float; angles that were read late indeed."""
    robot, data = whole
    late = np.random.default_rng(5).normal(0.0, 0.1 * STEP_S, len(data))
    late = np.spacing(1.76e9) * np.round(late / STEP_S * 5.0) if clock == "epoch" else late
    stamped = replace(data, time=data.time + late)
    if clock.startswith("read"):
        _, angle, rate, _ = fourier_motion(robot, 6.0, 1.0 / STEP_S, seed=3)
        read = (angle + rate * late[:, None]) * robot.ratios
        stamped = replace(stamped, joints={**data.joints, "theta": read})
    full, cut = motion_record(robot, data), motion_record(robot, stamped)
    off = np.abs(full.theta_ddot - cut.theta_ddot)[full.keep]
    assert np.max(off / np.max(np.abs(full.theta_ddot), axis=0)) < 0.02


def test_seconds_since_1970_count_from_the_first(tmp_path):
    robot = load_robot("tx40")
    columns = {f"theta_{axis + 1}_rad": 0.01 * np.arange(40) for axis in range(robot.axes)}
    columns |= {f"tau_{axis + 1}_Nm": np.ones(40) for axis in range(robot.axes)}
    columns["time_s"] = 1.7637e9 + 0.5 + STEP_S * np.arange(40)
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    time = read_dataset(tmp_path / "log.csv", robot).time
    assert time == pytest.approx(0.5 + STEP_S * np.arange(40), abs=1e-6)


def test_rows_of_a_series_that_change_their_set_every_few_samples_are_refused(tmp_path):
    robot = load_robot("tx40")
    columns = {f"theta_{axis + 1}_rad": 0.01 * np.arange(200) for axis in range(robot.axes)}
    columns |= {f"tau_{axis + 1}_Nm": np.ones(200) for axis in range(robot.axes)}
    columns["time_s"] = STEP_S * np.arange(200)
    columns["set"] = np.where(np.arange(200) % 10 < 7, "identification", "validation")
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(InputError, match="passes 39 times between identification and validation") as caught:
        read_dataset(tmp_path / "log.csv", robot)
    assert (caught.value.row, caught.value.column) == (8, "set")


@pytest.mark.parametrize(("kept", "runs"), [
    (np.random.default_rng(2).random(6000) > 0.02, 1),
    (np.arange(6000) % 1500 < 1000, 4),
], ids=["lost", "cut"])
def test_rates_of_a_tracked_motion_do_not_see_gaps(whole, kept, runs):
    """Beside a gap, as at the ends of a run, the acceleration is that of half a filter."""
    robot, data = whole
    full, cut = full_record(robot, data), full_record(robot, data.select(kept))
    assert len(cut.runs) == runs
    clear = np.concatenate([rows[50:-50] for rows in cut.runs])
    for name in ("theta_dot", "theta_ddot"):
        a, b = getattr(full, name)[kept], getattr(cut, name)
        assert np.max(np.abs(a - b)[clear] / np.max(np.abs(a), axis=0)) < 1e-3


def test_stretches_that_are_all_too_short_are_refused(whole):
    robot, data = whole
    with pytest.raises(InputError, match="200 samples without a gap is too short; expected"):
        motion_record(robot, data.select(np.arange(len(data)) % 400 < 200))


def test_a_clock_that_begins_anew_asks_for_a_column_run(tmp_path):
    robot = load_robot("tx40")
    columns = {f"theta_{axis + 1}_rad": 0.01 * np.arange(80) for axis in range(robot.axes)}
    columns |= {f"tau_{axis + 1}_Nm": np.ones(80) for axis in range(robot.axes)}
    columns["time_s"] = STEP_S * (np.arange(80) % 40)
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(InputError, match="expected more than 0.039 s .where a second run begins"):
        read_dataset(tmp_path / "log.csv", robot)
