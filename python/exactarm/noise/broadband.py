"""How much of a residual in time is noise, whatever its colour: the smooth part of its power spectrum.

A sensor's noise has a spectrum that changes little within half an octave (white, low-passed inside the
sensor, an autoregression); waves, vibrations and steps in a steady motion are lines on it. Of n periodogram
values of one level the median is that level times sum_{i = (n + 1) / 2}^n 1 / i (n odd), and lines do not
move it:

    noise^2 = sum over cells of n median(P) / sum 1 / i,      cells of half an octave, of 9 values at least

Pieces (R,) of even samples without gaps, Hann's window, mean taken out. What a residual has below the ninth
multiple of 1 / (length of the piece) counts as noise where it is not a line. Source: the median is the usual
robust level of a spectrum's continuum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LEAST_ROWS = 64  # of a piece
_LEAST_CELL = 9
_HALF_OCTAVE = 2.0**0.5


def broadband_noise(pieces: Sequence[np.ndarray]) -> float | None:
    """Standard deviation, None where the pieces of LEAST_ROWS hold less than half of all rows."""
    long = [piece for piece in pieces if piece.size >= LEAST_ROWS]
    rows = sum(piece.size for piece in long)
    if not long or 2 * rows < sum(piece.size for piece in pieces):
        return None
    return float(np.sqrt(sum(piece.size * _variance(piece) for piece in long) / rows))


def strongest_line(pieces: Sequence[np.ndarray], step: float) -> float:
    """Frequency in Hz of what stands highest above its neighbours in the spectrum of the longest piece, whose
    samples are `step` s apart."""
    piece = max(pieces, key=len)
    power = _periodogram(piece)
    level = np.concatenate([np.full(cell.size, _level(cell)) for cell in _cells(power)])
    return float((np.argmax(power - level) + 1) / (piece.size * step))


def _variance(piece: np.ndarray) -> float:
    return float(sum(cell.size * _level(cell) for cell in _cells(_periodogram(piece))))


def _periodogram(piece: np.ndarray) -> np.ndarray:
    """Its sum is the mean square."""
    window = np.hanning(piece.size)
    values = (piece - piece.mean()) * window / np.sqrt(window @ window)
    return 2.0 / piece.size * np.abs(np.fft.rfft(values)[1 : (piece.size + 1) // 2]) ** 2


def _cells(power: np.ndarray) -> list[np.ndarray]:
    cells, start = [], 0
    while start < power.size:
        end = start + max(_LEAST_CELL, int((_HALF_OCTAVE - 1.0) * (start + 1)))
        end = power.size if power.size - end < _LEAST_CELL else end
        cells.append(power[start:end])
        start = end
    return cells


def _level(cell: np.ndarray) -> float:
    odd = cell.size - (cell.size + 1) % 2
    return float(np.median(cell[:odd]) / np.sum(1.0 / np.arange((odd + 1) // 2, odd + 1)))
