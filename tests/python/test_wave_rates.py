"""Waves of gears that pass nearly as fast as the samples of a gyroscope, or faster: their rates are exact."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import GearRecord, Layout, gear_record, predict_gear_run
from exactarm.effects.base import Effect
from exactarm.effects.direction_dependence import DirectionDependence
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.load_dependence import LoadDependence
from exactarm.effects.speed_dependence import SpeedDependence
from exactarm.robot.robot import GearTable
from exactarm.robot_file import load_robot
from gear_simulation import DEGREE, GearRuns, simulate

ORDER = 121.0  # at 120 deg/s 40 Hz
TABLE = GearTable(np.array([ORDER, 2.0 * ORDER]), np.array([4e-4, -4e-4]), np.array([-1e-4, -8e-4]))
EFFECTS = (
    None,
    GearHarmonics(2, (90.0, 1e-3, 2e-3)),
    DirectionDependence(2, (ORDER, 1e-3, -2e-3)),
    SpeedDependence(2, (2.0 * ORDER, 1e-3, 5e-4)),
    SpeedDependence(2, (0.3,)),
    LoadDependence(2, (ORDER, 1e-5, 2e-5)),
)


def runs_at(rate_hz: float):
    """Axis 2 as smooth in time as a person moves it, both ways."""
    robot = load_robot("racer-7-1.4").with_joint(1, cw=TABLE, ccw=TABLE)
    data = simulate(robot, GearRuns(2, 120.0 * DEGREE, 1, rate_hz, 0.0, tilt=(0.0, 0.0), counts=0))
    time = np.arange(int(8.0 * rate_hz)) / rate_hz
    data = data.select(np.resize(np.arange(len(data)), time.size))
    theta = np.repeat(data.joints["theta"][:1], time.size, axis=0)
    theta[:, 1] = robot.ratios[1] * (1.3 * np.sin(1.6 * time) + 0.1)
    data = replace(data, time=time, run=np.ones(time.size, int), gyro=np.zeros((time.size, 3)),
                   joints=data.joints | {"theta": theta})
    return robot, data


def predicted(effect: Effect | None, rate_hz: float, record: GearRecord | None = None) -> np.ndarray:
    robot, data = runs_at(rate_hz)
    layout = Layout.of(() if effect is None else (effect,))
    return predict_gear_run(robot, layout, data, record=record, tangents=False).measured[:, 2]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name if effect else "declared")
@pytest.mark.slow
def test_a_slow_log_shows_what_a_fast_one_does(effect):
    fast, slow = predicted(effect, 4000.0)[::40], predicted(effect, 100.0)
    inside = np.ones(slow.size, bool)
    for end in (0, slow.size):  # the differences of the motors' angles have a lower order there
        inside[max(end - 6, 0): end + 6] = False
    reversals = np.flatnonzero(np.diff(np.sign(fast)))
    for place in reversals:
        inside[max(place - 6, 0): place + 6] = False
    # what a declared spring gives way by follows the waves by differences: a thousandth of a thousandth
    assert np.max(np.abs(slow - fast)[inside]) < 1e-5


@pytest.mark.parametrize("effect", EFFECTS[1:], ids=lambda effect: effect.name)
@pytest.mark.slow
def test_so_do_the_columns_that_causes_are_searched_by(effect):
    columns = []
    for rate_hz, every in ((4000.0, 40), (100.0, 1)):
        robot, data = runs_at(rate_hz)
        view = predict_gear_run(robot, Layout.of(()), data, record=gear_record(robot, data)).view
        columns.append(view.response(effect.with_values(effect.values))[::every, 2])
    fast, slow = (each[np.abs(columns[1][:, -1]) > 0.0] for each in columns)
    middle = slice(10, -10)
    assert np.median(np.abs(slow - fast)[middle]) < 1e-5 * np.max(np.abs(fast))
