"""Held-out evidence: what rows that chose nothing say of the effects that were found.

Errors e_i (K,) of d numbers each, of two models on the same rows, under a Student law (Lange, Little and
Taylor 1989) with nu degrees of freedom, infinite: normal, at the scale s that suits the held-out rows best:

    log p = sum_i c(nu, d) - d log s - (nu + d)/2 log(1 + e_i^2 / (nu s^2))
    gain  = share (log p with the effects - log p without)      [nats]

nu: the one that the rows of the fit make likeliest; share: independent numbers per number, where neighbours
share their noise. Were the model with the effects right, the ratio of the densities without and with it would
reach 20 with a probability of at most 1 / 20 (Markov's inequality). So from -log 20 down held-out rows speak
against the effects, and nothing is explained, whatever the fitted rows say; rows that cannot feel an effect
gain or lose a nat by chance. Probabilities are those of the rows that were fitted, less what `allowed` takes.

Held-out rows also say how much of an effect they show: shown = (D, r + D) / (D, D), r what is left with it, D
what it takes away there. A right effect shows 1, one that imitates another cause on the fitted rows anything:

    odds of right against imitation times N(shown; 1, v) / N(shown; 0, 1 + v),   v = var + FORM^2

var: of `shown` by the noise of both sets of rows; FORM: a right effect need not be right in every detail.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import ROUNDING, UNLIKELY
from exactarm.diagnose.vocabulary import UNKNOWN_MASS
from exactarm.noise.estimate import FREEDOMS

AGAINST = float(np.log(UNLIKELY))  # nats: see above
FORM = 0.25  # of its size, by which a right effect may differ elsewhere: gears are not the same all around
MOST_NATS = 500.0  # nats: beyond, numbers overflow
_PASSES = 60


def held_out_gains(errors: Sequence[dict[str, np.ndarray]], numbers: int, share: float) -> tuple[float, ...]:
    """Gain of every round of effects, zero where nothing is held out.

    errors: of each fit, by set, NaN where a row is left out; numbers: d of each error.
    """
    fitted = errors[-1]["identification"]
    fitted = fitted[np.isfinite(fitted)]
    freedom = freedom_of(fitted, numbers)
    gains = []
    for before, after in zip(errors[:-1], errors[1:]):
        one, other = before["validation"], after["validation"]
        both = np.isfinite(one) & np.isfinite(other)
        with_effects, without = (log_density(e[both], numbers, freedom) for e in (other, one))
        gains.append(float(share * (with_effects - without)))
    return tuple(gains)


def freedom_of(errors: np.ndarray, numbers: int) -> float:
    """Degrees of freedom that make errors (K,) of `numbers` numbers each likeliest."""
    return max((np.inf, *FREEDOMS), key=lambda nu: log_density(errors, numbers, nu))


def with_held_out(probability: float, nothing: float, gain: float) -> float:
    """Posterior probability of an effect by all rows, from that by the fitted rows: the density of held-out
    rows multiplies its odds against no cause at all, which is the share `nothing` of what is against it. Its
    rivals, which explain the same, are taken to gain what it gains."""
    against = (1.0 - probability) * (1.0 - nothing + nothing * np.exp(-max(gain, -MOST_NATS)))
    return float(probability / (probability + against))


def allowed(probability: float, gain: float) -> float:
    """What held-out rows leave of a probability by the fitted rows alone: where they speak against a round of
    effects, at most exp(gain), which bounds how often effects that are right would fare so."""
    return probability if gain >= AGAINST else min(probability, float(np.exp(gain)))


def carried_over(probability: float, shown: float, variance: float) -> float:
    """What is left of a probability where held-out rows show so much of an effect, with a variance by noise:
    they take away what the odds of an imitation gain, and add nothing."""
    if not np.isfinite(variance):
        return probability
    right, wide = variance + FORM**2, 1.0 + variance + FORM**2
    odds = np.sqrt(wide / right) * np.exp(0.5 * (shown**2 / wide - (shown - 1.0) ** 2 / right))
    return float(probability * min(1.0, odds / ((1.0 - UNKNOWN_MASS) * odds + UNKNOWN_MASS)))


def log_density(errors: np.ndarray, numbers: int, freedom: float) -> float:
    """Of errors (K,) of `numbers` numbers each, at their best scale; zero where there are none."""
    square = errors**2
    if not np.any(square > 0.0):
        return 0.0
    variance = spread_of(errors, numbers, freedom)[0]
    if not np.isfinite(freedom):
        return -0.5 * numbers * len(errors) * (np.log(2.0 * np.pi * variance) + 1.0)
    half = 0.5 * (freedom + numbers)
    constant = special.gammaln(half) - special.gammaln(0.5 * freedom)
    constant -= 0.5 * numbers * np.log(freedom * np.pi * variance)
    return float(len(errors) * constant - half * np.sum(np.log1p(square / (freedom * variance))))


def spread_of(errors: np.ndarray, numbers: int, freedom: float) -> tuple[float, np.ndarray]:
    """The variance of each number of errors (K,) that makes them likeliest, and the weights (K,) of the rows
    by which it is a mean."""
    square = errors**2
    variance, weight = float(np.mean(square)) / numbers, np.ones(len(errors))
    for _ in range(_PASSES if np.isfinite(freedom) and variance > 0.0 else 0):
        weight = (freedom + numbers) / (freedom + square / variance)
        new = float(np.mean(weight * square)) / numbers
        done = abs(new / variance - 1.0) < ROUNDING
        variance = new
        if done:
            break
    return variance, weight
