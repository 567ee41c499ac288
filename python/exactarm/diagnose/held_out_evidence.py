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
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from exactarm.noise.estimate import FREEDOMS

AGAINST = float(-np.log(20.0))  # nats: see above
_MOST = 500.0  # nats: beyond, numbers overflow
_PASSES = 60
_SAME = 1e-6  # relative change of the variance that ends its estimate


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
    against = (1.0 - probability) * (1.0 - nothing + nothing * np.exp(-max(gain, -_MOST)))
    return float(probability / (probability + against))


def allowed(probability: float, gain: float) -> float:
    """What held-out rows leave of a probability by the fitted rows alone: where they speak against a round of
    effects, at most exp(gain), which bounds how often effects that are right would fare so."""
    return probability if gain >= AGAINST else min(probability, float(np.exp(gain)))


def log_density(errors: np.ndarray, numbers: int, freedom: float) -> float:
    """Of errors (K,) of `numbers` numbers each, at their best scale; zero where there are none."""
    square = errors**2
    if not np.any(square > 0.0):
        return 0.0
    variance = float(np.mean(square)) / numbers
    if not np.isfinite(freedom):
        return -0.5 * numbers * len(errors) * (np.log(2.0 * np.pi * variance) + 1.0)
    for _ in range(_PASSES):
        weight = (freedom + numbers) / (freedom + square / variance)
        new = float(np.mean(weight * square)) / numbers
        done = abs(new / variance - 1.0) < _SAME
        variance = new
        if done:
            break
    half = 0.5 * (freedom + numbers)
    constant = special.gammaln(half) - special.gammaln(0.5 * freedom)
    constant -= 0.5 * numbers * np.log(freedom * np.pi * variance)
    return float(len(errors) * constant - half * np.sum(np.log1p(square / (freedom * variance))))
