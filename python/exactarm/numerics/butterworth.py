"""A low-pass without phase: Butterworth's, forwards and backwards.

Of order n and cutoff f_c, sampled with step h (bilinear transform), it takes a wave of frequency f by

    1 / (1 + (tan(pi f h) / tan(pi f_c h))^2n)

which is applied to the spectrum: scipy.signal, which filters in time, takes half a second to import.
"""

import numpy as np
from scipy import fft

_FADED = 1e-9  # after three periods, 7e-4 of order 4, a kink there moved accelerations by 22 rad/s2
_COLUMNS = 64  # filtered at once: their spectra take some ten times their memory


def butterworth(values: np.ndarray, order: int, cutoff_hz: float, step: float) -> np.ndarray:
    """(N, P) behind the low-pass. Past its ends a column goes on as its point reflection, until the slowest
    pole, which falls by exp(-2 pi sin(pi / 2n)) a period of the cutoff, has faded, or as far as it is long
    enough."""
    count = len(values)
    periods = np.log(1.0 / _FADED) / (2.0 * np.pi * np.sin(np.pi / (2 * order)))
    pad = min(count - 1, int(np.ceil(periods / (cutoff_hz * step))))
    fast = fft.next_fast_len(count + 2 * pad, real=True) - count - pad
    after = min(count - 1, fast)
    ahead = np.fft.rfftfreq(count + pad + after)  # waves a sample
    with np.errstate(over="ignore"):
        taken = 1.0 / (1.0 + (np.tan(np.pi * ahead) / np.tan(np.pi * cutoff_hz * step)) ** (2 * order))
    out = np.empty_like(values, dtype=float)
    for first in range(0, values.shape[1], _COLUMNS):
        part = values[:, first : first + _COLUMNS]
        longer = np.concatenate([2.0 * part[0] - part[pad:0:-1], part,
                                 2.0 * part[-1] - part[-2 : -after - 2 : -1]])
        # what is left of a line from end to end goes on periodically; the line itself passes as it is
        line = np.linspace(longer[0], longer[-1], len(longer))
        smooth = fft.irfft(fft.rfft(longer - line, axis=0) * taken[:, None], len(longer), axis=0) + line
        out[:, first : first + _COLUMNS] = smooth[pad : pad + count]
    return out
