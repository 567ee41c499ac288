"""One axis that turns by another factor than its angles say, a wrong gear ratio, or counts from another zero:
both have a size, which is searched."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.data.dataset import Dataset
from exactarm.first_aid.pose_candidates import scaled, turned, with_angles
from exactarm.first_aid.suspicion import FALL, Suspicion
from exactarm.robot.robot import Robot

SUSPICIOUS_SHARE = 0.005  # of the reach: a whole axis that turns wrongly leaves more
# wrong ratios of gears, from which the best one is looked for
_SCALES = (0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.25, 2.0)
# other zeros, from which the best one is looked for; a smaller one is calibrated
_ZEROS_RAD = tuple(np.deg2rad([sign * k for k in (5, 10, 20, 35, 60, 90, 120, 150, 180) for sign in (1, -1)]))
_LITTLE = 10.0  # a fall below which a zero or ratio of one axis may explain more
_LEAST_ZERO_RAD = np.deg2rad(2.0)

Falls = Callable[[Sequence[Dataset]], Sequence[float]]  # of data sets with changed angles
Change = Callable[[int, float], Callable[[np.ndarray, str], np.ndarray]]


def scales_and_zeros(robot: Robot, data: Dataset, found: Sequence[Suspicion],
                     falls: Falls) -> Iterator[Suspicion]:
    """What explains more than the mistakes that were `found`, where these explain little."""
    turning = [i for i in range(robot.axes) if robot.joints[i].type == "revolute"]
    if not turning or max((each.fall for each in found), default=0.0) >= _LITTLE:
        return
    best = lambda *change: _best_of_axes(turning, data, falls, *change)
    scale = best((*_SCALES, 1.0), lambda i, factor: scaled([i], factor))
    zero = best((*_ZEROS_RAD, 0.0), lambda i, angle: turned(i, angle, robot))
    if scale[0] >= FALL:
        yield Suspicion(f"axis {scale[1] + 1} turning {scale[2]:.4g} times as far as the data say (its gear "
                        "ratio?)", scale[0])
    if zero[0] >= FALL and abs(zero[2]) > _LEAST_ZERO_RAD:
        degrees = f"{np.degrees(zero[2]):+.3g} degrees"
        yield Suspicion(f"another zero of axis {zero[1] + 1} (by {degrees})", zero[0])


def _best_of_axes(turning: list[int], data: Dataset, falls: Falls, grid: tuple[float, ...],
                  change: Change) -> tuple[float, int, float]:
    """Fall, axis and size of the change of one axis' angles that explains most; the last of the grid: no
    change."""
    def fallen(pairs: list[tuple[int, float]]) -> Sequence[float]:
        return falls([with_angles(data, change(*pair)) for pair in pairs])

    pairs = [(i, size) for i in turning for size in grid[:-1]]
    axis, size = pairs[int(np.argmax(fallen(pairs)))]
    around = np.sort(grid)
    place = int(np.searchsorted(around, size))
    ends = around[max(place - 1, 0)], around[min(place + 1, len(around) - 1)]
    best = scipy.optimize.minimize_scalar(lambda value: -fallen([(axis, value)])[0], bounds=ends,
                                          method="bounded", options={"maxiter": 40, "xatol": 1e-5})
    return -float(best.fun), axis, float(best.x)
