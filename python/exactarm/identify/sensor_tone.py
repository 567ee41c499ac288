"""Tones that a gyroscope reads at a frequency of its own: hum of the mains, a fan, a loop that whistles.

    reading += 2 Re z(t) exp(2 pi i f t),    z (3,) complex, slow

No gear turns while the arm rests: what stands as a line in the spectrum there is not the robot's. The
spectra of all rests together, each bin beside the median of its neighbours on the louder side (which takes
coloured noise out), follow under noise alone an F law; a line is what noise would show in one data set of
1 / `_FALSE_ALARM`.

A tone's phase wanders (mains drift by some 0.02 Hz), so that it is taken out of a whole run by demodulation:
a low-pass of `_WIDTH_S` at its frequency, which leaves what passes there faster as it is. A gear whose line
stands at the same frequency for seconds would lose it too. Runs without a rest show no tone, and
none is seen below some nine periods in a rest.

A short rest resolves little: a tone near one of the mains is theirs where more of the runs lies at that
frequency than at the one that the rests show.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy  # scipy.ndimage is imported at its first use
from scipy import fft, special

from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import rows_of_runs
from exactarm.numerics.factors import lstsq
from exactarm.numerics.signals import gaussian_filter
from exactarm.numerics.stamps import typical_step

_FALSE_ALARM = 1e-4  # of one data set
_MOST_TONES = 4
_REST_RATE = 1e-4  # of the fastest motor rate of the file: encoders at rest change by less
_REST_S, _SETTLED_S = 0.2, 0.1  # the shortest rest, and how long an arm swings after it stops
DRIFT_PERIODS = 2.0  # in the longest rest or run: what is slower is the sensor's drift
_NEIGHBOURS = 10  # resolved bins on one side that tell the background
PADDED = 4  # times the longest rest or run
_WIDTH_S = 0.3
_MAINS_HZ, _OVERTONES = (50.0, 60.0), (1, 2, 3)  # iron hums at twice the frequency, rectifiers at odd ones
_MAINS_OFF_HZ = 0.2  # by which they wander in normal operation (EN 50160: 1 % in nearly all of the time)
_SMOOTH = 4.0  # the motion, taken off before: slower than the tone's frequency by this factor


@dataclass(frozen=True)
class Tone:
    """frequency, Hz; amplitude (3,), rad/s, of each component; at_rest: as it is while the arm rests."""

    frequency: float
    amplitude: np.ndarray
    at_rest: bool = True

    def __str__(self) -> str:
        size = 1e3 * float(np.linalg.norm(self.amplitude))
        if not self.at_rest:
            return (f"the gyroscope reads hum of the mains at {self.frequency:.4g} Hz ({size:.2g} mrad/s): "
                    "it is not the robot's and was taken out")
        return (f"the gyroscope reads a tone of {self.frequency:.4g} Hz ({size:.2g} mrad/s) also while the "
                "arm rests: it is not the robot's and was taken out; look for hum of the mains, a fan or a "
                "vibrating mount")


def find_tones(data: Dataset) -> tuple[Tone, ...]:
    """Of gear runs under a gyroscope; none where nothing rests."""
    rests = list(_rests(data)) if data.gyro is not None else []
    if not rests or not np.any(data.gyro):
        return ()
    step = float(np.median([typical_step(data.time[rows]) for rows in rests]))
    longest = max(rows.size for rows in rests)
    rests = [rows for rows in rests if 2 * rows.size >= longest]  # shorter ones only blur
    size = fft.next_fast_len(PADDED * longest)
    frequency = fft.rfftfreq(size, step)
    power = sum(np.abs(fft.rfft(_straightened(data.gyro[rows]), size, axis=0)) ** 2 / rows.size
                for rows in rests)
    resolved = size // min(rows.size for rows in rests)  # bins that the shortest rest blurs
    highest = 0.5 / step - resolved / (size * step)
    usable = (frequency > DRIFT_PERIODS / (longest * step)) & (frequency < highest)
    frequency, power = frequency[usable], power[usable]
    width, apart = _NEIGHBOURS * resolved, (_NEIGHBOURS // 2 + 2) * resolved
    if frequency.size < 2 * (apart + width):
        return ()
    beside = scipy.ndimage.median_filter(power, (width, 1), mode="mirror")
    at = np.arange(frequency.size)
    # the higher side: noise that falls with frequency is no line
    background = np.maximum(beside[np.maximum(at - apart, 0)], beside[np.minimum(at + apart, at[-1])])
    freedom, components = 2 * len(rests), power.shape[1]
    # the median of an average of squares lies below its mean, the less the more there are
    mean = special.chdtri(freedom, 0.5) / freedom
    ratio = np.sum(power / np.maximum(background, np.finfo(float).tiny), axis=1) * mean / components
    ratio[:apart] = 0.0  # nothing below to compare with
    # a median of m independent bins is worth 2 / pi of them; a Hann window makes 2 of 3 independent
    known = 2.0 / np.pi * 2.0 / 3.0 * _NEIGHBOURS * freedom * components
    # the F distribution's own inverse takes 1 - p, which rounds
    own = freedom * components
    share = special.betaincinv(0.5 * known, 0.5 * own, _FALSE_ALARM / ratio.size)
    limit = known / own * (1.0 - share) / share
    tones, left = [], ratio.copy()
    while len(tones) < _MOST_TONES and left.max() > limit:
        peak = int(np.argmax(left))
        hertz = _sharper(data, summit(frequency, ratio, peak), 0.5 / (longest * step))
        tones.append(_tone(data, rests, hertz))
        left[max(0, peak - 2 * resolved): peak + 2 * resolved + 1] = 0.0
    return tuple(tones)


def mains_near(frequency: float, width: float, sampling_hz: float) -> float | None:
    """Frequency in Hz of the mains, or of an overtone, that samples show within `width` of a frequency,
    folded back where they are too slow for it."""
    hums = [k * hertz for hertz in _MAINS_HZ for k in _OVERTONES]
    shown = {hertz: abs(hertz - sampling_hz * round(hertz / sampling_hz)) for hertz in hums}
    nearest = min(hums, key=lambda hertz: abs(shown[hertz] - frequency))
    return nearest if abs(shown[nearest] - frequency) < width + _MAINS_OFF_HZ else None


def hum_at(frequency: float, data: Dataset) -> Tone | None:
    """Hum of the mains that stands at a frequency in Hz of gear runs, within what the longest resolves."""
    runs = [rows for rows in rows_of_runs(data) if rows.size > 1]
    longest = max(np.ptp(data.time[rows]) for rows in runs)
    step = typical_step(data.time[runs[0]])
    mains = mains_near(frequency, 0.5 / longest, 1.0 / step)
    if mains is None:
        return None
    shown = abs(mains - round(mains * step) / step)
    squares = sum(np.sum(np.abs(_demodulated(data, rows, shown)) ** 2, axis=0) for rows in runs)
    return Tone(shown, 2.0 * np.sqrt(squares / sum(rows.size for rows in runs)), at_rest=False)


def _sharper(data: Dataset, frequency: float, width: float) -> float:
    """Of a frequency that rests show within `width`, and that of the mains next to it, the one at which more
    of the runs lies."""
    runs = [rows for rows in rows_of_runs(data) if rows.size > 1]
    mains = mains_near(frequency, width, 1.0 / typical_step(data.time[runs[0]]))
    if mains is None or 2.0 * mains * typical_step(data.time[runs[0]]) >= 1.0:
        return frequency
    return max((frequency, mains), key=lambda hertz: sum(
        float(np.sum(np.abs(_demodulated(data, rows, hertz)) ** 2)) for rows in runs))


def _demodulated(data: Dataset, rows: np.ndarray, frequency: float) -> np.ndarray:
    """z (R, 3) of the tone in a run."""
    time = data.time[rows]
    fast = data.gyro[rows] - gaussian_filter(data.gyro[rows], time, frequency / _SMOOTH)
    wave = np.exp(2j * np.pi * frequency * time)[:, None]
    return scipy.ndimage.gaussian_filter1d(fast / wave, _WIDTH_S / typical_step(time), axis=0, mode="nearest",
                                     truncate=6.0)


def without_tones(data: Dataset, tones: tuple[Tone, ...]) -> Dataset:
    if not tones or not len(data):
        return data
    gyro = data.gyro.copy()
    for tone in tones:
        for rows in rows_of_runs(data):
            wave = np.exp(2j * np.pi * tone.frequency * data.time[rows])[:, None]
            gyro[rows] -= 2.0 * np.real(_demodulated(data, rows, tone.frequency) * wave)
        data = replace(data, gyro=gyro.copy())
    return data


def _rests(data: Dataset) -> Iterator[np.ndarray]:
    """Rows of every stretch in which no motor turns, behind its settling."""
    theta = np.nan_to_num(data.joints["theta"])
    fastest = max((np.max(np.abs(np.diff(theta[rows], axis=0)), initial=0.0) / typical_step(data.time[rows])
                   for rows in rows_of_runs(data) if rows.size > 1), default=0.0)
    for rows in rows_of_runs(data):
        step = typical_step(data.time[rows])
        least, settling = int(np.ceil(_REST_S / step)), int(np.ceil(_SETTLED_S / step))
        still = np.append(np.all(np.abs(np.diff(theta[rows], axis=0)) <= _REST_RATE * fastest * step, axis=1),
                          True)
        for stretch in np.split(rows, np.flatnonzero(np.diff(still)) + 1):
            first = 0 if stretch[0] == rows[0] else settling
            if still[np.searchsorted(rows, stretch[0])] and stretch.size - first >= least:
                yield stretch[first:]


def _straightened(values: np.ndarray) -> np.ndarray:
    """(n, m) under a Hann window, without its line, of unit mean square."""
    at = np.linspace(-1.0, 1.0, len(values))[:, None]
    level = values - values.mean(axis=0)
    level = level - at * (np.sum(level * at, axis=0) / np.sum(at**2))
    return level * (np.sqrt(2.0 / 3.0) * 2.0 * np.cos(0.5 * np.pi * at) ** 2)


def summit(frequency: np.ndarray, power: np.ndarray, peak: int) -> float:
    """Frequency of the top of the parabola through the logarithms of a peak and its neighbours."""
    if not 0 < peak < frequency.size - 1:
        return float(frequency[peak])
    low, top, high = np.log(power[peak - 1: peak + 2])
    bend = low - 2.0 * top + high
    step = frequency[1] - frequency[0]
    return float(frequency[peak] + (0.5 * (low - high) / bend if bend < 0.0 else 0.0) * step)


def _tone(data: Dataset, rests: list[np.ndarray], frequency: float) -> Tone:
    squares, count = np.zeros(data.gyro.shape[1]), 0
    for rows in rests:
        waves = np.stack([part(2.0 * np.pi * frequency * data.time[rows]) for part in (np.cos, np.sin)], 1)
        found = lstsq(waves, data.gyro[rows] - data.gyro[rows].mean(axis=0), rcond=None)[0]
        squares, count = squares + rows.size * np.sum(found**2, axis=0), count + rows.size
    return Tone(frequency, np.sqrt(squares / count))
