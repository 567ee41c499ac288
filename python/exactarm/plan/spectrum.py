"""What a motor motion asks of the drives: spectrum, bandwidth and ringing of its acceleration (N, n), sampled
at equal steps.

    amplitude   single-sided, of the acceleration; it starts and ends at zero, so no window is needed
    bandwidth   highest frequency at which the amplitude of an axis is above `PEAK_SHARE` of the largest peak
                of all axes
    ringing     what alternates from knot to knot: RMS of the fourth difference over 16, which has gain
                sin^4(pi f step): 1 at the Nyquist frequency and 1 % at a tenth of the sample rate
"""

from __future__ import annotations

import numpy as np

PEAK_SHARE = 1e-3  # -60 dB


def amplitude(acceleration: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (M,) in Hz without zero, and the amplitude (M, n) at each."""
    frequency = np.fft.rfftfreq(len(acceleration), step)
    return frequency[1:], np.abs(np.fft.rfft(acceleration, axis=0))[1:] * 2.0 / len(acceleration)


def peak_bandwidth(acceleration: np.ndarray, step: float) -> tuple[float | None, ...]:
    """Hz per axis; None for an axis whose amplitude never comes so high: it hardly moves."""
    frequency, height = amplitude(acceleration, step)
    above = (np.flatnonzero(column > PEAK_SHARE * height.max()) for column in height.T)
    return tuple(float(frequency[rows[-1]]) if rows.size else None for rows in above)


def ringing(acceleration: np.ndarray) -> np.ndarray:
    """(n,) RMS of what alternates from knot to knot, in the unit of the acceleration."""
    return np.sqrt(np.mean((np.diff(acceleration, n=4, axis=0) / 16.0) ** 2, axis=0))
