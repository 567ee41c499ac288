"""Single wrong readings of a time series: one or two that are far off those before and behind, which agree.

A reading v_i is compared with the line from v_(i-3) to v_(i+3). It stands alone where it is `ALONE` times as
far off that line as the third of its four nearest neighbours (which may have one wrong reading among them),
farther than nearly all of its column, and by more than an arm moves in between: `LEAST_RAD` of an angle,
`ALONE` times the fourth largest of a torque, a current or a gyroscope (in noise of three degrees of freedom,
whose tails fall as x^-3, a reading lies there in 4 ALONE^-3 = 0.4 % of columns; at twice the 99.9 %
quantile blind gear runs 92091 and 92511 were suspected). A least-squares fit follows such a reading: one
torque of 1e5 Nm among 2,400 rows raised what an identified model left from 6.7 to 24.5 Nm, one angle off by
30 degrees to 109 Nm.
"""

from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.data.kinds.base import runs_in_time
from exactarm.first_aid.suspicion import Suspicion
from exactarm.robot.robot import Robot

ALONE = 10.0
LEAST_RAD = 0.01  # of an axis (m of a sliding one): what play and stops make is smaller
_USUAL = 3.0  # times what 99 % of a column are off their lines
_STEPS = 3.0  # times the smallest change of a column: a count that flickers is no wrong reading
_LINE = 3  # readings to either side, between which the line is drawn
_NEIGHBOURS = (-2, -1, 1, 2)
_PLACE = 4  # by size, of a reading that is no wrong one: up to three may be


def lone_readings(robot: Robot, data: Dataset) -> tuple[list[Suspicion], Dataset]:
    """What is to be said of them, and a copy of the data with the line in their place, for what other
    mistakes are tried on."""
    if data.time is None or kind_of(data.kind).at_rest:
        return [], data
    runs = [rows for rows in runs_in_time(data) if rows.size > 2 * _LINE]
    joints = {name: values.copy() for name, values in data.joints.items()}
    gyro = None if data.gyro is None else data.gyro.copy()
    columns = [(f"{name}_{i + 1}", values[:, i], _least(name, robot, i)) for name, values in joints.items()
               for i in range(values.shape[1])]
    columns += [] if gyro is None else [(f"gyro_{axis}", values, 0.0) for axis, values in zip("xyz", gyro.T)]
    found = []
    for name, values, least in columns:
        rows, meant = _alone(values, runs, least)
        if rows.size:
            worst = int(np.argmax(np.abs(values[rows] - meant)))
            times = "" if rows.size == 1 else f" ({rows.size} such readings)"
            off = np.max(np.abs(values[rows] - meant)) / max(np.ptp(np.delete(values, rows)), 1e-12)
            found.append((off, Suspicion(
                f"column {name}, {data.place_of(int(rows[worst]))}: {values[rows[worst]]:.4g} stands alone "
                f"among readings of about {meant[worst]:.4g}{times}: is it a gross error?")))
            values[rows] = meant
    if not found:
        return [], data
    cleaned = replace(data, joints=joints, gyro=gyro)
    return [each for _, each in sorted(found, key=lambda pair: -pair[0])[:1]], cleaned


def _least(name: str, robot: Robot, axis: int) -> float:
    """What a reading must be off at least; 0: by what the largest others are."""
    return {"q": LEAST_RAD, "theta": LEAST_RAD * abs(robot.ratios[axis])}.get(name, 0.0)


def _alone(values: np.ndarray, runs: list[np.ndarray], least: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the readings that stand alone, and what the line says there."""
    changes = np.abs(np.concatenate([np.diff(values[run]) for run in runs] or [np.zeros(0)]))
    changes = changes[changes > 0.0]
    if not changes.size:
        return np.zeros(0, int), np.zeros(0)
    least = least or ALONE * float(np.sort(np.abs(values))[-min(_PLACE, len(values))])
    least = max(least, _STEPS * float(changes.min()))
    lines = [_Line(values[run]) for run in runs]
    usual = float(np.quantile(np.concatenate([line.off(0) for line in lines]), 0.99, method="lower"))
    least = max(least, _USUAL * usual)
    found, meant = [np.zeros(0, int)], [np.zeros(0)]
    for run, line in zip(runs, lines):
        at = np.flatnonzero(line.off(0) > least)
        third = np.sort([line.off(k)[at] for k in _NEIGHBOURS], axis=0)[2]
        at = at[line.off(0)[at] > ALONE * third]
        found.append(run[_LINE + at])
        meant.append(line.at(0)[at])
    return np.concatenate(found), np.concatenate(meant)


class _Line:
    """Of every reading of one run but the first and the last three."""

    def __init__(self, values: np.ndarray):
        self.values, self.first, self.last = values, values[: -2 * _LINE], values[2 * _LINE :]

    def at(self, k: int) -> np.ndarray:
        return self.first + (k + _LINE) / (2 * _LINE) * (self.last - self.first)

    def off(self, k: int) -> np.ndarray:
        return np.abs(self.values[_LINE + k : len(self.values) - _LINE + k] - self.at(k))
