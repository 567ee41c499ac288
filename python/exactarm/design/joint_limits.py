"""Joint angles that are to be driven, beside the limits of the axes.

    beyond_limits(robot, data, what) -> one sentence with file, row, axis and limit; empty where all rows fit

The limits hold for the angles that the controller reports (rad, m for a sliding axis). An axis without a
limit has that of a column. Measured rows are not asked: the arm was there, and may go a little beyond what
its file says.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.columns import MOST
from exactarm.data.dataset import Dataset
from exactarm.identify.planned import controller_angles
from exactarm.robot.robot import Robot

ROUNDED = 1e-6  # rad, m: poses are written with nine digits
SHOWN = 3  # rows that a sentence names; the others are counted


def beyond_limits(robot: Robot, data: Dataset, what: str) -> tuple[str, ...]:
    """One sentence where rows of `data` lie beyond the limits; `what`: a noun for them."""
    found = list(violations(robot, controller_angles(robot, data)))
    if not found:
        return ()
    rows = list(dict.fromkeys(row for row, *_ in found))
    named = "; ".join(f"{data.place_of(row)}, {words}" for row, words in found if row in rows[:SHOWN])
    more = f" and {len(rows) - SHOWN:,} more" if len(rows) > SHOWN else ""
    return (f"{len(rows):,} of {len(data):,} {what} lie beyond the limits of {robot.name}: {named}{more}",)


def violations(robot: Robot, q: np.ndarray) -> Iterator[tuple[int, str]]:
    """Row of q (N, n), and words that name axis, value and limits, for each limit passed; NaN: none."""
    low = np.array([-MOST["q"] if joint.q_min is None else joint.q_min for joint in robot.joints]) - ROUNDED
    high = np.array([MOST["q"] if joint.q_max is None else joint.q_max for joint in robot.joints]) + ROUNDED
    for row, axis in np.argwhere((q < low) | (q > high)):
        unit = "m" if robot.joints[axis].type == "prismatic" else "rad"
        yield int(row), (f"axis {axis + 1} at {q[row, axis]:.6g} {unit}, expected "
                         f"{low[axis] + ROUNDED:.6g} to {high[axis] - ROUNDED:.6g} {unit}")
