"""Gear identification (thesis 3.1.1) from gear runs: ratio, and harmonics per direction of motion, of every
moving axis.

1. derivative of the motor encoder, alignment of the gyroscope (3.3), gravity deflection out   gear_samples
2. kinematic error (E6), both sides filtered alike (3.1), (3.2)                                gear_error
3. coarse FFT or zoom, orders accepted by a test against noise                                 gear_orders
4. ratio and coefficients per direction by least squares (3.5), on unfiltered samples          gear_axis
5. error before and after on identification rows and on rows that were not fitted              here
Both methods of finding orders are run and compared; the chosen one goes into the robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain import gear_record
from exactarm.chain.idle_encoders import without_idle_encoders
from exactarm.data.dataset import Dataset
from exactarm.data.even_readings import at_even_readings
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.gyro_alignment import tilt
from exactarm.errors import ComputationError, InputError
from exactarm.identify.gear_axis import GearEstimate
from exactarm.identify.gear_declared import SIDES, measured_axes
from exactarm.identify.gear_error import cutoff_hz, sensor_part
from exactarm.identify.gear_found import Errors, find_gear
from exactarm.identify.gear_orders import METHODS
from exactarm.identify.gear_profile import fast_rows
from exactarm.identify.gear_samples import GearSamples
from exactarm.identify.sensor_tone import find_tones, without_tones
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.progress import SILENT, Progress
from exactarm.robot.robot import GearTable, Robot

FITTING = "gears and their harmonics"  # a step as it is told
_MUCH_OUTSIDE, _FAR_ABOVE = 0.2, 2.0  # share of validation rows; times the noise
_CERTAIN = 3.0  # standard deviations: one warning in 370 without a cause
_SAME_SPEED = 0.1  # runs whose speeds differ by less than this share count as one speed


@dataclass(frozen=True)
class HeldOut:
    """RMS of the kinematic error on rows of one set, direction and speed (rad/s at the output), by method."""

    joint: int
    side: str
    speed: float
    fitted: bool
    rows: int
    before: float
    after: dict[str, float]


@dataclass(frozen=True)
class Gear:
    """One direction of one axis. error_before, error_after (N,) over its samples, NaN on rows that do not
    count.

    declared: with the robot file's own tables and ratio; rest: as after, with all that was found beside the
    gear taken out too (delay, wind-up, friction); unfiltered: as after, without the low-pass, as
    `evaluate` has it; noise: the part of the (filtered) error that is white noise.
    """

    joint: int
    side: str
    estimate: GearEstimate
    table: GearTable
    error_before: np.ndarray
    error_after: np.ndarray
    before: dict[str, ErrorSummary]
    after: dict[str, ErrorSummary]
    declared: dict[str, ErrorSummary]
    rest: dict[str, ErrorSummary]
    unfiltered: dict[str, ErrorSummary]
    noise: float
    cutoff_hz: float | None

    @property
    def samples(self) -> GearSamples:
        return self.estimate.samples

    @property
    def unit(self) -> str:
        return self.samples.unit


@dataclass(frozen=True)
class Alignment:
    """Mean reading (3,) rad/s of one direction before and after the alignment, and its angles alpha, beta."""

    joint: int
    side: str
    angles: tuple[float, float]
    before: np.ndarray
    after: np.ndarray


@dataclass(frozen=True)
class GearIdentification:
    robot: Robot
    gears: tuple[Gear, ...]
    held_out: tuple[HeldOut, ...]
    alignments: tuple[Alignment, ...]
    method: str
    warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        return all(gear.estimate.converged for gear in self.gears)


def identify_gears(robot: Robot, data: Dataset, *, method: str = "refined", seed: int = DEFAULT_SEED,
                   threads: int = 1, progress: Progress = SILENT) -> GearIdentification:
    """Identifies every gear that moves in the data. Raises InputError where nothing can be identified."""
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}, expected one of {', '.join(METHODS)}")
    identification, logged = data.split(seed), data
    data, = map(at_even_readings, without_idle_encoders(robot, data))
    tones = find_tones(data.select(identification))
    data = without_tones(data, tones)
    record = gear_record(robot, data)
    given, result, gears, held_out, alignments = robot, robot, [], [], []
    warnings = [*_left_out(logged, record), *map(str, tones)]
    axes = measured_axes(record)
    progress.stage(FITTING, total=len(axes))
    for place, axis in enumerate(axes):
        progress.step(min(place, 1), note=f"gear {axis + 1}")
        robot, found = find_gear(robot, data, record, axis, identification, method, threads)
        if found is None:
            rows = np.ones(len(data), bool) if record.encoder_axes else record.sensor_axis == axis
            used = int(np.sum(rows & identification & record.keep))
            warnings.append(
                f"axis {axis + 1}: only {used} of its {rows.sum()} rows identify in a steady motion "
                "along a range of the axis, expected some hundreds: its gear is left as declared")
            continue
        chosen, errors, samples = found.chosen, found.errors, found.samples
        result = _with_tables(replace(result, effects=robot.effects), axis, chosen)
        gears += [_gear(chosen, side, errors) for side in chosen.tables]
        held_out += _held_out(chosen, errors)
        alignments += _alignments(data, samples, found.setup)
        warnings += [*_warnings(chosen), *found.said]
    if not gears:
        missing = "no axis moves far enough in one direction; expected gear runs over a range of its axis"
        raise InputError(warnings[-1] if axes else missing, file=data.first_file)
    warnings += _remaining(gears)
    if robot.effects != given.effects:
        delay = robot.effects[-1].values[0]
        way = "behind" if delay > 0.0 else "ahead of"
        warnings.append(
            f"the gyroscope's clock is about {1e3 * abs(delay):.3g} ms {way} the motor's: it was taken "
            "out, and stands in the robot file (time_delay) for logs by the same devices")
    intervals = dict(result.intervals)
    for gear in gears:
        ratio, half = gear.estimate.ratio, 1.96 * gear.estimate.ratio_sigma
        intervals[f"ratio_{gear.joint}"] = float(ratio - half), float(ratio + half)
    return GearIdentification(
        replace(result, intervals=intervals), tuple(gears), tuple(held_out), tuple(alignments), method,
        tuple(warnings))


def _with_tables(robot: Robot, axis: int, estimate: GearEstimate) -> Robot:
    """The robot with the ratio and the tables of the directions that were measured; the controller keeps its
    constant."""
    tables = {side: estimate.gear_table(side) for side in estimate.tables}
    for side, table in tables.items():
        try:
            _core.require_gear(f"gear of joint {axis + 1}, {side}", estimate.ratio, table.core())
        except ValueError as error:
            raise ComputationError(f"the identified gear cannot be used: {error}") from None
    controller = float(robot.controller_ratios[axis])
    return robot.with_joint(axis, ratio=estimate.ratio, controller_ratio=controller, **tables)


def _gear(estimate: GearEstimate, side: str, errors: Errors) -> Gear:
    samples, after = estimate.samples, errors.after[estimate.method]
    rows = samples.side(SIDES[side])
    sets = {"identification": rows & samples.identification, "validation": rows & ~samples.identification}
    summary = lambda error: {name: summarise(np.abs(error[mask])) for name, mask in sets.items()}
    cutoff = float(np.median([cutoff_hz(samples, rows) for rows in samples.runs])) if samples.rated else None
    return Gear(samples.axis + 1, side, estimate, estimate.gear_table(side), errors.before, after,
                summary(errors.before), summary(after), summary(errors.declared), summary(errors.rest),
                summary(errors.unfiltered), errors.noise, cutoff)


def _held_out(estimate: GearEstimate, errors: Errors) -> list[HeldOut]:
    """The comparison of the methods, by direction, set and speed."""
    samples = estimate.samples
    speeds = _speed_of_rows(samples)
    rms = lambda error, rows: float(np.sqrt(np.mean(error[rows] ** 2)))
    out = []
    for side in estimate.tables:
        for fitted in (True, False):
            rows = samples.side(SIDES[side]) & (samples.identification == fitted)
            for speed in np.unique(speeds[rows]):
                part = rows & (speeds == speed)
                after = {name: rms(error, part) for name, error in errors.after.items()}
                out.append(HeldOut(samples.axis + 1, side, float(speed), fitted, int(part.sum()),
                                   rms(errors.before, part), after))
    return out


def _speed_of_rows(samples: GearSamples) -> np.ndarray:
    """(N,) typical speed of each row's run; runs of nearly the same speed share one number."""
    own = np.array([samples.speed(rows) for rows in samples.runs])
    shared, out = own.copy(), np.zeros(samples.run.size)
    for k in np.argsort(own):
        close = np.abs(own - own[k]) <= _SAME_SPEED * own[k]
        shared[close] = np.median(own[close])
    for rows, speed in zip(samples.runs, shared):
        out[rows] = speed
    return out


def _alignments(data: Dataset, samples: GearSamples, setup) -> list[Alignment]:
    """What the alignment does to the mean reading, as Table 3.1 has it."""
    if not samples.rated:
        return []
    out = []
    for effect in setup.effects:
        turn = tilt(*effect.values)
        for side, way in SIDES.items():
            fast = np.abs(samples.rate) > 0.9 * samples.speed()
            rows = samples.rows[samples.side(way) & fast & (data.session[samples.rows] == effect.session)]
            if rows.size:
                mean = data.gyro[rows].mean(axis=0)
                out.append(Alignment(effect.joint, side, (effect.values[0], effect.values[1]), mean,
                                     turn @ mean))
    return out


def _warnings(estimate: GearEstimate):
    joint, samples = estimate.samples.axis + 1, estimate.samples
    if not estimate.converged:
        yield (f"axis {joint}: ratio and harmonics did not settle on each other: check the data for gross "
               "errors")
    if len(estimate.tables) == 1:
        side = next(iter(estimate.tables))
        yield (f"axis {joint} was measured in one direction ({side}) only: the other direction keeps its "
               "declared table")
    if samples.rated and not np.any(sensor_part(samples, estimate.disturbance)) and len(estimate.tables) == 1:
        yield (
            f"axis {joint}: one direction at one speed cannot tell the gyroscope's bias from the ratio; it "
            "is taken as 0")
    off = estimate.scale - 1.0
    if samples.rated and abs(off) > _CERTAIN * estimate.ratio_sigma / abs(samples.ratio):
        yield (
            f"axis {joint}: the ratio comes out as {estimate.ratio:.6g}, {100.0 * off:+.2g} % beside the "
            f"declared {samples.ratio:.6g}. A ratio is a count of teeth; a gyroscope whose scale is wrong by "
            "as much reads the same: only angles (two encoders, a tracker) tell them apart")
    longest = max(profile.range_rev for profile in estimate.profiles.values())
    if longest < 0.2:
        yield (
            f"axis {joint} moves over {360.0 * longest:.0f} deg: orders closer than {1.0 / longest:.0f} per "
            "revolution cannot be told apart; the table holds on this range only")
    if estimate.dropped.size:
        several = estimate.dropped.size > 1
        orders = ", ".join(f"{order:.3g}" for order in estimate.dropped)
        yield (
            f"axis {joint}: {'orders' if several else 'order'} {orders} would fit the error, but "
            f"{'are' if several else 'is'} not in the table: {why_dropped(estimate)}; it stays in the "
            "error, and the ratio is known by as much less: turn the axis further")
    elif not estimate.orders.size:
        yield f"axis {joint}: no order stands out of the noise"


def why_dropped(estimate: GearEstimate) -> str:
    """Of orders that the range of the axis does not identify."""
    degrees = 360.0 * max(profile.range_rev for profile in estimate.profiles.values())
    return (f"a wave below order {estimate.lowest:.3g} swings less than twice within the {degrees:.0f} deg "
            "of these runs, which do not tell its order")


def _left_out(data: Dataset, record) -> Iterator[str]:
    """Axes that the file has but the runs do not move: nothing is left out without a word."""
    columns = ("theta", "q") if record.encoder_axes else ("theta",)
    given = np.all([~np.isnan(data.joints[name][0]) for name in columns], axis=0)
    still = [axis for axis in np.flatnonzero(given)
             if axis not in measured_axes(record) and not record.moving[axis]]
    if still:
        names = ", ".join(str(axis + 1) for axis in still)
        several = len(still) > 1
        who = f"axes {names} stand" if several else f"axis {names} stands"
        their = "their gears are" if several else "its gear is"
        yield f"{who} still beside the others in these runs: {their} left as declared"


def _remaining(gears: list[Gear]):
    """What validation rows say beside their RMS: rows outside the fitted range, errors above the noise."""
    outside, loud = [], []
    for gear in gears:
        samples, profile = gear.samples, gear.estimate.profiles[gear.side]
        held_out = fast_rows(samples, samples.side(SIDES[gear.side]) & ~samples.identification)
        if not held_out.any():
            continue
        angle = samples.angle[held_out] / gear.estimate.scale
        share = np.mean((angle < profile.angle.min() - profile.step)
                        | (angle > profile.angle.max() + profile.step))
        left = gear.rest["validation"].rms
        if share > _MUCH_OUTSIDE:
            outside.append(f"{100.0 * share:.0f} % of {gear.joint} {gear.side}")
        if gear.noise > 0.0 and left > _FAR_ABOVE * gear.noise:
            loud.append(f"{gear.joint} {gear.side} {left / gear.noise:.1f} times")
    if outside:
        yield ("validation rows outside the angles that were fitted, where the table is extrapolated: "
               f"{', '.join(outside)}")
    if loud:
        yield ("the error on held-out rows is far above the sensor's noise, even with all but the gear's own "
               f"taken out: {', '.join(loud)}; `exactarm diagnose` looks for its cause")
