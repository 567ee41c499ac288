"""A low-pass without phase: Butterworth's, forwards and backwards.

Of order n and cutoff f_c, sampled with step h (bilinear transform), it takes a wave of frequency f by

    1 / (1 + (tan(pi f h) / tan(pi f_c h))^2n)

which is applied to the spectrum: scipy.signal, which filters in time, takes half a second to import.
"""

from functools import lru_cache

import numpy as np
from scipy import fft

# At 7e-4, three periods of order 4, a kink past the end still bends accelerations within it:
# test_springs_answer_as_the_arm_swings (tests/python/test_tracked_motion.py) fails.
_FADED = 1e-9
_COLUMNS = 64  # filtered at once: their spectra take some ten times their memory


def butterworth(values: np.ndarray, order: int, cutoff_hz: float, step: float) -> np.ndarray:
    """(N, P) behind the low-pass. Past its ends a column goes on as its point reflection, until the slowest
    pole, which falls by exp(-2 pi sin(pi / 2n)) a period of the cutoff, has faded, or as far as it is long
    enough."""
    count = len(values)
    periods = np.log(1.0 / _FADED) / (2.0 * np.pi * np.sin(np.pi / (2 * order)))
    pad = min(count - 1, int(np.ceil(periods / (cutoff_hz * step))))
    after = min(count - 1, fft.next_fast_len(count + 2 * pad, real=True) - count - pad)
    whole = count + pad + after
    taken = _taken(whole, order, cutoff_hz * step)[:, None]
    share = np.linspace(0.0, 1.0, whole)[:, None]
    out = np.empty_like(values, dtype=float)
    for first in range(0, values.shape[1], _COLUMNS):
        part = values[:, first : first + _COLUMNS]
        longer = np.concatenate([2.0 * part[0] - part[pad:0:-1], part,
                                 2.0 * part[-1] - part[-2 : -after - 2 : -1]])
        # what is left of a line from end to end goes on periodically; the line itself passes as it is
        line = longer[0] + share * (longer[-1] - longer[0])
        smooth = fft.irfft(fft.rfft(longer - line, axis=0) * taken, whole, axis=0)
        out[:, first : first + _COLUMNS] = (smooth + line)[pad : pad + count]
    return out


def white_noise_behind(order: int, cutoff_hz: float, step: float, every: int, lags: int) -> np.ndarray:
    """(lags + 1,) autocorrelation of every k-th sample of white noise, `step` apart, behind the low-pass."""
    count = fft.next_fast_len(max(4096, 4 * lags * every), real=True)
    found = fft.irfft(_taken(count, order, cutoff_hz * step) ** 2, count)[: lags * every + 1 : every]
    return found / found[0]


@lru_cache(maxsize=16)
def _taken(count: int, order: int, cutoff: float) -> np.ndarray:
    """(count // 2 + 1,) what passes of the waves in so many samples; cutoff: in waves a sample."""
    with np.errstate(over="ignore"):
        return 1.0 / (1.0 + (np.tan(np.pi * np.fft.rfftfreq(count)) / np.tan(np.pi * cutoff)) ** (2 * order))
