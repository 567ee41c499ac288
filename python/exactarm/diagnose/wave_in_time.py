"""Waves in time as rivals of gear errors: where an axis turns at one speed, a floor that shakes looks like a
wave of its gear.

    reading += sum_j (a_rcj cos + b_rcj sin)(2 pi f t) cos(pi j s),    j = 0 ... terms - 1

a, b ~ N(0, tau^2); r: run, c: component of the reading, s from 0 to 1 over the run. Nothing ties such a wave
to an angle: size and phase are each run's own, steady (one term) or changing (three). Effects of a gear have
two numbers for all runs, and follow the speed. Sets of the effects found, with and without a wave, are
compared in the linear picture of the declared fit:

    log p = n/2 log(S / (S - gain)) - sum over effects (k/2 log n + log points tried)
            - 1/2 log det(I + tau^2 C~'C~) - log frequencies tried

so that what one wave explains as well as several effects of gears counts as the wave, and what agrees between
runs, speeds and directions as the gear. Where effects have unknown functions for rivals, the likeliest one of
an angle or a load (something_else.py) stands among them: an axis that another one disturbs, to and fro, looks
like a wave in time, too. The wave's own gain is taken on the level of the noise around f.

Limits: one wave at a time, slower ones than two periods in a run belong to drift.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import fft, linalg, special

from exactarm.chain import Layout
from exactarm.diagnose.decisions import RIDGE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.joint_fit import candidates_for, count_of
from exactarm.diagnose.problem_in_time import ProblemInTime
from exactarm.diagnose.scan import free_mask, grid, prior_of
from exactarm.diagnose.selected import Selection
from exactarm.diagnose.signal import Structure
from exactarm.diagnose.something_else import columns_of_unknown, rivals_of_effects, weigh_unknown
from exactarm.diagnose.vocabulary import UNKNOWN_MASS, emptied
from exactarm.effects.base import Effect
from exactarm.identify.sensor_tone import DRIFT_PERIODS, PADDED, summit
from exactarm.noise.broadband import level_around
from exactarm.numerics.factors import lstsq
from exactarm.numerics.stamps import typical_step

_PEAKS = 6  # lines of the spectrum that are tried
_TERMS = (1, 3)
_SIZES = (2.0, 6.0, 20.0, 60.0, 200.0)  # tau, standard deviations of one run's noise; all alike likely


@dataclass(frozen=True)
class WaveInTime:
    """A wave that is likelier than some effects, those `instead` of which it stands.

    frequency, Hz; coefficients (R, m, 2 terms) by run and component, cos and sin of each term; beside: the
    layout without those effects; log_odds of the wave against them.
    """

    frequency: float
    coefficients: np.ndarray
    instead: tuple[Effect, ...]
    beside: Layout
    log_odds: float

    @property
    def probability(self) -> float:
        return float(special.expit(self.log_odds))

    @property
    def size(self) -> float:
        """RMS over the runs of its amplitude, all components together, in the unit of the reading."""
        return float(np.sqrt(np.mean(np.sum(self.coefficients**2, axis=(1, 2)))))

    def structure(self, unit: str) -> Structure:
        """In words; unit: of the reading. Two encoders of one gear stand on the same floor."""
        instead = " and ".join(dict.fromkeys(effect.title for effect in self.instead))
        suspect = "a load or a controller that swings" if unit == "rad" else "a floor or a mount that shakes"
        return Structure(f"a wave of {self.frequency:.3g} Hz in time, {1e3 * self.size:.2g} m{unit}, which "
                         f"follows no axis's angle, is likelier than {instead} (probability "
                         f"{self.probability:.2f}) and was taken out: look for {suspect}")

    def values(self, number: int, time: np.ndarray) -> np.ndarray:
        """(K, m) at times (K,) of a whole run."""
        terms = self.coefficients.shape[2] // 2
        return waves(time, self.frequency, terms) @ self.coefficients[number].T

    def of_residual(self, time: np.ndarray, residual: np.ndarray, keep: np.ndarray) -> np.ndarray:
        """(K, m) the same wave in a run that was not fitted, from its residual (K, m), defined where `keep`
        (K,)."""
        columns = waves(time, self.frequency, self.coefficients.shape[2] // 2)
        beside = np.column_stack([columns, np.ones(time.size)])  # the offset of the run
        return columns @ lstsq(beside[keep], residual[keep], rcond=None)[0][:-1]


def waves(time: np.ndarray, frequency: float, terms: int) -> np.ndarray:
    """(K, 2 terms) of one run."""
    turn = 2.0 * np.pi * frequency * (time - time[0])
    share = (time - time[0]) / max(time[-1] - time[0], np.finfo(float).tiny)
    return np.stack([part(turn) * np.cos(np.pi * j * share) for j in range(terms)
                     for part in (np.cos, np.sin)], axis=1)


def wave_instead(problem: ProblemInTime, selection: Selection, first: int) -> WaveInTime | None:
    """The likeliest wave in the place of effects, None where none is likelier than they are. The effects
    found stand from place `first` of the layout on."""
    last, record = selection.fits[-1], problem.record
    runs, time = record.runs, record.time
    step = typical_step(time[runs[0]])
    families = len({effect.label for effect in candidates_for(problem, last)})
    # as the declared model sees it: a linear picture of effects that imitate a wave ends at their size
    bare = replace(selection.fits[0], sigma=last.sigma, noise=last.noise, drift=last.drift)
    effects = [e for e in last.layout.effects[first:] if not e.excludes_rows()]
    if not effects:
        return None
    count = count_of(problem, last)
    causes = [_cause_of(bare, effect, families) for effect in effects] + _unknown(problem, bare, count)
    contest = _Contest(bare, causes, runs, time, count, families)
    without = max(contest.best(None)[0], contest.of_first(len(effects), last.square(bare)))
    found = None
    for frequency in _lines(_pieces(bare, bare.free_residual, runs), step):
        for terms in _TERMS:
            wave = contest.wave(frequency, terms)
            left = _pieces(bare, contest.left(wave), runs)
            wave = replace(wave, level=max(level_around(left, step, frequency), 1.0))
            odds, kept = contest.best(wave)
            if not kept.issuperset(range(len(effects))) and odds > (without if found is None else found[0]):
                found = odds, kept, wave
    if found is None:
        return None
    odds, kept, wave = found
    instead = tuple(effect for number, effect in enumerate(effects) if number not in kept)
    beside = last.layout.only(k for k, effect in enumerate(last.layout.effects) if effect not in instead)
    values = contest.values(wave, kept).reshape(len(runs), -1, bare.residual.shape[1])
    return WaveInTime(wave.frequency, np.swapaxes(values, 1, 2), instead, beside, odds - without)


@dataclass(frozen=True)
class _Wave:
    """Whitened columns (N, m, 2 terms), one of each run and component in the place of all, and what the
    declared parameters absorb of them (b, K); level of the noise around it; Gram matrix with the columns of
    the effects, product with the residual; norm of a typical column."""

    frequency: float
    columns: np.ndarray
    absorbed: np.ndarray
    level: float
    gram: np.ndarray
    onto: np.ndarray
    norm: float


@dataclass(frozen=True)
class _Cause:
    """Whitened columns (R, k) of an effect or an unknown function, standard deviations (k,) of their
    coefficients, inf = no prior, and the log of how many of its sort were tried."""

    columns: np.ndarray
    prior: np.ndarray
    tried: float


def _cause_of(bare: Fitted, effect: Effect, families: int) -> _Cause:
    return _Cause(bare.columns(emptied(effect))[:, free_mask(effect)], prior_of(effect),
                  float(np.log(families * len(grid(effect))) - effect.log_odds))


def _unknown(problem: ProblemInTime, bare: Fitted, count: float) -> list[_Cause]:
    """The likeliest unknown function that follows no clock; none where effects have no such rivals."""
    if not problem.unknown_rivals:
        return []
    rival = rivals_of_effects(problem)
    asked = lambda signal, along: not signal.of_time and rival(signal, along)
    found = weigh_unknown(problem, bare, count, problem.pieces(), asked)
    if not found:
        return []
    best = max(found, key=lambda one: one.weight).unknown
    columns, size = columns_of_unknown(problem, bare, best, count)
    return [_Cause(columns, size, float(np.log(len(found) / UNKNOWN_MASS)))]


class _Contest:
    """Sets of effects, with or without a wave, by their log weight over the model with none of them."""

    def __init__(self, bare: Fitted, causes: list[_Cause], runs, time: np.ndarray, count: float,
                 families: int):
        self._bare, self._runs, self._time = bare, runs, time
        self._count, self._families = count, families
        ends = np.cumsum([0, *(cause.columns.shape[1] for cause in causes)])
        self._slices = [np.arange(a, b) for a, b in zip(ends[:-1], ends[1:])]
        columns = np.concatenate([cause.columns for cause in causes], axis=1)
        self._columns = columns - bare.basis @ (bare.basis.T @ columns)
        rounding = np.sqrt(np.finfo(float).eps) * np.linalg.norm(columns, axis=0)
        self._columns[:, np.linalg.norm(self._columns, axis=0) < rounding] = 0.0
        self._residual = bare.free_residual
        self._square = float(self._residual @ self._residual)
        self._gram = self._columns.T @ self._columns
        self._onto = self._columns.T @ self._residual
        prior = np.concatenate([cause.prior for cause in causes])
        self._penalty = 1.0 / prior**2 + RIDGE * np.diag(self._gram) + np.finfo(float).tiny
        self._prices = [self._price(cause, where) for cause, where in zip(causes, self._slices)]

    def _price(self, cause: _Cause, where: np.ndarray) -> float:
        prior = cause.prior
        if not np.isfinite(prior).any():
            return float(cause.tried + 0.5 * where.size * np.log(self._count))
        size = np.where(np.isfinite(prior), prior, 1.0 / np.sqrt(np.diag(self._gram)[where] / self._count))
        system = np.eye(where.size) + size[:, None] * self._gram[np.ix_(where, where)] * size
        return float(cause.tried + 0.5 * np.linalg.slogdet(system)[1])

    def of_first(self, number: int, square: float) -> float:
        """Log weight of so many causes, whose joint fit leaves a square sum in the same noise."""
        return self._log_ratio(self._square - square) - sum(self._prices[:number])

    def left(self, wave: _Wave) -> np.ndarray:
        """Residual that the likeliest set beside the wave leaves."""
        kept = self.best(wave)[1]
        own = self._indices(kept)
        values = self._with_wave(wave, own, max(_SIZES))[2]
        explained = self._columns[:, own] @ values[: own.size]
        explained -= self._bare.basis @ (wave.absorbed @ values[own.size :])
        rows, components = self._bare.residual.shape
        moved = np.zeros((rows, components))
        for run, each in zip(self._runs, values[own.size :].reshape(len(self._runs), -1, components)):
            moved[run] = np.einsum("kct,tc->kc", wave.columns[run], each)
        explained[: moved.size] += moved.ravel()
        return self._residual - explained

    def wave(self, frequency: float, terms: int) -> _Wave:
        rows, components = self._bare.residual.shape
        response = np.zeros((rows, components, 2 * terms))
        for run in self._runs:
            response[run] = waves(self._time[run], frequency, terms)[:, None]
        # noise of a run and a component says nothing of the others, so that each has the same columns
        columns = self._bare.standard(response).reshape(response.shape)
        parts, wide = self._parts, (len(self._runs), 2 * terms, components)
        beside, own = np.zeros((parts[0][0].shape[1], *wide)), np.zeros((*wide, *wide))
        for number, run in enumerate(self._runs):
            for c in range(components):
                part = columns[run, c]
                beside[:, number, :, c] = parts[number][c].T @ part
                own[number, :, c, number, :, c] = part.T @ part
        beside, own = beside.reshape(len(beside), -1), own.reshape(np.prod(wide), -1)
        count = self._columns.shape[1]
        cross, onto, absorbed = beside[:count], beside[count], beside[count + 1 :]
        lost = RIDGE * np.diag(own)  # of what the declared parameters explain rounding would be left
        own -= absorbed.T @ absorbed - np.diag(lost)
        gram = np.block([[self._gram, cross], [cross.T, own]])
        return _Wave(frequency, columns, absorbed, 1.0, gram, np.concatenate([self._onto, onto]),
                     float(np.sqrt(np.median(np.diag(own)))))

    @cached_property
    def _parts(self) -> list[list[np.ndarray]]:
        """Of each run and component: columns of the effects, residual and basis of the declared
        parameters."""
        numbers, shape = self._bare.data_numbers, self._bare.residual.shape
        split = [each[:numbers].reshape(*shape, -1)
                 for each in (self._columns, self._residual[:, None], self._bare.basis)]
        return [[np.concatenate([each[run, c] for each in split], axis=1) for c in range(shape[1])]
                for run in self._runs]

    def best(self, wave: _Wave | None) -> tuple[float, frozenset[int]]:
        """Log weight of the likeliest set beside the wave, and its effects: from all of them one by one out,
        and from none one by one in."""
        everyone = frozenset(range(len(self._slices)))
        return max(self._climbed(start, wave) for start in (everyone, frozenset()))

    def _climbed(self, kept: frozenset[int], wave: _Wave | None) -> tuple[float, frozenset[int]]:
        weight = self._weight(kept, wave)
        while True:
            near = [kept ^ {number} for number in range(len(self._slices))]
            trial, other = max(((self._weight(each, wave), each) for each in near), key=lambda pair: pair[0])
            if trial <= weight:
                return weight, kept
            weight, kept = trial, other

    def _weight(self, kept: frozenset[int], wave: _Wave | None) -> float:
        own = self._indices(kept)
        price = sum(self._prices[number] for number in kept)
        gain, _ = _solved(self._gram, self._onto, own, self._penalty[own])
        if wave is None:
            return self._log_ratio(gain) - price
        price += np.log(self._families * self._frequencies * len(_TERMS) * len(_SIZES))
        terms = []
        for size in _SIZES:
            both, log_det = self._with_wave(wave, own, size)[:2]
            terms.append(self._log_ratio(gain + (both - gain) / wave.level) - 0.5 * log_det)
        return float(special.logsumexp(terms)) - price

    def _with_wave(self, wave: _Wave, own: np.ndarray, size: float) -> tuple[float, float, np.ndarray]:
        """Gain of effects and wave, log det of what the wave's law costs beside them, all values."""
        at = np.concatenate([own, np.arange(self._gram.shape[0], wave.gram.shape[0])])
        sure = np.full(at.size - own.size, (wave.norm / size) ** 2)
        penalty = np.concatenate([self._penalty[own], sure])
        gain, values = _solved(wave.gram, wave.onto, at, penalty)
        whole = np.linalg.slogdet(wave.gram[np.ix_(at, at)] + np.diag(penalty))[1]
        part = np.linalg.slogdet(self._gram[np.ix_(own, own)] + np.diag(self._penalty[own]))[1]
        return gain, float(whole - part - np.sum(np.log(sure))), values

    def values(self, wave: _Wave, kept: frozenset[int]) -> np.ndarray:
        """Of the wave beside these effects, at its loosest law."""
        own = self._indices(kept)
        return self._with_wave(wave, own, max(_SIZES))[2][own.size:]

    def _indices(self, kept: frozenset[int]) -> np.ndarray:
        return np.concatenate([np.zeros(0, int), *(self._slices[number] for number in sorted(kept))])

    def _log_ratio(self, gain: float) -> float:
        left = max(self._square - gain, 1e-12 * self._square)
        return 0.5 * self._count * float(np.log(self._square / left))

    @property
    def _frequencies(self) -> int:
        """That can be told apart: half of the samples of the longest run."""
        return max(run.size for run in self._runs) // 2


def _solved(gram: np.ndarray, onto: np.ndarray, at: np.ndarray, penalty: np.ndarray):
    """Fall of the penalised square sum, values."""
    if not at.size:
        return 0.0, np.zeros(0)
    system = gram[np.ix_(at, at)] + np.diag(penalty)
    size = 1.0 / np.sqrt(np.diag(system))
    values = size * linalg.solve(size[:, None] * system * size, size * onto[at], assume_a="pos")
    return float(values @ onto[at]), values


def _pieces(fitted: Fitted, left: np.ndarray, runs) -> list[np.ndarray]:
    """Whitened residual (R,) of every run and component; rows that are left out are zero."""
    left = left[: fitted.data_numbers].reshape(fitted.residual.shape)
    return [column for run in runs for column in left[run].T]


def _lines(pieces: list[np.ndarray], step: float) -> list[float]:
    """Frequencies in Hz of the highest lines that the residuals of all runs have in common."""
    longest = max(piece.size for piece in pieces)
    size = fft.next_fast_len(PADDED * longest)
    frequency = fft.rfftfreq(size, step)
    power = sum(np.abs(fft.rfft(piece - piece.mean(), size)) ** 2 for piece in pieces)
    power[frequency < DRIFT_PERIODS / (longest * step)] = 0.0
    found: list[float] = []
    left = power.copy()
    while len(found) < _PEAKS and left.max() > 0.0:
        peak = int(np.argmax(left))
        found.append(summit(frequency, np.maximum(power, np.finfo(float).tiny), peak))
        left[max(0, peak - 2 * PADDED): peak + 2 * PADDED + 1] = 0.0
    return found
