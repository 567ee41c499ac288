"""Single wrong readings of a series are told with their row, and nothing else is guessed from them; torques
in a unit near Nm beside declared masses; clocks that begin anew in every run; a sign before a zero."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import Dataset
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.lone_readings import lone_readings
from motions import motion_data
from test_first_aid import column, scaled
from test_ratio_mistakes import ROBOT, motion


def with_reading(row, axis, change):
    def changed(values):
        values[row, axis] = change(values[row, axis])
        return values

    return changed


@pytest.mark.parametrize("name, rows, axis, off", [
    ("theta", [300], 1, 0.5 * 82.0), ("theta", [300, 301], 2, 0.05 * 80.0), ("tau", [41], 1, 3e4),
])
@pytest.mark.slow
def test_a_reading_that_stands_alone_is_told_with_its_row_and_nothing_else(name, rows, axis, off):
    """An angle off by 0.5 rad was taken for other masses, a torque of 3e4 Nm for driving friction."""
    data = motion(ROBOT)
    found = first_aid(ROBOT, column(data, name, with_reading(rows, axis, lambda value: value + off)))
    assert len(found) == 1 and f"column {name}_{axis + 1}, row {rows[-1] + 1}" in found[0], found
    assert ("(2 such readings)" in found[0]) == (len(rows) == 2) and "gross error" in found[0]


def series(values):
    """A motion of six axes of which the second is given."""
    q = np.zeros((len(values), 6))
    q[:, 1] = values
    rows = np.arange(len(values))
    return motion_data(ROBOT, 0.01 * rows, q, np.tile(np.sin(rows)[:, None], 6))


@pytest.mark.parametrize("values", [
    np.repeat(np.arange(40.0), 5),  # a slow device's readings, repeated
    np.where(np.arange(200) > 90, 0.3 * np.arange(200) - 6.28, 0.3 * np.arange(200)),  # wrapped
    np.deg2rad(np.rint(5.0 * np.sin(0.3 * np.arange(200)))),  # whole degrees
    np.random.default_rng(3).normal(0.0, 0.1, 3000),
    0.5 * np.sign(np.sin(1.3 * np.arange(200))),  # as fast as the log can show
])
def test_steps_noise_and_quick_motions_are_no_lone_readings(values):
    assert lone_readings(ROBOT, series(values))[0] == []


def test_poses_are_left_to_their_own_check():
    data = Dataset.of_arrays("poses", {"q": np.zeros((20, 6))}, position=np.zeros((20, 3)))
    assert lone_readings(ROBOT, data) == ([], data)


@pytest.mark.parametrize("unit, per_Nm", [("lbf ft", 0.737562), ("lbf in", 8.85075), ("kgf m", 0.1019716)])
@pytest.mark.slow
def test_a_unit_of_torque_near_newton_metres_is_told_beside_declared_masses(unit, per_Nm):
    """These went through without a word, or without their name."""
    found = first_aid(ROBOT, column(motion(ROBOT), "tau", scaled(slice(None), per_Nm)))
    assert len(found) == 1 and f"with {unit} labelled as Nm" in found[0], found


@pytest.mark.slow
def test_a_clock_that_drifts_anew_in_every_run_is_told_with_its_rate():
    """It was told as torques logged earlier throughout."""
    data = motion(ROBOT)
    half = len(data) // 2
    runs = slice(half), slice(half, None)
    late = lambda values: np.concatenate([np.interp(
        data.time[run] + 0.02 * (data.time[run] - data.time[run][0]),
        data.time[run], values[run]) for run in runs])
    torque = np.stack([late(values) for values in data.joints["tau"].T], axis=1)
    drifting = replace(data, joints=data.joints | {"tau": torque}, run=1 + (np.arange(len(data)) >= half))
    found = first_aid(ROBOT, drifting)
    assert any("2 % faster than that of the angles in each run" in line for line in found), found


@pytest.mark.parametrize("axis", [1, 2])
def test_the_sign_of_an_angle_is_not_taken_for_another_zero(axis):
    """Friction that drives says it; another zero explained a little."""
    [found] = first_aid(ROBOT, column(motion(ROBOT), "theta", scaled(axis, -1.0)))
    assert f"the friction of axis {axis + 1} drives" in found or f"opposite sign of axis {axis + 1}" in found
