"""One gear in one set of runs: its samples, the estimate by both methods, and the errors that they leave; by
one clock, and where the arm does not swing.

A gyroscope whose clock is late shifts every wave and bends every ramp. Where what a gear leaves follows the
acceleration, the delay (effects/time_delay.py) is taken out in the chain and the gear is estimated anew, as
long as less is left. Waves of a range that hardly holds one imitate a delay: none is looked for where little
of the error asks for it.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from exactarm.chain import GearRecord, Layout
from exactarm.data.dataset import Dataset
from exactarm.effects.time_delay import TimeDelay
from exactarm.identify.gear_axis import GearEstimate, first_look, identify_axis
from exactarm.identify.gear_declared import SIDES
from exactarm.identify.gear_error import (
    kinematic_error,
    lag_in_error,
    motor_by_tables,
    noise_of_error,
    sensor_part,
)
from exactarm.identify.gear_orders import METHODS
from exactarm.identify.gear_samples import GearSamples, gear_samples
from exactarm.identify.gear_steady import swinging
from exactarm.robot.robot import Robot

_CERTAIN = 3.0  # standard deviations: one lag in 370 without a cause
_MUCH_OF_ERROR = 0.2  # of its square sum
_WORTH = 1e-3  # of the square sum, that a better delay must take away
_CLOCKS = 6  # estimates of a delay, each beside the orders that stand behind the one before


@dataclass(frozen=True)
class Errors:
    """Kinematic errors (N,) of one axis: constant ratio, each method's tables, the robot file's own, the
    chosen tables with all that stands beside the gear taken out, that of the chosen before any filter; noise
    of the chosen.
    """

    before: np.ndarray
    after: dict[str, np.ndarray]
    declared: np.ndarray
    rest: np.ndarray
    unfiltered: np.ndarray
    noise: float


def errors_of(robot: Robot, estimates: dict[str, GearEstimate], method: str) -> Errors:
    chosen = estimates[method]
    samples, joint = chosen.samples, robot.joints[chosen.samples.axis]
    sensor = sensor_part(samples, chosen.disturbance)
    tables = lambda estimate: {side: estimate.gear_table(side) for side in estimate.tables}
    own = {side: getattr(joint, side) or joint.cw or joint.ccw for side in SIDES}
    error = lambda model, disturbance=sensor, **how: kinematic_error(samples, model, disturbance, **how)
    models = {name: motor_by_tables(samples, each.scale, tables(each)) for name, each in estimates.items()}
    after = {name: error(models[name], sensor_part(samples, each.disturbance))
             for name, each in estimates.items()}
    unfiltered = error(models[method], filtered=False)
    return Errors(error(samples.motor / chosen.scale), after,
                  error(motor_by_tables(samples, 1.0,
                                        {side: table for side, table in own.items() if table is not None})),
                  after[method] if np.array_equal(sensor, chosen.disturbance)
                  else error(models[method], chosen.disturbance),
                  unfiltered, noise_of_error(samples, unfiltered))


@dataclass(frozen=True)
class Found:
    """said: in words, what was left out, or what the clocks are suspected of."""

    samples: GearSamples
    setup: Layout
    chosen: GearEstimate
    errors: Errors
    said: tuple[str, ...] = ()


def find_gear(robot: Robot, data: Dataset, record: GearRecord, axis: int, identification: np.ndarray,
              method: str, threads: int = 1) -> tuple[Robot, Found | None]:
    """The robot, with a delay of the record where one shows, and what one axis gives; None: too few rows."""
    estimated = lambda arm: _estimated(robot, *gear_samples(arm, data, record, axis, identification, threads),
                                       method, threads)
    found = estimated(robot)
    if found is None or not found.samples.rated:
        return robot, found
    robot, found = _by_one_clock(robot, found, estimated)
    late = _late(found)
    found = _where_it_is_steady(robot, found, method, threads)
    return robot, replace(found, said=(*found.said, *late))


def _estimated(robot: Robot, samples: GearSamples, setup: Layout, method: str, threads: int) -> Found | None:
    first = first_look(samples)
    if first is None:
        return None
    with ThreadPoolExecutor(max_workers=max(1, min(threads, len(METHODS)))) as pool:
        estimates = dict(zip(METHODS, pool.map(partial(identify_axis, samples, first=first), METHODS)))
    return Found(samples, setup, estimates[method], errors_of(robot, estimates, method))


def _lag(found: Found, error: np.ndarray) -> tuple[float, float]:
    """In s, 0 where it is not certain; its share of the square sum of an unfiltered error."""
    lag, sigma, share = lag_in_error(found.samples, error)
    return (lag if abs(lag) > _CERTAIN * sigma else 0.0), share


def _by_one_clock(robot: Robot, found: Found, estimated) -> tuple[Robot, Found]:
    """The tables hide a part of a long delay in orders of their own, which the error of a constant ratio
    does not: of both lags the one that leaves less is taken."""
    known = {effect.label for effect in robot.effects}
    if _lag(found, found.errors.unfiltered)[1] < _MUCH_OF_ERROR or TimeDelay(None, (0.0,)).label in known:
        return robot, found
    best, delay = robot, 0.0
    for _ in range(_CLOCKS):
        trials = []
        for error in (found.errors.unfiltered, _by_constant_ratio(found)):
            lag, _ = _lag(found, error)
            clocked = replace(robot, effects=(*robot.effects, TimeDelay(None, (delay + lag,))))
            trial = estimated(clocked) if lag else None
            trials += [(_left(trial), delay + lag, clocked, trial)] if trial is not None else []
        left, later, clocked, trial = min(trials, key=lambda each: each[0], default=(np.inf, 0.0, None, None))
        if left >= _left(found) * (1.0 - _WORTH):
            break
        best, found, delay = clocked, trial, later
    return best, found


def _by_constant_ratio(found: Found) -> np.ndarray:
    motor = found.samples.motor / found.chosen.scale
    return kinematic_error(found.samples, motor, found.chosen.disturbance, filtered=False)


def _left(found: Found) -> float:
    return float(np.nanmean(found.errors.unfiltered[found.samples.identification] ** 2))


def _late(found: Found) -> tuple[str, ...]:
    """A gyroscope whose clock is still not the motor's."""
    lag, share = _lag(found, found.errors.unfiltered)
    if not lag or share < _MUCH_OF_ERROR:
        return ()
    way = "behind" if lag > 0.0 else "ahead of"
    return (
        f"axis {found.samples.axis + 1}: {100.0 * share:.0f} % of what is left follows the acceleration, as "
        f"of a gyroscope about {1e3 * abs(lag):.2g} ms {way} the motor: its waves are shifted by that, and "
        "so are the tables; log both by one clock, or declare a time_delay (`exactarm diagnose` finds it)",)


def _where_it_is_steady(robot: Robot, found: Found, method: str, threads: int) -> Found:
    samples = found.samples
    out, reach = swinging(samples, found.errors.unfiltered)
    share = np.sum(out & samples.keep) / max(np.sum(samples.keep), 1)
    if not share:
        return found
    again = _estimated(robot, replace(samples, keep=samples.keep & ~out), found.setup, method, threads)
    if again is None or len(again.chosen.tables) < len(found.chosen.tables):
        return found
    return replace(again, said=(
        f"axis {samples.axis + 1}: what the gear leaves is larger behind ramps, as of an arm that swings: "
        f"rows up to {reach:.2g} s after an acceleration ({100.0 * share:.0f} %) were left out",))
