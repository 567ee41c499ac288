"""The smoothest motion that an encoder's counts allow.

An encoder tells the angle to within half a count of step s. Where a motor turns evenly the rounding is no
white noise: it is a sawtooth of the angle with period s, which the clock of the log folds to the frequencies
|k rate / s - m f|, anywhere below half the sampling rate f. There it passes for an error that follows the
motor's angle. A filtered angle x_c (3.2) of cutoff c is as good as the counts wherever

    |counted - x_c| <= s / 2 + 6 s sqrt(g_c / 12),   mean (counted - x_c)^2 <= s^2 / 12 (1 + 4 sqrt(0.8 g))

all over the reach of the filter: the counts cannot refute it. g_c = 1 / (2 sqrt(pi) f sigma_c) is what the
filter leaves of white noise, g that of the mean, taken over the filter of 2 Hz; 0.8 s^4 / 144 is the variance
of the square of a rounding. From the cutoff that the encoder asks for down to 2 Hz each sample takes the
lowest such one. Of a ripple of the motor it takes no more than the bounds let through, about a quarter of a
count.

Signals (R,) of one run, rad and s. Limits: an angle that is not on the encoder's grid (no step is seen, or
stamps were evened out) keeps the one filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm.chain.swinging import widened
from exactarm.numerics.signals import gaussian_filter, gaussian_sigma, step_of_quantisation
from exactarm.numerics.stamps import typical_step
from exactarm.numerics.white_noise import white_noise

_LOWEST_HZ = 2.0  # a tone below it changes the rate by a hundredth of what one count in a sample does
_CERTAIN, _MORE = 6.0, 4.0  # standard deviations: of one sample of many, of a mean of many
# in a period of the bandwidth: a rate from two roundings of s / sqrt(12) that far apart is off by
# sqrt(1 / 6) / k of itself, a tenth for four counts
_FEW_COUNTS = 4.0
_REACH = 3.0  # standard deviations of a filter, beyond which its kernel holds 0.3 %


def smoothest(counted: np.ndarray, time: np.ndarray, cutoff_hz: float) -> np.ndarray:
    """(R, m) the motor angles behind the counts (R, m), filtered at `cutoff_hz` and lower where that is
    allowed."""
    angle = gaussian_filter(counted, time, cutoff_hz)
    # What it rounds off the motion is put back, rounded itself: an error of the fourth order in its width.
    angle += gaussian_filter(counted - angle, time, cutoff_hz)
    for column in range(angle.shape[1]):
        step = step_of_quantisation(counted[:, column])
        if step > 0.0:
            angle[:, column] = _lowered(counted[:, column], angle[:, column], time, cutoff_hz, step)
    return angle


def between_counts(counted: np.ndarray, time: np.ndarray, cutoff_hz: float) -> np.ndarray:
    """(R, m) the same of columns that are rounded, and the others as they are."""
    rounded = [column for column, values in enumerate(counted.T) if step_of_quantisation(values) > 0.0]
    if not rounded:
        return counted
    angle = counted.copy()
    angle[:, rounded] = smoothest(counted[:, rounded], time, cutoff_hz)
    return angle


def crept(counted: np.ndarray, time: np.ndarray, bandwidth_hz: float) -> np.ndarray:
    """(R, m) samples of angles around which, within a period of the bandwidth, some counts pass but no more
    than four: the rate that follows tells little of when the axis turned."""
    half = int(np.ceil(0.5 / (bandwidth_hz * typical_step(time))))
    out = np.zeros(counted.shape, bool)
    for column, values in enumerate(counted.T):
        if (step := step_of_quantisation(values)) > 0.0:
            passed = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(values)) / step)])
            place = np.arange(len(values))
            count = passed[np.minimum(place + half, len(values) - 1)] - passed[np.maximum(place - half, 0)]
            out[:, column] = (count > 0.5) & (count < _FEW_COUNTS + 0.5)
    return out


def folded_rounding(counted: np.ndarray, runs: Sequence[np.ndarray]) -> float:
    """RMS of what the rounding of an angle (N,) may leave as a sawtooth of the angle: s / sqrt(12), or 0
    where noise sigma before the rounding blurs it.

    Of the first wave, s / pi, noise leaves exp(-2 (pi sigma / s)^2). The fourth differences that show the
    white noise raise a wave by 16 / sqrt(70) at most: where they show more than that of s / sqrt(12), sigma
    is above 0.47 s, and 1 % of the wave is left.
    """
    steps = [step_of_quantisation(counted[rows]) for rows in runs]
    step = max(steps, default=0.0)
    white = [white_noise(counted[rows]) ** 2 for rows, seen in zip(runs, steps) if seen > 0.0]
    if not white or np.mean(white) > 256.0 / 70.0 * step**2 / 12.0:
        return 0.0
    return step / np.sqrt(12.0)


def _lowered(counted: np.ndarray, angle: np.ndarray, time: np.ndarray, cutoff_hz: float,
             step: float) -> np.ndarray:
    finer, kept = cutoff_hz, _kept(time, _LOWEST_HZ)
    most = step**2 / 12.0 * (1.0 + _MORE * np.sqrt(0.8 * kept))
    while finer > _LOWEST_HZ:
        lower = max(0.5 * finer, _LOWEST_HZ)
        smooth = gaussian_filter(counted, time, lower)
        beside = counted - smooth
        refuted = np.abs(beside) > step * (0.5 + _CERTAIN * np.sqrt(_kept(time, lower) / 12.0))
        refuted |= gaussian_filter(beside**2, time, _LOWEST_HZ) > most
        if refuted.all():
            break
        # Blended over the width of the finer filter, outside of all that the refuted samples reach.
        allowed = ~widened(refuted, time, _REACH * (gaussian_sigma(lower) + gaussian_sigma(finer)))
        share = np.clip(gaussian_filter(allowed.astype(float), time, finer), 0.0, 1.0)
        angle = angle + share * (smooth - angle)
        finer = lower
    return angle


def _kept(time: np.ndarray, cutoff_hz: float) -> float:
    """Share of the variance of white noise behind the filter."""
    return min(typical_step(time) / (2.0 * np.sqrt(np.pi) * gaussian_sigma(cutoff_hz)), 1.0)
