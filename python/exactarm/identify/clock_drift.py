"""Do two devices keep the same time? The lag between two signals of one motion, at its beginning and at its
end.

Both signals are sampled on one even clock and compared by their normalised cross-correlation in the first and
in the last third of a run; the peak is refined by a parabola. A lag that changes is a clock that runs faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.signals import typical_step

LEAST_CORRELATION = 0.9  # below, the two signals do not tell when they agree
LEAST_DRIFT_S, LEAST_DRIFT_STEPS = 0.005, 2.0  # smaller ones are rounding of the stamps
MOST_SAMPLES = 4000  # of a third


@dataclass(frozen=True)
class Lags:
    """Of the second signal behind the first in the first and the last third of a run, s; span: between the
    two thirds, s."""

    first: float
    last: float
    span: float
    step: float

    @property
    def drifts(self) -> bool:
        return abs(self.last - self.first) > max(LEAST_DRIFT_S, LEAST_DRIFT_STEPS * self.step)


def lags(time: np.ndarray, one: np.ndarray, other: np.ndarray) -> Lags | None:
    """Of `other` (N,) behind `one` (N,) at `time` (N,); None where the signals do not tell."""
    if len(time) < 60:
        return None
    step = typical_step(time)
    third = max(len(time) // 3, 20)
    parts = []
    for rows in (slice(0, third), slice(len(time) - third, len(time))):
        even = np.arange(time[rows][0], time[rows][-1], step * max(1.0, third / MOST_SAMPLES))
        lag = _lag(np.interp(even, time[rows], one[rows]), np.interp(even, time[rows], other[rows]))
        if lag is None:
            return None
        parts.append(lag * (even[1] - even[0]))
    return Lags(parts[0], parts[1], float(time[-1] - time[0]) * 2.0 / 3.0, step)


def _lag(one: np.ndarray, other: np.ndarray) -> float | None:
    """In samples."""
    one, other = one - one.mean(), other - other.mean()
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    if size == 0.0:
        return None
    count = 1 << int(np.ceil(np.log2(2 * len(one))))
    product = np.fft.irfft(np.fft.rfft(other, count) * np.conj(np.fft.rfft(one, count)), count) / size
    correlation = np.concatenate([product[-len(one) // 2 :], product[: len(one) // 2]])
    at = int(np.argmax(correlation))
    if correlation[at] < LEAST_CORRELATION or not 0 < at < len(correlation) - 1:
        return None
    before, peak, after = correlation[at - 1 : at + 2]
    bend = before - 2.0 * peak + after
    return at - len(one) // 2 + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)
