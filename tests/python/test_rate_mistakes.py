"""Measured rates that are not those of the angles beside them are told with what they seem to be."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.rate_mistakes import NEARLY, rate_mistakes
from exactarm.robot_file import load_robot


@pytest.fixture(scope="module")
def tx40():
    """The shipped motion with the rates that its drives would have logged, and their noise."""
    robot = load_robot("tx40")
    data = read_dataset(data_path("tx40/motion.parquet"), robot)
    rates = np.gradient(data.joints["theta"], data.time, axis=0)
    rates += np.random.default_rng(1).normal(0.0, 0.02 * rates.std(axis=0), rates.shape)
    return robot, replace(data, joints=data.joints | {"theta_dot": rates})


def changed(data, change):
    rates = data.joints["theta_dot"].copy()
    return replace(data, joints=data.joints | {"theta_dot": change(rates)})


def one(axis, factor):
    return lambda rates: rates * np.where(np.arange(rates.shape[1]) == axis - 1, factor, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("change, words", [
    (np.rad2deg, "theta_dot of all axes is 57.3 times the rate of theta: is it in degrees a second"),
    (np.deg2rad, "theta_dot of all axes is 0.0175 times the rate of theta: is it in radians a second"),
    (lambda rates: -rates, "theta_dot of all axes is -1 times the rate of theta: is it of the opposite sign"),
    (lambda rates: 5.0 * rates, "are all times 5 times too long?"),
    (one(3, -1.0), "theta_dot_3 is -1 times the rate of theta_3: is it of the opposite sign?"),
    (one(4, 1.0 / 48.0), "theta_dot_4 is 0.0208 times the rate of theta_4: is it in another unit, or of the "
                         "other side of the gear?"),
    (lambda rates: rates[:, [1, 0, 2, 3, 4, 5]],
     "theta_dot_1 is the rate of theta_2, not of theta_1: are the rates of axes 1 and 2 exchanged?"),
    (lambda rates: rates[::-1], "theta_dot_1 is not the rate of theta_1"),
])
def test_rates_of_something_else_are_told(tx40, change, words):
    robot, data = tx40
    assert any(words in line for line in first_aid(robot, changed(data, change)))


@pytest.mark.slow
def test_right_rates_are_not_suspected(tx40):
    robot, data = tx40
    assert first_aid(robot, data) == ()
    late = changed(data, lambda rates: np.roll(rates, 20, axis=0))  # 20 ms by a filter
    assert list(rate_mistakes(robot, late)) == []


def test_an_axis_that_stands_still_tells_no_rate(tx40):
    robot, data = tx40
    theta = data.joints["theta"].copy()
    theta[:, 0] = 1.0 + np.random.default_rng(2).normal(0.0, 1e-4, len(data))
    assert list(rate_mistakes(robot, replace(data, joints=data.joints | {"theta": theta}))) == []


@pytest.mark.parametrize("beside, told", [(1.0 + 0.9 * NEARLY, 0), (1.0 + 1.2 * NEARLY, 1)])
def test_what_a_filter_takes_is_no_other_unit(tx40, beside, told):
    robot, data = tx40
    assert len(list(rate_mistakes(robot, changed(data, one(2, beside))))) == told
