"""The samples of a log behind the fewer rows of a motion record: what turns over between two rows (dry
friction at a reversal) is evaluated at every sample and then gathered.

    angle, rate   (S, n) of the motors on the output side, behind the low-pass of the angles
    gathered      (S, ...) -> (N, ...): low-pass of the angles, far above that of the torque, and every k-th
                  sample, so that nothing folds back into the band of the torque
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse

from exactarm.numerics.butterworth import butterworth

ORDER = 4
_MEMORY_PERIODS = 4.0  # of the cutoff: what comes later is below 1e-4


@dataclass(frozen=True)
class LogSamples:
    """runs: slices of the samples, one a run of the record; every: samples a row; cutoff_hz: of `gathered`,
    None where it is too high for the log; known: what has been derived, by what it was asked for by."""

    angle: np.ndarray
    rate: np.ndarray
    runs: tuple[slice, ...]
    every: int
    step: float
    cutoff_hz: float | None
    known: dict = field(default_factory=dict, repr=False, compare=False)

    def gathered(self, values: np.ndarray) -> np.ndarray:
        return values if self.every == 1 else self._gathering @ values

    @cached_property
    def _gathering(self) -> sparse.csr_array:
        """(N, S)"""
        taps = _taps(self.cutoff_hz, self.step)
        half, blocks = len(taps) // 2, []
        for run in self.runs:
            count = run.stop - run.start
            rows = np.arange(0, count, self.every)
            place = rows[:, None] + np.arange(-half, half + 1)
            weight = np.where((place >= 0) & (place < count), taps, 0.0)
            weight /= weight.sum(axis=1, keepdims=True)
            start = np.arange(0, weight.size + 1, len(taps))
            blocks.append(sparse.csr_array((weight.ravel(), np.clip(place, 0, count - 1).ravel(), start),
                                           shape=(rows.size, count)))
        return sparse.block_diag(blocks, format="csr")

    def shown_of_wave(self, turns: np.ndarray, order: float) -> tuple[np.ndarray, np.ndarray] | None:
        """(N,) share of a wave, `order` cycles a turn of a motor that makes `turns` (N,) of them a second,
        that `gathered` leaves in a row, and its slope by the order; None where it leaves all. A wave that
        passes faster than half the sampling rate is in the log at the frequency to which it folds."""
        if self.every == 1 or self.cutoff_hz is None:
            return None
        folds = np.round(order * turns * self.step) / self.step
        seen = (order * turns - folds) / self.cutoff_hz
        left = 1.0 / (1.0 + seen ** (2 * ORDER))
        return left, -2 * ORDER * left**2 * seen ** (2 * ORDER - 1) * turns / self.cutoff_hz

    def spread(self, values: np.ndarray, runs) -> np.ndarray:
        """(S,) of values (N,) at the rows `runs` of the record, linear between them."""
        parts = []
        for rows, run in zip(runs, self.runs):
            count = run.stop - run.start
            parts.append(np.interp(np.arange(count), self.every * np.arange(len(rows)), values[rows]))
        return np.concatenate(parts)


def _taps(cutoff_hz: float | None, step: float) -> np.ndarray:
    """Of the low-pass at every sample, as far as it remembers."""
    if cutoff_hz is None:
        return np.ones(1)
    half = int(np.ceil(_MEMORY_PERIODS / (cutoff_hz * step)))
    taps = low_pass(np.eye(1, 4 * half + 1, 2 * half)[0], cutoff_hz, step)[half : 3 * half + 1]
    return taps / taps.sum()


def low_pass(values: np.ndarray, cutoff_hz: float, step: float) -> np.ndarray:
    """(N, ...) without phase; ends go on as their point reflection, far enough for the filter to die out."""
    flat = values.reshape(len(values), -1)
    bad = np.isnan(flat).any(axis=0)
    good = ~bad & flat.any(axis=0)  # most tangents are zero in most axes
    out = np.where(bad, np.nan, np.zeros_like(flat))
    out[:, good] = butterworth(flat[:, good], ORDER, cutoff_hz, step)
    return out.reshape(values.shape)
