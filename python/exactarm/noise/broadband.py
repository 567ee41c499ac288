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

from collections.abc import Iterable, Sequence

import numpy as np

LEAST_ROWS = 64  # of a piece
_LEAST_CELL = 9
_HALF_OCTAVE = 2.0**0.5
# of an oscillation: its level beside the median one, its share of the square sum (it raises the RMS by a
# tenth), and standard deviations: one data set in 30,000
_LOUD, _LEAST_LOUD, _SURE = 2.0, 0.17, 4.0
# RMS beside the noise without lines: 1.00 to 1.03 on clean blind runs (bench/blind, seeds 65000 to 65063,
# which judge nothing), 1.15 to 2.0 where something shakes them; and four standard deviations, 0.74 / sqrt(N)
# each: a level by the median of n = N / 2 exponential values scatters by 1.44 / sqrt(n), their mean, which is
# part of it, by 1 / sqrt(n)
_LINES, _SCATTER = 1.1, 3.0
# of a line of its own: its share of a residual's square sum, two values either side (Hann's main lobe), and
# of that of the prediction. A machine nearby had 0.97 and 0.001, a cable bundle that follows the arm 0.51
# and 0.007 (bench/blind, motions 98505 and 98518)
_LINE_WIDTH, _MOST, _NEXT_TO_NOTHING = 2, 0.75, 0.005


def broadband_noise(pieces: Sequence[np.ndarray]) -> float | None:
    """Standard deviation, None where the pieces of LEAST_ROWS hold less than half of all rows."""
    long = [piece for piece in pieces if piece.size >= LEAST_ROWS]
    rows = sum(piece.size for piece in long)
    if not long or 2 * rows < sum(piece.size for piece in pieces):
        return None
    return float(np.sqrt(sum(piece.size * _variance(piece) for piece in long) / rows))


def columns_in_pieces(values: np.ndarray, runs: Iterable[np.ndarray]) -> list[list[np.ndarray]]:
    """Each column of values (N, m), NaN where nothing is defined, in pieces of one run (row indices, in the
    order of time) without gaps."""
    runs = list(runs)
    return [[column[piece] for rows in runs for piece in _without_gaps(rows, np.isfinite(column[rows]))]
            for column in values.T]


def _without_gaps(rows: np.ndarray, kept: np.ndarray) -> list[np.ndarray]:
    """The rows that are kept, in pieces between those that are not."""
    ends = np.flatnonzero(np.diff(kept)) + 1
    return [piece for piece, keep in zip(np.split(rows, ends), kept[np.r_[0, ends]]) if keep]


def line_above(columns: Sequence[Sequence[np.ndarray]], noise: float, step: float) -> float | None:
    """Frequency in Hz of the highest line of several components, each in pieces whose samples are `step` s
    apart; None where no lines stand out of the noise."""
    rms = np.sqrt(np.mean(np.concatenate([piece for pieces in columns for piece in pieces]) ** 2))
    rows = sum(piece.size for piece in columns[0])
    if noise * (_LINES + _SCATTER / np.sqrt(rows)) > rms:
        return None
    worst = max(columns, key=lambda pieces: sum(float(np.sum(piece**2)) for piece in pieces))
    return strongest_line(worst, step)


def strongest_line(pieces: Sequence[np.ndarray], step: float) -> float:
    """Frequency in Hz of what stands highest above its neighbours in the spectrum of the longest piece, whose
    samples are `step` s apart."""
    piece = max(pieces, key=len)
    power = _periodogram(piece)
    level = np.concatenate([np.full(cell.size, _level(cell)) for cell in _cells(power)])
    return float((np.argmax(power - level) + 1) / (piece.size * step))


def line_of_its_own(pieces: Sequence[np.ndarray], beside: Sequence[np.ndarray],
                    step: float) -> float | None:
    """Frequency in Hz of a line that makes most of a residual, in pieces whose samples are `step` s apart,
    and next to nothing of what was predicted for the same samples; None where there is no such line."""
    longest = int(np.argmax([piece.size for piece in pieces])) if pieces else 0
    if not pieces or pieces[longest].size < LEAST_ROWS:
        return None
    power, other = (_periodogram(each[longest]) for each in (pieces, beside))
    level = np.concatenate([np.full(cell.size, _level(cell)) for cell in _cells(power)])
    peak = int(np.argmax(power - level))
    near = slice(max(0, peak - _LINE_WIDTH), peak + _LINE_WIDTH + 1)
    share, predicted = (float(np.sum(each[near]) / max(np.sum(each), np.finfo(float).tiny))
                        for each in (power, other))
    if share < _MOST or predicted > _NEXT_TO_NOTHING:
        return None
    return float((peak + 1) / (pieces[longest].size * step))


def level_around(pieces: Sequence[np.ndarray], step: float, frequency: float) -> float:
    """Variance that white noise would have at the level of the pieces around a frequency in Hz, the median of
    the long ones."""
    levels = []
    for piece in (piece for piece in pieces if piece.size >= LEAST_ROWS):
        cells = _cells(_periodogram(piece))
        ends = np.cumsum([cell.size for cell in cells])
        at = np.searchsorted(ends, frequency * piece.size * step - 0.5)
        levels.append(ends[-1] * _level(cells[min(at, len(cells) - 1)]))
    return float(np.median(levels)) if levels else 0.0


def oscillation(pieces: Sequence[np.ndarray]) -> bool:
    """Whether what is loud in the spectrum is an oscillation of steady size, however its frequency wanders.

    Noise of any colour is normal in a band that many samples mix in: the kurtosis of as many values as it
    has independent ones is near 3: n = 4 (sum P)^2 / sum P^2, two numbers a line, and the mean square of an
    exponential value is twice that of its mean. A sine's is 1.5, that of two of them 2.25.
    """
    loud, powers, square = [], [], 0.0
    for piece in (piece for piece in pieces if piece.size >= LEAST_ROWS):
        cells = _cells(_periodogram(piece))
        level = np.concatenate([np.full(cell.size, _level(cell)) for cell in cells])
        chosen = level > _LOUD * np.median(level)
        lines = np.fft.rfft(piece - piece.mean())
        lines[1 : level.size + 1][~chosen] = 0.0
        lines[level.size + 1 :] = 0.0
        loud.append(np.fft.irfft(lines, piece.size))
        powers.append(np.abs(lines) ** 2 / piece.size)
        square += float(np.sum((piece - piece.mean()) ** 2))
    if not loud:
        return False
    values, power = np.concatenate(loud), np.concatenate(powers)
    if values @ values < _LEAST_LOUD * max(square, np.finfo(float).tiny):
        return False
    kurtosis = float(np.mean(values**4) / np.mean(values**2) ** 2)
    return _deviate(kurtosis, 4.0 * float(np.sum(power) ** 2 / np.sum(power**2))) < -_SURE


def _deviate(kurtosis: float, n: float) -> float:
    """Normal deviate of the kurtosis of n normal values (Anscombe and Glynn 1983)."""
    if n < _LEAST_CELL:
        return 0.0
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (kurtosis - 3.0 * (n - 1.0) / (n + 1.0)) / np.sqrt(variance)
    skew = (6.0 * (n**2 - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
            * np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0))))
    a = 6.0 + 8.0 / skew * (2.0 / skew + np.sqrt(1.0 + 4.0 / skew**2))
    below = 1.0 + x * np.sqrt(2.0 / (a - 4.0))
    if below <= 0.0:
        return -np.inf
    root = np.cbrt((1.0 - 2.0 / a) / below)
    return float((1.0 - 2.0 / (9.0 * a) - root) / np.sqrt(2.0 / (9.0 * a)))


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
