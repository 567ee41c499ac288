"""Usual mistakes in gear runs: motor and link side, units, signs, axes, time, a clock that drifts.

Between encoders: the slope of theta_i over q_i is the gear ratio. Under a gyroscope: the size of its reading
is the rate of the moving motor over the ratio. What the slope is instead tells the mistake.
"""

from dataclasses import replace

import numpy as np

from exactarm.chain.lost_samples import between_gaps
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import rows_of_runs, runs_in_time
from exactarm.first_aid.clock_drift import lags
from exactarm.first_aid.odd_gear_runs import (
    gyro_runs,
    odd_gear_runs,
    rate_on_even_clock,
    runs_of_several_axes,
)
from exactarm.first_aid.signal_mistakes import LONG_STEP_S
from exactarm.first_aid.suspicion import Suspicion, run_words
from exactarm.first_aid.tracked_mistakes import clock_suspicions
from exactarm.numerics.stamps import typical_step
from exactarm.robot.robot import Robot
from exactarm.view import motor_angles

RATIO_TOLERANCE = 0.03  # teeth are counted; a gear's error is below a thousandth
# s: no effect of a gear delays its far side so long; backlash does at a reversal only, and one axis by itself
MUCH_LAG_S, LEAST_DRIFT_S = 0.05, 0.02
NEARLY = 0.1  # for a slope that is meant to be some other number
LEAST_CORRELATION = 0.5
FAR = 0.2  # of the longest run of an axis: backlash makes a ratio of a shorter one
# a small gyroscope's scale is wrong by up to 3 %, and its bias of 0.01 rad/s adds 3 % to runs one way at
# 0.3 rad/s
GYRO_TOLERANCE = 0.06
_DEGREE = np.pi / 180.0
_LEAST_ROWS = 30


def gear_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    theta = data.joints.get("theta")
    if theta is None:
        return []
    return _of_gyroscope(robot, data) if data.gyro is not None else _of_encoders(robot, data)


def _of_encoders(robot: Robot, data: Dataset) -> list[Suspicion]:
    theta, q = data.joints["theta"], data.joints.get("q", np.full_like(data.joints["theta"], np.nan))
    found = []
    both = np.flatnonzero(~np.isnan(theta[0]) & ~np.isnan(q[0]))
    for i in both:
        rows, where = _off(robot, data, int(i))
        if rows.size == 0:
            continue
        slope, correlation = _slope(theta[rows, i], q[rows, i], data.run[rows])
        if abs(correlation) < LEAST_CORRELATION:
            words = _other_link(robot, theta[rows, i], q[rows], data.run[rows], int(i), both)
            if words:
                found.append(Suspicion(f"{where}{words}"))
            continue
        share = slope / robot.ratios[i]
        found.append(
            Suspicion(
                f"{where}axis {i + 1}: theta_{i + 1} goes {slope:.4g} times as far as q_{i + 1}, the file's "
                f"gear ratio is {robot.ratios[i]:.4g}: {_meant(share, slope * robot.ratios[i], int(i) + 1)}"))
    return found or _of_clocks(robot, data, both)


def _off(robot: Robot, data: Dataset, axis: int) -> tuple[np.ndarray, str]:
    """Rows in which the sides of the gear do not follow its ratio; and where that is, if not in all runs."""
    theta, q = data.joints["theta"][:, axis], data.joints["q"][:, axis]
    rows = rows_of_runs(data)
    spans = [min(np.ptp(theta[each] / robot.ratios[axis]), np.ptp(q[each])) for each in rows]
    moving = [each for each, span in zip(rows, spans) if span > FAR * max(spans)]
    off = []
    for each in moving:
        slope, correlation = _slope(theta[each], q[each], data.run[each])
        follows = abs(slope / robot.ratios[axis] - 1.0) < RATIO_TOLERANCE
        if correlation and not (follows and abs(correlation) > LEAST_CORRELATION):
            off.append(each)
    if not off:
        return np.zeros(0, int), ""
    where = f"{run_words(data, off[0])}: " if len(off) < len(moving) else ""
    return np.concatenate(off), where


def _slope(motor: np.ndarray, link: np.ndarray, run: np.ndarray) -> tuple[float, float]:
    """Of the motor's angle over the link's, and their correlation; zero where one of them stands still."""
    motor, link = _centred(motor, run), _centred(link, run)
    size = float(np.linalg.norm(motor) * np.linalg.norm(link))
    return (float(motor @ link / (link @ link)), float(motor @ link) / size) if size else (0.0, 0.0)


def _of_clocks(robot: Robot, data: Dataset, both: np.ndarray) -> list[Suspicion]:
    """Encoders on the two sides of the gears that do not keep the same time, as all axes have it."""
    for rows in runs_in_time(data):
        time, told = data.time[rows], []
        if rows.size < _LEAST_ROWS or not 0.0 < typical_step(time) < LONG_STEP_S:
            continue
        for i in both:
            sides = (data.joints["theta"][rows, i] / robot.ratios[i], data.joints["q"][rows, i])
            even, *sides = between_gaps(time, *sides)
            rates = [rate_on_even_clock(even, values, _smooth)[1] for values in sides]
            told += [found] if (found := lags(even, *rates)) else []
        if not told:
            continue
        first, last = (np.array([getattr(each, name) for each in told]) for name in ("first", "last"))
        drift = last - first
        one_way = bool(np.all(np.sign(drift) == np.sign(drift[0])))
        if (one_way and abs(np.median(drift)) > LEAST_DRIFT_S) or abs(np.median(first)) > MUCH_LAG_S:
            typical = replace(told[0], first=float(np.median(first)), last=float(np.median(last)))
            run = data.run[rows[0]]
            return clock_suspicions(typical, f"run {run}", "the encoder behind the gear", MUCH_LAG_S)
    return []


def _centred(values: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Less the mean of each run: encoders count from anywhere."""
    _, number = np.unique(run, return_inverse=True)
    mean = np.bincount(number, values) / np.bincount(number)
    return values - mean[number]


def _other_link(robot: Robot, motor: np.ndarray, q: np.ndarray, run: np.ndarray, axis: int,
                both: np.ndarray) -> str:
    """Whether the motor turns another axis' link with that axis' or its own ratio."""
    motor = _centred(motor, run)
    if np.ptp(motor) / abs(robot.ratios[axis]) < 1e-4:
        return ""  # it stands still, and so need no link
    for j in both:
        link = _centred(q[:, j], run)
        if (
            j != axis
            and abs(motor @ link) > (1.0 - NEARLY) * np.linalg.norm(motor) * np.linalg.norm(link) > 0.0
        ):
            return f"theta_{axis + 1} follows q_{j + 1}, not q_{axis + 1}: are two axes exchanged?"
    return (
        f"theta_{axis + 1} and q_{axis + 1} do not follow each other: are columns exchanged, or files of two "
        "motions mixed?")


def _meant(share: float, product: float, axis: int) -> str:
    near = lambda value, goal: abs(value / goal - 1.0) < NEARLY
    if near(share, -1.0):
        return "does one of the two have the opposite sign?"
    if near(abs(product), 1.0):
        return f"are the columns theta_{axis} and q_{axis} exchanged?"
    for factor, words in ((1.0 / _DEGREE, "is theta in degrees, or q in radians labelled as degrees?"),
                          (_DEGREE, "is q in degrees, or theta in radians labelled as degrees?")):
        if near(abs(share), factor):
            return words
    return "is the ratio in the robot file that of this arm?"


def _of_gyroscope(robot: Robot, data: Dataset) -> list[Suspicion]:
    theta, found = motor_angles(robot, data), []
    slopes: dict[int, list[float]] = {}
    runs = gyro_runs(robot, data, _smooth)
    for run in runs:
        rows, axis = run.rows, run.axis
        time, angle, gyro = between_gaps(data.time[rows], theta[rows, axis] / robot.ratios[axis],
                                         data.gyro[rows])
        time, rate = rate_on_even_clock(time, angle, _smooth)
        along = gyro.T @ rate
        size = max(float(np.linalg.norm(along)), 1e-300)
        slopes.setdefault(axis, []).append(size / max(float(rate @ rate), 1e-300))
        reading = _smooth(gyro @ (along / size))
        # A bias would look like a clock, late where the rate rises and early where it falls. Mean and scatter
        # tell it whatever the lag is.
        bias = reading.mean() - reading.std() / max(rate.std(), 1e-300) * rate.mean()
        late = lags(time, rate, reading - bias)
        found += clock_suspicions(late, f"run {data.run[rows[0]]}", "the gyroscope", MUCH_LAG_S)
    shares = {axis: float(np.median(values)) for axis, values in slopes.items() if np.median(values) > 0.0}
    odd = odd_gear_runs(data, runs, GYRO_TOLERANCE, _reading)
    together = runs_of_several_axes(robot, data)
    return together + (odd or _far_off(shares) or found[:1] or _somewhat_off(robot, shares))


def _far_off(shares: dict[int, float]) -> list[Suspicion]:
    """By axis: the reading over the rate of the motor behind its ratio."""
    said = [Suspicion(f"the gyroscope reads {share:.3g} times the rate of motor {axis + 1} over its ratio: "
                      f"{_reading(share)}")
            for axis, share in shares.items() if not 1.0 / 1.5 < share < 1.5]
    return said[:1]


def _somewhat_off(robot: Robot, shares: dict[int, float]) -> list[Suspicion]:
    """One axis alone has another ratio; all alike, the sensor has another scale."""
    off = {axis: share for axis, share in shares.items() if abs(share - 1.0) > GYRO_TOLERANCE}
    common = float(np.median(list(shares.values()))) if shares else 1.0
    alike = all(abs(share / common - 1.0) < RATIO_TOLERANCE for share in shares.values())
    if len(off) > 1 and alike:
        return [Suspicion(f"the gyroscope reads {common:.4g} times the rate of every motor over its ratio: "
                          "is its scale that of its data sheet?")]
    words = "; ".join(f"motor {axis + 1} over its ratio {robot.ratios[axis]:.4g}: {share:.4g} times; is "
                      f"the ratio {robot.ratios[axis] / share:.4g}?" for axis, share in off.items())
    return [Suspicion(f"what the gyroscope reads beside the rate of {words}")] if off else []


def _smooth(values: np.ndarray) -> np.ndarray:
    """A moving mean; beyond its ends a run goes on as it went, which it was in where it is cut in motion."""
    width = max(1, min(25, len(values) // 20))
    padded = np.pad(values, width // 2, mode="reflect", reflect_type="odd")
    return np.convolve(padded, np.ones(width) / width, mode="same")[width // 2 :][: len(values)]


def _reading(slope: float) -> str:
    near = lambda goal: abs(slope / goal - 1.0) < NEARLY
    if near(1.0 / _DEGREE):
        return (
            "is it in deg/s labelled as rad/s, or the motor angle in degrees labelled as radians the other "
            "way round?")
    if near(_DEGREE):
        return "is it in rad/s labelled as deg/s, or the motor angle in degrees labelled as radians?"
    if near(1e3) or near(1e-3):
        return "is the time in another unit (ms or s)?"
    return "is the ratio in the robot file that of this arm, and does the sensor sit on the moving link?"
