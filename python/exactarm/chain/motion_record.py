"""A motion log made ready for prediction: one filter on both sides, angles with rates, fewer rows.

The measured torque passes an acausal Butterworth low-pass (fourth order, forwards and backwards) at the
bandwidth f; the angles pass the same at 2.5 f, which leaves the band of the torque untouched, and are
differentiated. Rows are then resampled at 12.5 f a second (25 f where gear harmonics are declared). The
prediction, friction's jumps and all, goes through the low-pass at f too (thesis (3.2): both sides alike), so
it is never asked for what the measured side has lost. Stamps that scatter are made even first. Short gaps in
time are filled (lost_samples.py); long ones (rows that are not to be fitted) cut a run into stretches, each
with its own ends: `runs` are these.

Torque (N, n) in Nm on the output side: tau, or nominal ratio times tau_motor, or nominal ratio times torque
constant times current (1 Nm/A where no constant is declared). Axes whose torque was not measured hold NaN.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from exactarm import _core
from exactarm.chain.angle_noise import AngleNoise, angle_noise, quiet_acceleration, sampled_angles
from exactarm.chain.direction import direction_of_motion
from exactarm.chain.dry_friction import DryFriction
from exactarm.chain.encoder_counts import between_counts, crept
from exactarm.chain.log_samples import ORDER, LogSamples, low_pass
from exactarm.chain.lost_samples import FILLED_PERIODS, Filled, without_gaps
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import runs_in_time
from exactarm.errors import InputError
from exactarm.numerics.signals import at_even_times, derivative_operator, even_clock
from exactarm.numerics.stamps import typical_step
from exactarm.rest_load import declared_constants, drive_torque
from exactarm.robot.robot import Robot
from exactarm.view import motor_angles

BANDWIDTH_HZ = 20.0  # arms are moved below 5 Hz and swing near 10 Hz
SLOW_HZ = 5.0
UNDECLARED_NM_A = 1.0
_WIDE = 2.5  # bandwidth of the angles over that of the torque
_ROWS_PER_PERIOD = 12.5
_ROWS_WITH_HARMONICS = 25.0  # gear errors reach beyond the band: they must not fold back into it
_SLOWEST_HZ, _BELOW_RESONANCE = 5.0, 0.6
_LARGEST = 0.4  # of the sampling rate: no low-pass above it
_FOLDED = 0.1  # of the rows: fewer are not what a wave over all of them rests on
_LEAST_LEFT = 0.5  # of the rows; where fewer remained, those of creeping axes stay
_EDGE_PERIODS = 3.0  # of the bandwidth, left out at both ends of a run


@dataclass(frozen=True)
class MotionRecord:
    """theta, theta_dot, theta_ddot, torque (N, n); inside (N,) bool: rows away from the ends of their run;
    at_reversal (N,) bool: rows that hang on what no model defines (chain/passage.py); keep: inside and not
    at_reversal; behind_kept: how many more stay because too few rows would be left.

    creeping (N,) bool: rows at which the rounding of a slow axis' angle decides its friction; noise: of the
    angles (chain/angle_noise.py); both None where nothing was measured.
    direction (N, n): of the motor's motion, -1 to 1 (chain/direction.py).
    data: the resampled rows; runs: row indices in the order of time; bandwidth_hz: None where nothing was
    filtered; step, logged_step: s between its rows and between those of the log;
    dry: how dry friction turns over (chain/dry_friction.py, identify/friction_width.py); samples: those of
    the log behind the rows, None where there is none beside them.
    """

    data: Dataset
    theta: np.ndarray
    theta_dot: np.ndarray
    theta_ddot: np.ndarray
    torque: np.ndarray
    direction: np.ndarray
    inside: np.ndarray
    runs: tuple[np.ndarray, ...]
    bandwidth_hz: float | None
    step: float
    logged_step: float
    dry: DryFriction
    at_reversal: np.ndarray
    behind_kept: int = 0
    creeping: np.ndarray | None = None
    noise: AngleNoise | None = None
    samples: LogSamples | None = None

    @property
    def keep(self) -> np.ndarray:
        kept = self.inside & ~self.at_reversal & ~self.dry.unsettled(self)
        return kept if self.creeping is None else kept & ~self.creeping

    @cached_property
    def _dry_signs(self) -> dict[int, np.ndarray]:
        return {}

    def dry_sign(self, index: int) -> np.ndarray:
        """(S,) sign of the dry friction of an axis (from 0) as its motor was logged."""
        if index not in self._dry_signs:
            log = self.samples
            self._dry_signs[index] = self.dry.sign(index, log.rate[:, index], log.angle[:, index], log.runs)
        return self._dry_signs[index]

    def mean_dry_sign(self, index: int) -> np.ndarray:
        """(N,) the same, gathered."""
        return self._gathered("dry sign", index, lambda: self.dry_sign(index))

    def mean_dry_slope(self, index: int) -> np.ndarray:
        """(N,) its slope by the rate, gathered."""
        return self._gathered("slope of the dry sign", index,
                              lambda: self.dry.slope_by_rate(index, self.samples.rate[:, index]))

    def _gathered(self, name: str, index: int, over_samples: Callable[[], np.ndarray]) -> np.ndarray:
        """Kept beside the log, for the same laws are asked for again and again."""
        known, law = self.samples.known, (name, index, *self.dry.law(index))
        if law not in known:
            known[law] = self.samples.gathered(over_samples())
        return known[law]

    @property
    def measured_axes(self) -> np.ndarray:
        """Axes (from 0) whose torque was measured."""
        return np.flatnonzero(~np.isnan(self.torque).all(axis=0))

    def folded(self, robot: Robot) -> np.ndarray:
        """(n,) bool: axes whose declared gear waves pass faster than the log's samples show, in more than a
        few rows; what such waves leave in a torque folds back to any order."""
        highest = np.array([joint.highest_order for joint in robot.joints])
        turns = np.abs(self.theta_dot / robot.ratios) / (2.0 * np.pi)
        return np.mean(highest * turns * self.logged_step > 0.5, axis=0) > _FOLDED

    @cached_property
    def _derivative(self) -> sparse.csr_array:
        blocks = [derivative_operator(self.data.time[rows]) for rows in self.runs]
        order = np.concatenate(self.runs)
        matrix = sparse.block_diag(blocks, format="csr")
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        return matrix[place][:, place]

    def derivative(self, values: np.ndarray) -> np.ndarray:
        """Time derivative of (N, ...) within each run."""
        return (self._derivative @ values.reshape(len(values), -1)).reshape(values.shape)

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """The low-pass of the measured torque on (N, ...)."""
        return self._low_passed(values, 1.0)

    def smooth_angle(self, values: np.ndarray) -> np.ndarray:
        """The low-pass of the measured angles on (N, ...)."""
        return self._low_passed(values, _WIDE)

    def slow(self, values: np.ndarray) -> np.ndarray:
        """(N, ...) behind a low-pass that leaves what arms are moved by, if anything was filtered."""
        return (values if self.bandwidth_hz is None
                else self._low_passed(values, min(SLOW_HZ / self.bandwidth_hz, 1.0)))

    def _low_passed(self, values: np.ndarray, wider: float) -> np.ndarray:
        if self.bandwidth_hz is None or wider * self.bandwidth_hz >= _LARGEST / self.step:
            return values
        out = np.empty_like(values)
        for rows in self.runs:
            out[rows] = low_pass(values[rows], wider * self.bandwidth_hz, self.step)
        return out

    def white_share(self, step: float) -> float:
        """Share of the variance of white noise, sampled every `step` s, behind the low-pass of the torque."""
        if self.bandwidth_hz is None:
            return 1.0
        frequency = np.linspace(0.0, 0.5 / step, 4096)
        return float(np.mean((1.0 + (frequency / self.bandwidth_hz) ** (2 * ORDER)) ** -2.0))

    def noise_autocorrelation(self, lags: int) -> np.ndarray:
        """(lags + 1,) of white noise behind the low-pass."""
        if self.bandwidth_hz is None:
            return np.eye(1, lags + 1)[0]
        frequency = np.fft.rfftfreq(max(4096, 4 * lags), self.step)
        power = (1.0 + (frequency / self.bandwidth_hz) ** (2 * ORDER)) ** -2.0  # amplitude twice, squared
        found = np.fft.irfft(power)[: lags + 1]
        return found / found[0]


def motion_record(robot: Robot, data: Dataset, bandwidth_hz: float | None = None,
                  rows_share: float = 1.0) -> MotionRecord:
    """The record of a motion; `bandwidth_hz`: None = `default_bandwidth`, or no filter where the log is too
    slow for one. rows_share: of the usual rows, where fewer will do.

    Raises InputError where torque, angles or time are missing or a run is too short.
    """
    if data.time is None:
        raise InputError("a motion needs a time: expected the column time_s")
    torque, (time, theta) = measured_torque(robot, data), _on_even_clocks(robot, data)
    rates = _given_rates(robot, data)
    noise = angle_noise(robot, data, theta, torque, rates)
    bandwidth = _bandwidth(robot, data, noise) if bandwidth_hz is None else bandwidth_hz
    parts, steps, waves = [], [], any(joint.has_harmonics for joint in robot.joints)
    each_period = rows_share * (_ROWS_WITH_HARMONICS if waves else _ROWS_PER_PERIOD)
    for rows in runs_in_time(data):
        step = typical_step(data.time[rows]) if rows.size > 1 else np.inf
        steps.append(step)
        signals = (theta[rows], torque[rows], *(() if rates is None else (rates[rows],)))
        stretches = [_Run(rows, step, bandwidth < _LARGEST / step, each_period, stretch)
                     for stretch in without_gaps(time[rows], signals, FILLED_PERIODS / bandwidth)]
        if short := max(stretches, key=lambda run: run.stretch.time.size).too_short(bandwidth):
            raise InputError(short)
        parts += [run.resampled(bandwidth) for run in stretches if not run.too_short(bandwidth)]
    filtered = all(bandwidth < _LARGEST / step for step in steps)
    if not filtered and any(bandwidth < _LARGEST / step for step in steps):
        raise InputError("runs of one motion were logged at very different rates; expected one sampling rate")
    kept = np.concatenate([part[0] for part in parts])
    stack = lambda k: np.concatenate([part[k] for part in parts])
    counts = np.cumsum([0] + [len(part[0]) for part in parts])
    creeping = np.any(stack(10) & noise.creeps(bandwidth, float(np.median(steps))), axis=1)
    if np.mean(~creeping[stack(5)]) < _LEAST_LEFT:
        creeping[:] = False
    sides = [direction_of_motion(part[6], part[1] / np.abs(robot.ratios)) for part in parts]
    return MotionRecord(data=replace(data.select(kept), time=stack(6)), theta=stack(1), theta_dot=stack(2),
                        theta_ddot=stack(3), torque=stack(4), direction=np.concatenate(sides),
                        inside=stack(5), runs=tuple(np.arange(a, b) for a, b in zip(counts[:-1], counts[1:])),
                        bandwidth_hz=bandwidth if filtered else None,
                        step=float(np.median([np.median(np.diff(part[6])) for part in parts])),
                        logged_step=float(np.median(steps)), dry=DryFriction.of(robot.axes),
                        at_reversal=np.zeros(len(kept), bool), creeping=creeping, noise=noise,
                        samples=_samples(robot, parts, float(np.median(steps)), bandwidth))


def _samples(robot: Robot, parts: list[tuple], step: float, bandwidth: float) -> LogSamples | None:
    every = {part[9] for part in parts}
    if len(every) > 1:  # runs that were not logged alike
        return None
    ends = np.cumsum([0] + [len(part[7]) for part in parts])
    cutoff = _WIDE * bandwidth if _WIDE * bandwidth < _LARGEST / step else None
    angle, rate = (np.concatenate([part[k] for part in parts]) / robot.controller_ratios for k in (7, 8))
    runs = tuple(slice(a, b) for a, b in zip(ends[:-1], ends[1:]))
    return LogSamples(angle, rate, runs, every.pop(), step, cutoff)


def default_bandwidth(robot: Robot, data: Dataset) -> float:
    """20 Hz; lower where the noise of the angles would drown that of the torque, and well below the arm's
    lowest resonance where declared gear errors, or that noise, shake declared springs.

    Near it, what the drives feel hangs on a damping that nobody declared.
    """
    theta, torque = _on_even_clocks(robot, data)[1], measured_torque(robot, data)
    return _bandwidth(robot, data, angle_noise(robot, data, theta, torque, _given_rates(robot, data)))


def _bandwidth(robot: Robot, data: Dataset, noise: AngleNoise) -> float:
    bandwidth = min(noise.quiet_below, BANDWIDTH_HZ)
    shaken = any(joint.has_harmonics for joint in robot.joints) or bandwidth < BANDWIDTH_HZ
    if shaken and all(joint.spring_linear for joint in robot.joints) and robot.links is not None:
        stiffness = np.diag([joint.spring_linear for joint in robot.joints])
        softest = min(linalg.eigh(stiffness, mass, eigvals_only=True)[0]
                      for mass in _core.mass_matrix(robot.core, sampled_angles(robot, data)))
        bandwidth = min(bandwidth, _BELOW_RESONANCE * float(np.sqrt(softest)) / (2.0 * np.pi))
    return max(bandwidth, _SLOWEST_HZ)


def full_record(robot: Robot, data: Dataset, bandwidth_hz: float | None = None,
                joints: np.ndarray | None = None) -> MotionRecord:
    """Every row of `data`, angles as they are, at the times when they were read, and nothing measured: only
    their rates pass the low-pass of the angles, which is lower (default: 2.5 times 20 Hz) where accelerations
    would be the noise of the angles.

    `joints` (N, n): joint angles whose motion tells the direction, where they are known (default: the
    motors').
    """
    theta = motor_angles(robot, data)
    turned = theta / np.abs(robot.ratios) if joints is None else joints * np.sign(robot.ratios)
    rate, acceleration, direction = np.zeros_like(theta), np.zeros_like(theta), np.zeros_like(theta)
    whole, runs = runs_in_time(data), []
    step = float(np.median(np.concatenate([np.diff(data.time[rows]) for rows in whole])))
    time, even = _on_even_clocks(robot, data)
    sampled = data.time.astype(float)
    for run in whole:
        if np.array_equal(even[run], theta[run]):  # read evenly, whatever the stamps say
            sampled[run] = time[run]
    data = replace(data, time=sampled)
    if bandwidth_hz is None:
        wide = quiet_acceleration(even / robot.ratios, whole, step, _WIDE * BANDWIDTH_HZ)
        bandwidth_hz = wide / _WIDE
    filtered = _WIDE * bandwidth_hz < _LARGEST / step
    for run in whole:
        for stretch in without_gaps(time[run], (even[run],), FILLED_PERIODS / bandwidth_hz):
            rows = run[stretch.row[stretch.given]]
            derivative, angle = derivative_operator(stretch.time), stretch.signals[0]
            own = derivative @ (low_pass(angle, _WIDE * bandwidth_hz, step) if filtered else angle)
            rate[rows], acceleration[rows] = own[stretch.given], (derivative @ own)[stretch.given]
            direction[rows] = direction_of_motion(data.time[rows], turned[rows])
            runs.append(rows)
    band = bandwidth_hz if bandwidth_hz < _LARGEST / step else None
    torque = np.full_like(theta, np.nan)
    inside = np.ones(len(data), bool)
    return MotionRecord(data, theta, rate, acceleration, torque, direction, inside, tuple(runs), band, step,
                        step, DryFriction.of(robot.axes), ~inside)


def _on_even_clocks(robot: Robot, data: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Times (N,) and motor angles (N, n) of all runs."""
    time, theta = data.time.astype(float), motor_angles(robot, data).copy()
    for rows in runs_in_time(data):
        time[rows], theta[rows] = _on_an_even_clock(robot, time[rows], theta[rows])
    return time, theta


def _on_an_even_clock(robot: Robot, stamps: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (R,) of a run without the jitter of their stamps, and its motor angles (R, n) at them."""
    time = even_clock(stamps)
    if time is stamps:
        return stamps, theta
    return time, at_even_times(theta, stamps, time, int(np.argmax(np.ptp(theta / robot.ratios, axis=0))))


def measured_torque(robot: Robot, data: Dataset) -> np.ndarray:
    """(N, n) output-side torque in Nm, NaN where an axis has none."""
    torque = drive_torque(robot, data, declared_constants(robot, UNDECLARED_NM_A))
    if np.isnan(torque).all():
        raise InputError("no torque: expected columns tau_i_Nm, tau_motor_i_Nm or current_i_A")
    return torque


def _given_rates(robot: Robot, data: Dataset) -> np.ndarray | None:
    """(N, n) measured motor rates, where every axis with an angle has one."""
    rates = np.full((len(data), robot.axes), np.nan)
    for name, factor in (("theta_dot", 1.0), ("q_dot", robot.controller_ratios)):
        if name in data.joints:
            rates = np.where(np.isnan(rates), data.joints[name] * factor, rates)
    angles = np.zeros(robot.axes, bool)
    for name in ("theta", "q"):
        if name in data.joints:
            angles |= ~np.isnan(data.joints[name]).all(axis=0)
    missing = np.isnan(rates).any(axis=0)
    return None if np.any(missing & angles) else np.nan_to_num(rates)


@dataclass(frozen=True)
class _Run:
    """A stretch without a gap of a run with these rows in the order of time, its sampling step, and whether
    it is filtered."""

    rows: np.ndarray
    step: float
    filtered: bool
    rows_per_period: float
    stretch: Filled

    def _edge(self, bandwidth: float) -> int:
        return int(np.ceil(_EDGE_PERIODS / (bandwidth * self.step) - 1e-9)) if self.filtered else 4

    def too_short(self, bandwidth: float) -> str:
        """What is wrong with its length; empty where nothing is."""
        count, least = self.stretch.time.size, 2 * self._edge(bandwidth) + 10
        if count >= least:
            return ""
        return f"a run of {count} samples without a gap is too short; expected at least {least}"

    def resampled(self, bandwidth):
        """(kept rows, theta, theta_dot, theta_ddot, torque, keep, time) of the stretch, angle and rate of all
        its samples, how many of these a row stands for, and (R, n) where too few counts tell a rate."""
        step, edge, time = self.step, self._edge(bandwidth), self.stretch.time
        angle, moment, *rates = self.stretch.signals
        wide = _WIDE * bandwidth
        if self.filtered and wide < _LARGEST / step:
            angle = low_pass(between_counts(angle, time, wide), wide, step)
        derivative = derivative_operator(time)
        rate = rates[0] if rates else derivative @ angle
        if rates and self.filtered and wide < _LARGEST / step:
            rate = low_pass(rate, wide, step)
        acceleration = derivative @ rate
        every = 1
        if self.filtered:
            moment = low_pass(moment, bandwidth, step)
            every = max(1, int(1.0 / (self.rows_per_period * bandwidth * step) + 1e-9))
        keep = np.zeros(time.size, bool)
        keep[edge : time.size - edge] = True
        pick = slice(0, None, every)
        rows = self.rows[self.stretch.row]
        picked = (values[pick] for values in (rows, angle, rate, acceleration, moment, keep, time))
        return (*picked, angle, rate, every, crept(self.stretch.signals[0], time, bandwidth)[pick])
