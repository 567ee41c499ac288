"""Signals in time and over angle: acausal Gaussian filter, derivatives, spectra over a non-uniform angle.

The filter is that of thesis (3.1), (3.2): impulse response exp(-t^2 / 2 s^2) / (s sqrt(2 pi)) with
s = sqrt(ln 2) / (2 pi f_c), -3 dB at f_c, no phase. Derivatives are central differences of eighth order, one
linear operator (a sparse matrix) for values and tangents alike; toward the ends of a block its order falls to
two. A block is a stretch of one run without a gap in its time stamps.
"""

from __future__ import annotations

import numpy as np
import scipy  # scipy.interpolate and scipy.ndimage are imported at their first use
from scipy import fft, sparse

from exactarm import _core
from exactarm.numerics.stamps import GAP, blocks, clocks, counted_again, nearest_ticks, typical_step

# Central differences on a unit grid, coefficients of x[k + 1] - x[k - 1], x[k + 2] - x[k - 2], ... (Fornberg
# 1988).
_STENCILS = {
    1: (1 / 2,),
    2: (2 / 3, -1 / 12),
    3: (3 / 4, -3 / 20, 1 / 60),
    4: (4 / 5, -1 / 5, 4 / 105, -1 / 280),
}
HALF_STENCIL = 4
_CERTAIN = 5.0  # standard deviations
MOTION_HZ = 15.0  # that arms are moved with
_EVEN, _CLOCK_CUTOFF_HZ = 1e-6, 1.0  # share of a step; slower changes of the sampling rate are believed
_END_WIDTHS = 4.0  # deviations of the filter: the line at the ends of a noisy block
_WIDE = 60  # samples of a kernel's reach from which a Fourier transform is quicker


def even_clock(time: np.ndarray) -> np.ndarray:
    """Time stamps (N,) of one run without what scatters in them: their rounding, or a logger's jitter.

    A step that is off by a thousandth puts a thousandth of the speed into a rate, which is more than a
    gyroscope's noise.
    """
    if time.size < 3:
        return time
    steps = np.diff(time)
    uneven = np.abs(steps / typical_step(time) - 1.0) > _EVEN
    if not np.any(uneven & (steps < GAP * typical_step(time))):
        return time
    out = time.copy()
    width = gaussian_sigma(_CLOCK_CUTOFF_HZ) / typical_step(time)
    for rows, count in clocks(time):
        own = time[rows]
        for better in (counted_again, counted_again, counted_again, nearest_ticks):
            clock = _smooth_clock(own, count, width)
            count = better(count, (own - clock) * count[-1] / max(own[-1] - own[0], np.finfo(float).tiny))
        out[rows] = _smooth_clock(own, count, width)
    return out


def _smooth_clock(time: np.ndarray, count: np.ndarray, width: float) -> np.ndarray:
    """(R,) smooth course of stamps over the ticks that they belong to, at these; width: samples."""
    # Beside a straight line: a jittered end is no point to reflect the stretch in.
    line = np.polynomial.Polynomial.fit(count, time, 1)(count) if time.size > 2 else time
    every = np.interp(np.arange(count[-1] + 1), count, time - line)
    pad = min(int(np.ceil(6.0 * width)), every.size)
    beside = np.pad(every, pad, mode="symmetric")
    return line + _smoothed(beside, width, pad, True)[pad : pad + every.size][count]


def stamps_are_true(values: np.ndarray, rate: np.ndarray, time: np.ndarray, clock: np.ndarray) -> bool:
    """Whether samples (N,) with derivative `rate` were taken at their uneven stamps, and not evenly and
    stamped unevenly: then they scatter about their smooth course on the even `clock` as the rate times what
    scatters in the stamps."""
    if values.size < 16:
        return False
    stamped, scattered = np.diff((time - clock) * rate, 4), np.diff(values - rate.mean() * clock, 4)
    power = float(stamped @ stamped)
    if power == 0.0:
        return False
    share = float(stamped @ scattered) / power
    left = scattered - share * stamped
    return share > 0.5 and share > _CERTAIN * np.sqrt(float(left @ left) / power / values.size)


def at_even_times(values: np.ndarray, stamps: np.ndarray, time: np.ndarray, main: int) -> np.ndarray:
    """Signals (R, n) of one run at the even `time`, where those of the column `main`, which moves most, show
    that they were read at their stamps.

    By a spline through the stamps: speed times lateness errs by the jitter that is in the speed itself, 2 %
    of it at 100 Hz and a tenth of a step, ten times a gyroscope's noise in a rate.
    """
    rate = derivative(gaussian_filter(values[:, main], time, MOTION_HZ), time)
    if not stamps_are_true(values[:, main], rate, stamps, time):
        return values
    read_at, first = np.unique(stamps, return_index=True)
    return by_spline(read_at, values[first], time)


def by_spline(time: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(G, ...) of values (R, ...) that are known at `time`, at the `wanted` times; a column with no value
    somewhere has none anywhere."""
    flat = values.reshape(len(values), -1)
    known = np.isfinite(flat).all(axis=0)
    out = np.full((wanted.size, flat.shape[1]), np.nan)
    out[:, known] = scipy.interpolate.CubicSpline(time, flat[:, known])(wanted)
    return out.reshape(wanted.size, *values.shape[1:])


def gaussian_sigma(cutoff_hz: float) -> float:
    """Standard deviation in s of the filter that is -3 dB at `cutoff_hz` (3.2)."""
    return np.sqrt(np.log(2.0)) / (2.0 * np.pi * cutoff_hz)


def gaussian_filter(values: np.ndarray, time: np.ndarray, cutoff_hz: float,
                    noisy: bool = False) -> np.ndarray:
    """`values` (N, ...) of one run, filtered block by block without phase; straight lines pass unchanged.

    Past its ends a block goes on as its own point reflection, which keeps the end sample as it is. Where
    noise is most of the signal (`noisy`) it goes on as a straight line through its first samples, and what
    lies beside it mirrored.
    """
    out = np.array(values, float)
    width = gaussian_sigma(cutoff_hz) / typical_step(time) if time.size > 1 else 0.0
    if width < 0.05:  # the kernel is one sample wide
        return out
    reach = int(np.ceil(6.0 * width))
    for rows in blocks(time):
        pad = min(reach, rows.size - 1)
        if pad < 1:
            continue
        block = out[rows]
        if noisy:
            head, tail = _past_the_front(block, pad, width), _past_the_front(block[::-1], pad, width)[::-1]
        else:
            head = 2.0 * block[0] - block[pad:0:-1]
            tail = 2.0 * block[-1] - block[-2 : -pad - 2 : -1]
        padded = np.concatenate([head, block, tail])
        out[rows] = _smoothed(padded, width, reach, pad < reach)[pad : pad + rows.size]
    return out


def _past_the_front(block: np.ndarray, pad: int, width: float) -> np.ndarray:
    """(pad, ...) samples in front of a noisy block (N, ...)."""
    count = min(block.shape[0], int(np.ceil(_END_WIDTHS * width)) + 2)
    index = np.arange(count) - 0.5 * (count - 1)
    part = block[:count].reshape(count, -1)
    level, slope = part.mean(axis=0), index @ part / (index @ index)
    line = lambda row: level + slope * (row[:, None] + index[0])
    mirrored = np.arange(pad - 1, -1, -1)
    beside = block[:pad].reshape(pad, -1)[mirrored] - line(mirrored)
    return (line(np.arange(-pad, 0)) + beside).reshape(pad, *block.shape[1:])


def _smoothed(padded: np.ndarray, width: float, reach: int, short: bool) -> np.ndarray:
    """`padded` (N, ...) under a Gaussian kernel of `width` samples that ends at `reach`: a wide one by
    Fourier transform, which wraps round at the ends, so not where the padding is `short` of the reach."""
    if short or reach < _WIDE:
        return scipy.ndimage.gaussian_filter1d(padded, width, axis=0, mode="nearest", radius=reach)
    size = fft.next_fast_len(padded.shape[0], real=True)
    kernel = np.zeros(size)
    reached = np.arange(-reach, reach + 1)
    kernel[reached] = np.exp(-0.5 * (reached / width) ** 2)
    transfer = fft.rfft(kernel / kernel.sum()).real
    level = padded[:1]
    spectrum = fft.rfft(padded - level, size, axis=0) * transfer.reshape(-1, *(1,) * (padded.ndim - 1))
    return fft.irfft(spectrum, size, axis=0)[: padded.shape[0]] + level


def derivative(values: np.ndarray, time: np.ndarray, starts: list[int] | None = None) -> np.ndarray:
    """d/dt of samples (N, ...) of one run: what `derivative_operator` does, without the matrix; starts:
    `block_starts`."""
    return _core.derivative(values, time, block_starts(time) if starts is None else starts)


def block_starts(time: np.ndarray) -> list[int]:
    """First row of each block of one run."""
    return [int(rows[0]) for rows in blocks(time)]


def derivative_operator(time: np.ndarray) -> sparse.csr_array:
    """(N, N) operator D of one run: D @ x is dx/dt of samples x (N,) or (N, P)."""
    pieces = [_block_operator(time[rows]) for rows in blocks(time)]
    return sparse.block_diag(pieces, format="csr") if len(pieces) > 1 else pieces[0]


def _block_operator(time: np.ndarray) -> sparse.csr_array:
    count = time.size
    if count == 1:
        return sparse.csr_array((1, 1))
    index = np.arange(count)
    half = np.minimum(np.minimum(index, count - 1 - index), HALF_STENCIL)
    rows, columns, values = [], [], []

    def add(row, column, value):
        rows.append(row), columns.append(column), values.append(np.broadcast_to(value, np.shape(row)))

    for size, stencil in _STENCILS.items():
        at = index[half == size]
        for reach, weight in enumerate(stencil, start=1):
            add(at, at + reach, weight)
            add(at, at - reach, -weight)
    ends = ((0, (0, 1, 2)), (count - 1, (count - 1, count - 2, count - 3)))
    for row, where in ends:
        sign = 1.0 if row == 0 else -1.0
        weights = (-1.5, 2.0, -0.5) if count > 2 else (-1.0, 1.0)
        for column, weight in zip(where, weights):
            add(np.array([row]), np.array([column]), sign * weight)
    by_index = sparse.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, count)
    )
    return sparse.diags_array(1.0 / (by_index @ time)) @ by_index


def step_of_quantisation(values: np.ndarray) -> float:
    """The grid on which all samples (N,) lie, or 0 where the signal has none that can be seen."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * max(np.ptp(values), 1e-300)]
    if steps.size < 8:
        return 0.0
    grid = float(steps.min())
    # An exact angle at an even pace or acceleration lies on a grid too, that of its own steps, but does not
    # scatter.
    if np.count_nonzero(np.abs(np.diff(values, 4)) > 0.1 * grid) < 0.2 * steps.size:
        return 0.0
    # From small steps to large ones, each time with the grid that the smaller ones agree on: the first one's
    # rounding would add up.
    for most in (1e2, 1e3, 1e4, np.inf):
        near = steps[steps < most * grid]
        counts = np.round(near / grid)
        if near.size < 8 or np.any(np.abs(near / grid - counts) > 0.05):
            return 0.0
        grid = float(near @ counts / (counts @ counts))
    return grid


def steady_direction(rate: np.ndarray, time: np.ndarray,
                     share: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Direction of motion (N,) of one run from its rate, and the mask (N,) of its reversals.

    Samples slower than `share` of the fastest take the direction of the nearest faster sample, so that a
    standstill belongs to the motion beside it; between opposite directions they are the reversal, which no
    table defines.
    """
    fastest = np.max(np.abs(rate), initial=0.0)
    sign = np.where(np.abs(rate) > share * fastest, np.sign(rate), 0.0)
    known = np.flatnonzero(sign)
    reversal = np.zeros(rate.size, bool)
    if known.size == 0:
        return sign, reversal
    index = np.arange(rate.size)
    place = np.clip(np.searchsorted(known, index), 0, known.size - 1)
    before, after = known[np.maximum(place - 1, 0)], known[place]
    before = np.where(index >= known[-1], known[-1], before)
    after = np.where(index <= known[0], known[0], after)
    nearer = np.where(np.abs(index - before) <= np.abs(after - index), before, after)
    direction = np.where(sign != 0.0, sign, sign[nearer])
    reversal = (sign == 0.0) & (sign[before] * sign[after] < 0.0) & (before < index) & (index < after)
    # Two neighbours of opposite direction without a slow sample between them.
    flips = np.flatnonzero(direction[:-1] * direction[1:] < 0.0)
    for shift in range(-HALF_STENCIL + 1, HALF_STENCIL + 1):
        reversal[np.clip(flips + shift, 0, rate.size - 1)] = True
    return direction, reversal


def on_uniform_angle(angle: np.ndarray, values: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """The signal (N,) averaged into `samples` equal cells of its angle: centres (M,), means (M,); empty ones
    filled in."""
    low, high = float(angle.min()), float(angle.max())
    edges = np.linspace(low, high, samples + 1)
    cell = np.clip(((angle - low) / (high - low) * samples).astype(int), 0, samples - 1)
    count = np.bincount(cell, minlength=samples)
    mean = np.bincount(cell, weights=values, minlength=samples) / np.maximum(count, 1)
    centre = 0.5 * (edges[:-1] + edges[1:])
    full = count > 0
    return centre, np.interp(centre, centre[full], mean[full])


def zoom(values: np.ndarray, step: float, low: float, high: float,
         count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chirp-z zoom (Rabiner 1969) of a signal on a uniform angle (rad): orders (count,), complex amplitudes.

    By Bluestein's convolution here: scipy.signal takes half a second to import.
    """
    orders = np.linspace(low, high, count)
    # revolutions from one order to the next, a sample
    turn = (high - low) / max(count - 1, 1) * step / (2.0 * np.pi)
    samples = values.size
    index = np.arange(max(samples, count), dtype=float)
    chirp = np.exp(-2j * np.pi * np.fmod(0.5 * turn * index**2, 1.0))
    size = fft.next_fast_len(samples + count - 1)
    kernel = np.zeros(size, complex)
    kernel[:count] = chirp[:count].conj()
    kernel[size - samples + 1 :] = chirp[samples - 1 : 0 : -1].conj()
    turned = values * np.exp(-1j * low * step * index[:samples]) * chirp[:samples]
    spectrum = fft.ifft(fft.fft(turned, size) * fft.fft(kernel))[:count] * chirp[:count]
    return orders, 2.0 / samples * spectrum


def power_over_orders(pieces: list[tuple[np.ndarray, np.ndarray]], ratio: float,
                      highest: float | None = None):
    """Orders (K,) and the power (K,) of signals (angle, values) over their angle, summed over the pieces.

    Each piece is averaged onto a uniform angle, levelled and windowed (Hann); four points per cell of
    resolution 1 / range. Below two periods in the longest range nothing can be told, so the orders begin
    there.
    """
    pieces = [(x, v) for x, v in pieces if x.size >= 32 and np.ptp(x) > 0.0]
    if not pieces:
        return np.zeros(0), np.zeros(0)
    longest = max(np.ptp(x) for x, _ in pieces) / (2.0 * np.pi)
    nyquist = min(np.pi * x.size / np.ptp(x) for x, _ in pieces)
    top = min(0.8 * nyquist, highest or 5.0 * max(ratio, 20.0))
    low = 2.0 / longest
    if top <= low:
        return np.zeros(0), np.zeros(0)
    count = max(8, int(4.0 * longest * (top - low)))
    power, orders = np.zeros(count), np.zeros(count)
    for angle, values in pieces:
        span = np.ptp(angle)
        samples = int(min(angle.size // 2, max(64, 1.3 * top * span / np.pi)))
        centre, mean = on_uniform_angle(angle, values, samples)
        level = np.polynomial.Polynomial.fit(centre, mean, 1)
        orders, amplitude = zoom((mean - level(centre)) * np.hanning(samples), centre[1] - centre[0], low,
                                 top, count)
        power += np.abs(amplitude) ** 2 * samples
    return orders, power


def strongest_orders(pieces, ratio: float, most: int = 8, over_floor: float = 8.0) -> np.ndarray:
    """The orders of the highest peaks of `power_over_orders` that stand out of its floor (median), strongest
    first."""
    orders, power = power_over_orders(pieces, ratio)
    if orders.size < 8:
        return np.zeros(0)
    peaks = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
    peaks = peaks[power[peaks] > over_floor * np.median(power)]
    return orders[peaks[np.argsort(-power[peaks])]][:most]
