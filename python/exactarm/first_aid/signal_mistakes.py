"""What columns by themselves say of usual mistakes: angles beyond the axes' limits, rates that no drive has,
time in another unit, torques beyond the drives' own, a column that stands still, a cell far off all others.

Thresholds leave room: an arm may go a little beyond its limits, but not half a range.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN, kind_of
from exactarm.data.kinds.base import runs_in_time
from exactarm.first_aid.rate_mistakes import rate_mistakes
from exactarm.first_aid.suspicion import Suspicion
from exactarm.identify.planned import controller_angles
from exactarm.numerics.stamps import typical_step
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Joint, Robot

MOST_TURNS = 4.0 * np.pi  # rad: no axis of an arm turns further than twice about itself to either side
MOST_RATE_RAD_S = 30.0  # the wrists of the fastest small arms: 15
LEAST_RATE_RAD_S = 0.02  # of the fastest axis: a degree a second shows no dynamics ...
LONG_STEP_S = 0.05  # ... and with such steps between samples, a time in milliseconds was meant
LONGEST_STEP_S = 2.0  # between samples of any motion
MICROSECONDS_S = 100.0  # and more: 0.1 s and more in milliseconds, which no log of a motion has
BEYOND = 0.25  # of an axis' range
TORQUE_BEYOND = 3.0  # times the largest that is declared
RATE_BEYOND = 3.0
FAR_OFF = 1e3  # times the 99.9 % of a column's cells
TURN = 2.0 * np.pi
NEARLY_A_TURN = 1.0  # rad, that an axis may turn between two samples beside the jump
NEARLY_ALL, LITTLE = 0.8, 0.1  # of what a run spans: one step, and the usual one
GEARED = 10.0  # ratio from which a turn of the motor is a small part of an axis' range
LEAST_OF_A_TURN = 20  # rows
LEAST_TORQUES = 10  # rows
MOVED_RAD = 0.05  # between two rows: a target at an arm's length moves by centimetres
SAME_IN_A_ROW = 20
MOST_HELD = 0.02  # share of rows: a tracker may lose its target now and then
_DEGREE = np.pi / 180.0


def limit_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    """Columns that pass what the arm and its drives can do."""
    angles = controller_angles(robot, data)
    yield from _ranges(robot, angles)
    if data.time is not None and not kind_of(data.kind).at_rest:
        yield from _rates(robot, data, angles)
    yield from _torques(robot, data)


def cell_mistakes(data: Dataset) -> Iterator[Suspicion]:
    """Single cells far off all others of their column."""
    columns = {f"{name}_{i + 1}": values[:, i]
               for name, values in data.joints.items()
               for i in range(values.shape[1])}
    for name, vector in (("x, y, z", data.position), ("gyro", data.gyro)):
        if vector is not None:
            columns |= {f"{name} ({'xyz'[k]})": vector[:, k] for k in range(3)}
    for name, values in columns.items():
        size = np.abs(values)
        if np.isnan(size).all():
            continue
        usual, at = float(np.quantile(size, 0.999, method="lower")), int(np.argmax(size))
        if len(size) > 5 and size[at] > FAR_OFF * max(usual, 1e-9):
            yield Suspicion(
                f"column {name}, {data.place_of(at)}: {values[at]:.3g} is {size[at] / max(usual, 1e-9):.2g} "
                "times as large as nearly all other cells: is it a gross error?")


def repeated_rows(data: Dataset) -> Iterator[Suspicion]:
    """Measured rows that come again in the same order, to the last digit: the same file twice. Where readings
    are rounded so coarsely that every second one of a pose is the same, true repetitions give so many in
    a row once in 2^20 times."""
    measured = [values for values in (data.position, data.gyro) if values is not None]
    measured += [data.joints[name] for name in ("tau", "tau_motor", "current") if name in data.joints]
    if not any(np.ptp(values, axis=0).any() for values in measured) or data.pixel is not None:
        return
    measured += [data.joints[name] for name in ("q", "theta") if name in data.joints]
    columns = np.nan_to_num(np.concatenate(measured, axis=1)).T
    mark = sum(weight * values for weight, values in zip(np.sqrt(_primes(len(columns))), columns))
    order = np.argsort(mark, kind="stable")
    alike = np.flatnonzero(np.diff(mark[order]) == 0.0)
    before = np.full(len(mark), -1)  # of every row the last one like it
    before[order[alike + 1]] = order[alike]
    goes_on = (before[:-1] >= 0) & (np.diff(before) == 1) & (np.diff(mark) != 0.0)
    breaks = np.flatnonzero(np.concatenate([[True], ~goes_on, [True]]))
    longest = int(np.argmax(np.diff(breaks)))
    start, length = int(breaks[longest]), int(np.diff(breaks)[longest])
    if length >= SAME_IN_A_ROW:
        yield Suspicion(
            f"{length} rows from {data.place_of(start)} on are those from "
            f"{data.place_of(int(before[start]))} on, to the last digit: was a file given twice, under "
            "another name? Intervals would be too narrow")


def _primes(count: int) -> np.ndarray:
    """The first so many: their square roots have no whole relation, so that no two rows weigh alike."""
    odd = [n for n in range(2, 20 * count + 10) if all(n % k for k in range(2, int(n**0.5) + 1))]
    return np.array(odd[:count], float)


def column_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    """Columns that no motion and no drive gives, whatever the model: wrapped angles, rates of other angles,
    torques that never change or never have a sign, a device that stands still while the arm moves."""
    yield from _wrapped(robot, data)
    yield from rate_mistakes(robot, data)
    yield from _never_changing(robot, data)
    yield from _without_sign(data)
    yield from _stuck(data)


def _never_changing(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    """A gyroscope, or one side of a gear, that reads the same to the last bit while the other side moves."""
    theta, q = (data.joints.get(name) for name in ("theta", "q"))
    if GEAR_RUN.name not in data.kinds or theta is None:
        return
    moves = np.nanmax(np.ptp(theta, axis=0) / np.abs(robot.ratios)) > MOVED_RAD
    if data.gyro is not None and moves and (np.ptp(data.gyro, axis=0) == 0.0).all():
        yield Suspicion("the gyroscope reads the same in every row while a motor moves: was it never "
                        "measured?")
    if q is not None:
        sides = np.ptp(theta, axis=0) / np.abs(robot.ratios), np.ptp(q, axis=0)
        for name, one, other in (("q", *sides), ("theta", *sides[::-1])):
            for i in np.flatnonzero((one > MOVED_RAD) & (other == 0.0)):
                yield Suspicion(f"{name}_{i + 1} is the same in every row while the other side of its gear "
                                "moves: was it never measured?")


def _without_sign(data: Dataset) -> Iterator[Suspicion]:
    if kind_of(data.kind).at_rest or len(data) <= LEAST_TORQUES:
        return
    given = {name: data.joints[name] for name in ("tau", "tau_motor") if name in data.joints}
    for name, torque in given.items():
        still = np.flatnonzero(np.ptp(torque, axis=0) == 0.0)
        if still.size:
            i = int(still[0])
            yield Suspicion(
                f"{name}_{i + 1} is {torque[0, i]:.3g} Nm in every row: is it a column that was never "
                "measured?")
            return
    alone = data.position is None and data.gyro is None  # torques are all that is measured
    if alone and given and all(np.nanmin(torque) >= 0.0 for torque in given.values()):
        yield Suspicion("no torque is ever negative, on any axis: are they absolute values?")


def _wrapped(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    revolute = np.array([joint.type == "revolute" for joint in robot.joints])
    for name in ("theta", "q"):
        values = data.joints.get(name)
        if values is None or len(values) < LEAST_OF_A_TURN:
            continue
        if not kind_of(data.kind).at_rest:
            jumps = _full_turns(values, data.run) & revolute
            if jumps.any():
                row, axis = np.argwhere(jumps)[0]
                yield Suspicion(
                    f"{name}_{axis + 1} jumps by {_turns(values, row, axis)} at "
                    f"{data.place_of(int(row) + 1)}: are the angles wrapped to one turn, as -180 to 180 "
                    "degrees, or does a counter begin anew?")
                return
        elif name == "theta" and (np.abs(robot.ratios[revolute]) > GEARED).all():
            size = np.ptp(values[:, revolute], axis=0)
            if (0.5 * TURN < size).all() and (size <= TURN).all():
                yield Suspicion(
                    "the motor angles of all axes lie within one turn of the motor: are they wrapped, as "
                    "-180 to 180 degrees?")


def _full_turns(values: np.ndarray, run: np.ndarray) -> np.ndarray:
    """(N - 1, n) bool: steps (of a run) over a turn where the whole run spans no more, and over nearly all
    that a longer run spans: no motion takes that in one step."""
    step = np.diff(values, axis=0)
    jumps = np.zeros(step.shape, bool)
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        rows = rows[:-1][np.diff(rows) == 1]
        if rows.size < LEAST_OF_A_TURN:
            continue
        span = np.nan_to_num(np.ptp(values[[*rows, rows[-1] + 1]], axis=0), nan=np.inf)
        size = np.abs(step[rows])
        one = (span <= TURN) & (size > np.pi) & (np.abs(size - TURN) < NEARLY_A_TURN)
        more = (span > TURN) & (size > NEARLY_ALL * span) & (np.median(size, axis=0) < LITTLE * span)
        jumps[rows] = one | more
    return jumps


def _turns(values: np.ndarray, row: int, axis: int) -> str:
    turns = abs(values[row + 1, axis] - values[row, axis]) / TURN
    return "a full turn" if turns < 1.5 else f"{turns:.3g} turns"


def _stuck(data: Dataset) -> Iterator[Suspicion]:
    """A device that gives its last reading again, to the last bit, though every pose differs."""
    angles = data.joints.get("q", data.joints.get("theta"))
    if data.position is None or angles is None or len(data) < LEAST_OF_A_TURN:
        return
    moved = np.nanmax(np.abs(np.diff(angles, axis=0)), axis=1) > MOVED_RAD
    held = np.flatnonzero((np.diff(data.position, axis=0) == 0.0).all(axis=1) & moved)
    if held.size > MOST_HELD * len(data):
        yield Suspicion(
            f"x, y, z are those of the row before in {held.size} rows though the arm moved, first in "
            f"{data.place_of(int(held[0]) + 1)}: had the device lost its target?")


def _ranges(robot: Robot, angles: np.ndarray) -> Iterator[Suspicion]:
    beyond = []
    for i, joint in enumerate(robot.joints):
        if joint.type != "revolute" or np.isnan(angles[:, i]).all():
            continue
        low, high = _limits(joint)
        room = BEYOND * (high - low)
        if np.nanmin(angles[:, i]) < low - room or np.nanmax(angles[:, i]) > high + room:
            beyond.append((i, low - room, high + room))
    if not beyond:
        return
    axes = axes_in_words(i for i, _, _ in beyond)
    within = lambda values, low, high: bool(np.nanmin(values) >= low and np.nanmax(values) <= high)
    largest = max(float(np.nanmax(np.abs(angles[:, i]))) for i, _, _ in beyond)
    if largest <= MOST_TURNS and all(within((angles[:, i] - low) % TURN + low, low, high)
                                     for i, low, high in beyond):
        meant = ": are they counted over another turn, as 0 to 360 degrees, or from another zero?"
    elif all(within(-angles[:, i], low, high) for i, low, high in beyond):
        meant = ": are they of the opposite sign, of another axis, or from another zero?"
    elif all(within(_DEGREE * angles[:, i], low, high) for i, low, high in beyond):
        meant = ": are they degrees labelled as radians?"
    else:
        meant = ": are they motor angles, in another unit, from another zero, or of another robot?"
    farthest = _farthest_out(robot, angles, [i for i, _, _ in beyond])
    yield Suspicion(f"joint angles of {axes} go to {farthest}{meant}")


def _limits(joint: Joint) -> tuple[float, float]:
    """What an axis can turn, or what none exceeds."""
    return (-MOST_TURNS if joint.q_min is None else joint.q_min,
            MOST_TURNS if joint.q_max is None else joint.q_max)


def _farthest_out(robot: Robot, angles: np.ndarray, axes: list[int]) -> str:
    """The angle that lies farthest outside of what its axis can turn, with its sign, and that."""
    ends = [(float(end(angles[:, i])), *_limits(robot.joints[i])) for i in axes
            for end in (np.nanmin, np.nanmax)]
    angle, low, high = max(ends, key=lambda each: max(each[1] - each[0], each[0] - each[2]))
    return f"{angle:.3g} rad, far beyond what the axis can turn ({low:.3g} to {high:.3g} rad)"


def _rates(robot: Robot, data: Dataset, angles: np.ndarray) -> Iterator[Suspicion]:
    steps, fastest = [], np.zeros(robot.axes)
    for rows in runs_in_time(data):
        if rows.size < 3:
            continue
        step = typical_step(data.time[rows])
        steps.append(step)
        apart = max(1, int(rows.size // 2000))  # over some samples: a rate of neighbours is mostly rounding
        moved = np.abs(angles[rows][apart:] - angles[rows][:-apart]) / (apart * step)
        if len(moved):
            fastest = np.fmax(fastest, np.quantile(np.nan_to_num(moved), 0.99, axis=0))
    if not steps:
        return
    step, revolute = float(np.median(steps)), np.array([joint.type == "revolute" for joint in robot.joints])
    usual = fastest[revolute].max() if revolute.any() else np.inf
    if step > LONGEST_STEP_S or (step > LONG_STEP_S and 0.0 < usual < LEAST_RATE_RAD_S):
        meant = "microseconds" if step > MICROSECONDS_S else "milliseconds"
        yield Suspicion(f"samples lie {step:.3g} s apart: is the time in {meant}, labelled as seconds?")
        return
    limits = np.array(
        [RATE_BEYOND * joint.q_dot_max if joint.q_dot_max else MOST_RATE_RAD_S for joint in robot.joints])
    fast = np.flatnonzero(revolute & (fastest > limits))
    if fast.size:
        i = fast[np.argmax(fastest[fast] / limits[fast])]
        meant = "angles in degrees labelled as radians, or a time in seconds labelled as milliseconds"
        yield Suspicion(
            f"axis {i + 1} turns at {fastest[i]:.3g} rad/s, faster than it can ({limits[i]:.3g} rad/s): is "
            f"it {meant}?")


def _torques(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    for name, factor in (("tau", np.ones(robot.axes)), ("tau_motor", robot.controller_ratios)):
        torque = data.joints.get(name)
        if torque is None:
            continue
        for i, joint in enumerate(robot.joints):
            size = np.abs(torque[:, i] * factor[i])
            if np.isnan(size).all():
                continue
            usual = float(np.quantile(size, 0.99))
            if joint.torque_max and usual > TORQUE_BEYOND * joint.torque_max:
                yield Suspicion(
                    f"{name}_{i + 1} reaches {usual:.3g} Nm, the drive {joint.torque_max:.3g} Nm: is it "
                    "another unit, or the motor's side beside the gear's?")
                return
