"""Do two devices keep the same time? The lag between two signals of one motion, at its beginning and at its
end.

Both signals are sampled on one even clock and laid over each other in the first and in the last third of a
run, with the lag that leaves the least; it is refined by a parabola. A lag that changes is a clock that runs
faster.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.numerics.stamps import typical_step

LEAST_CORRELATION = 0.9  # below, the two signals do not tell when they agree
LEAST_DRIFT_S, LEAST_DRIFT_STEPS = 0.005, 2.0  # smaller ones are rounding of the stamps
MOST_SAMPLES = 4000  # of a third
MOST_SIZES = 20  # each from the overlap at the lag that the size before gave
SMOOTH_SAMPLES = 15  # of the mean before a slope is taken: a bend of any motion is longer
SURE = 6.0  # standard deviations of a drift: slow motions leave little beside the noise of a speed


@dataclass(frozen=True)
class Lags:
    """Of the second signal behind the first in the first and the last third of a run, s; span: between the
    two thirds, s."""

    first: float
    last: float
    span: float
    step: float
    deviation: float = 0.0  # of last - first, s

    @property
    def drifts(self) -> bool:
        least = max(LEAST_DRIFT_S, LEAST_DRIFT_STEPS * self.step, SURE * self.deviation)
        return abs(self.last - self.first) > least


def lags(time: np.ndarray, one: np.ndarray, other: np.ndarray) -> Lags | None:
    """Of `other` (N,) behind `one` (N,) at `time` (N,); None where the signals do not tell."""
    if len(time) < 60:
        return None
    step = typical_step(time)
    if not step > 0.0:
        return None
    third = max(len(time) // 3, 20)
    parts, variance = [], 0.0
    for rows in (slice(0, third), slice(len(time) - third, len(time))):
        even = np.arange(time[rows][0], time[rows][-1], step * max(1.0, third / MOST_SAMPLES))
        found = _lag(np.interp(even, time[rows], one[rows]), np.interp(even, time[rows], other[rows]))
        if found is None:
            return None
        parts.append(found[0] * (even[1] - even[0]))
        variance += (found[1] * (even[1] - even[0])) ** 2
    return Lags(parts[0], parts[1], float(time[-1] - time[0]) * 2.0 / 3.0, step, float(np.sqrt(variance)))


def _lag(one: np.ndarray, other: np.ndarray) -> tuple[float, float] | None:
    """In samples, with its standard deviation: where the mean square difference of the two, of one size, is
    least. Per sample of their overlap, for a plain correlation falls with the overlap, and hides a lag
    between two long plateaus. Of one size where they overlap: at the ends of a ramp one of them has more of
    the plateau, and its size over all samples would hide most of the lag."""
    if min(np.ptp(one), np.ptp(other)) == 0.0:
        return None
    length, most = len(one), len(one) // 3
    count = 1 << int(np.ceil(np.log2(2 * length)))
    product = np.fft.irfft(np.fft.rfft(other, count) * np.conj(np.fft.rfft(one, count)), count)
    late = np.arange(-most, most + 1)
    before = [np.concatenate([[0.0], np.cumsum(values**2)]) for values in (one, other)]
    begin = [np.maximum(-late, 0), np.maximum(late, 0)]
    square = [sums[first + length - np.abs(late)] - sums[first] for sums, first in zip(before, begin)]
    at = most  # no lag, for the first size
    for _ in range(MOST_SIZES):
        size = np.sqrt(square[0][at] / max(square[1][at], 1e-300))
        left = (square[0] + size**2 * square[1] - 2.0 * size * product[late]) / (length - np.abs(late))
        earlier, at = at, int(np.argmin(left))
        if at == earlier:
            break
    if not 0 < at < len(late) - 1:
        return None
    lag, both = int(late[at]), length - abs(int(late[at]))
    pair = one[max(-lag, 0) :][:both], size * other[max(lag, 0) :][:both]
    if min(map(np.ptp, pair)) == 0.0 or np.corrcoef(*pair)[0, 1] < LEAST_CORRELATION:
        return None
    bend = left[at - 1] - 2.0 * left[at] + left[at + 1]
    return float(lag + (0.5 * (left[at - 1] - left[at + 1]) / bend if bend > 0.0 else 0.0)), _deviation(*pair)


def _deviation(one: np.ndarray, other: np.ndarray) -> float:
    """Of the lag, in samples: what the two differ by over the slope of one, whose noise a mean takes out."""
    width = min(SMOOTH_SAMPLES, len(one))
    slope = np.diff(np.convolve(one, np.full(width, 1.0 / width), mode="valid"))
    return float(np.std(other - one) / max(float(np.linalg.norm(slope)), 1e-300))
