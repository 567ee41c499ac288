"""White noise of a sampled signal: how large it is, and whether what lies near the signal's own band is
larger."""

from __future__ import annotations

from math import comb

import numpy as np

from exactarm.numerics.factors import pinv

# A stretch is so many periods of the band long; the quietest quarter of the stretches says what the noise is:
# friction that turns over, and ripple at full speed, are loud in the others.
_PERIODS, _QUIET = 5.0, 0.25
# in bandwidths: where noise that grows towards the band shows, and where only what is white is left; at most
# this share of the sampling rate
_NEAR, _FAR, _NYQUIST = (1.25, 2.5), 4.0, 0.45
_ORDERS = (4, 6, 8)
_LEAST_FREQUENCIES, _LEAST_STRETCHES = 5, 16


def white_noise(values: np.ndarray) -> float:
    """Standard deviation of the white part of a smooth signal (N,), from its fourth differences (robust)."""
    if values.size < 6:
        return 0.0
    fourth = np.diff(values, 4)
    return float(1.4826 * np.median(np.abs(fourth)) / np.sqrt(70.0))


def white_noise_of_smooth(values: np.ndarray) -> float:
    """The same of a signal that may be smooth without being slow beside its samples: differences of several
    orders agree on a noise, and fall where it is the motion itself."""
    found = []
    for order in _ORDERS:
        if values.size <= order + 1:
            return 0.0
        differences = np.abs(np.diff(values, order))
        found.append(1.4826 * float(np.median(differences)) / np.sqrt(comb(2 * order, order)))
    return min(found)


def rise_towards_band(runs: list[np.ndarray], step: float, bandwidth_hz: float) -> np.ndarray | None:
    """(m,): power density of the noise just above `bandwidth_hz`, over that far above it, of runs (N_i, m)
    sampled every `step` s; 1 for white noise.

    None where the sampling is too slow, or the runs too short, to tell.
    """
    length = int(round(_PERIODS / bandwidth_hz / step))
    frequency = np.fft.rfftfreq(max(length, 1), step)
    near = (frequency > _NEAR[0] * bandwidth_hz) & (frequency < _NEAR[1] * bandwidth_hz)
    far = (frequency > _FAR * bandwidth_hz) & (frequency < _NYQUIST / step)
    if min(near.sum(), far.sum()) < _LEAST_FREQUENCIES:
        return None
    window = np.hanning(length + 1)[:-1]
    line = np.stack([np.ones(length), np.linspace(-1.0, 1.0, length)], axis=1)
    off_the_line = np.eye(length) - line @ pinv(line)
    stretches = [run[start : start + length] for run in runs
                 for start in range(0, len(run) - length + 1, length // 2)]
    if len(stretches) < _LEAST_STRETCHES:
        return None
    spectra = np.fft.rfft(window[:, None] * (off_the_line @ np.stack(stretches)), axis=1)
    quiet = np.quantile(np.abs(spectra) ** 2, _QUIET, axis=0)
    return quiet[near].mean(axis=0) / quiet[far].mean(axis=0)
