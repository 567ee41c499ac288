"""One round of the search: causes beside one fit, with the noise that they leave.

The rows are searched under a noise model, which is estimated anew with the causes found, until neither
changes; from up to three starts: one normal law, the family that the residual asks for, the same with what
rows share in time. The start whose likelihood, prior and price are better wins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm.diagnose.decisions import LEAST_NATS
from exactarm.diagnose.evidence import WEAKEST, Members, Picture
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.search import Posterior, prior_of, search
from exactarm.diagnose.signal import Structure
from exactarm.diagnose.vocabulary import SCALES, Block, Vocabulary
from exactarm.noise.estimate import log_likelihood_under, normal_noise
from exactarm.noise.model import NoiseModel
from exactarm.numerics.factors import lstsq
from exactarm.numerics.orthonormal import orthonormal

# causes and unknown functions together: of more, on measured arms, the sum fits its own rows only (UR10:
# eleven)
MOST_AT_ONCE = 5
_NOISE_PASSES = 3
_COLUMN_COSTS = 0.5  # of a degree of freedom, for a column under a prior
# relative change of a row's scale that moves no probability much: sizes are known to a factor of three
_SAME_SCALE = 0.3


@dataclass(frozen=True)
class At:
    """One fit as the search sees it; known: causes in it."""

    residual: np.ndarray
    jacobian: np.ndarray
    vocabulary: Vocabulary
    groups: np.ndarray
    known: int = 0

    @staticmethod
    def of(problem: Problem, fitted: Fitted, vocabulary: Vocabulary, known: int = 0) -> At:
        return At(fitted.residual, fitted.jacobian, vocabulary, problem.groups(), known)

    @cached_property
    def declared(self) -> np.ndarray:
        return basis_of(self.jacobian)


@dataclass(frozen=True)
class Found:
    """One round: the fit, the picture, the causes that are certain, the posterior over what acts beside them,
    the noise, and the residual (N, m) that the best set leaves in the linear picture."""

    at: At
    picture: Picture
    certain: Members
    posterior: Posterior
    noise: NoiseModel
    left: np.ndarray

    @property
    def members(self) -> Members:
        """The best set."""
        beside = self.posterior.members[self.posterior.best]
        return Members(self.certain.blocks + beside.blocks, self.certain.scales + beside.scales)

    def block(self, index: int) -> Block:
        return self.picture.vocabulary.blocks[index]

    def probability_of_unknown(self) -> float:
        unknown = self.picture.vocabulary.unknown
        if any(self.block(i).label in unknown for i in self.certain.blocks):
            return 1.0
        return self.posterior.probability(lambda labels: not unknown.isdisjoint(labels))

    def probability_of_nothing(self) -> float:
        return 0.0 if self.certain.blocks else self.posterior.probability(lambda labels: not labels)

    def named_blocks(self) -> tuple[Block, ...]:
        """Of the named causes in the best set."""
        blocks = (self.block(index) for index in self.members.blocks)
        return tuple(block for block in blocks if block.effect is not None)

    def structures(self) -> list[Structure]:
        """The unknown functions in the best set."""
        unknown = (self.block(i).unknown for i in self.members.blocks)
        return [each.structure for each in unknown if each is not None]


def search_round(problem: Problem, at: At, noise: NoiseModel | None) -> Found | None:
    """The best of the starts: one normal law, the family of the present residual, the same with what
    neighbours share; of one, where the noise is known.

    None where every start asks for too many causes at once."""
    if noise is not None and len(noise.weight) == len(at.residual):
        return _settled(problem, at, noise)
    asked = problem.noise_of(at.residual, at.jacobian.shape[2], at.declared)
    starts = [normal_noise(at.residual, at.jacobian.shape[2], at.groups, problem.rounding(), at.declared)]
    starts += [replace(asked, wandering=None)] if asked.family != "gauss" else []
    starts += [asked] if asked.wandering is not None else []
    found = (_settled(problem, at, start) for start in starts)  # one after another: a picture is large
    return max((f for f in found if f is not None), key=_score, default=None)


def _settled(problem: Problem, at: At, noise: NoiseModel) -> Found | None:
    """Search and noise in turn, until neither changes; None where it asks for too many causes at once."""
    for _ in range(_NOISE_PASSES):
        picture = Picture.of(at.vocabulary, at.residual, at.jacobian, noise, known=at.known)
        found = Found(at, picture, *search(picture, MOST_AT_ONCE + 1), noise, at.residual)
        members = found.members
        if len(members.blocks) > MOST_AT_ONCE:
            return None
        residual = at.residual - _prediction(picture, members, at, noise)
        columns = sum(found.block(i).columns for i in members.blocks)
        lost = picture.absorbed.spent + columns * _COLUMN_COSTS / residual.shape[1]
        before, noise = noise, problem.noise_of(residual, lost, at.declared)
        if alike(before, noise):
            break
    return replace(found, noise=noise, left=residual)


def score_of(found: Found) -> float:
    """Log of likelihood times prior of the best set under its noise; without what the declared parameters,
    which are the same for all sets, cost."""
    picture, members = found.picture, found.members
    log_det, _ = picture.quadratic(members)
    standard = [value / (SCALES[scale] * found.block(i).size)
                for i, scale, value in zip(members.blocks, members.scales, picture.coefficients(members))]
    score = log_likelihood_under(found.noise, found.left)
    score -= 0.5 * log_det + 0.5 * sum(float(b @ b) for b in standard)
    return score + prior_of(picture, members)


def _score(found: Found) -> float:
    """The same with the declared parameters integrated out (restricted likelihood), and the noise's own
    price: what two starts are compared by."""
    at, left, noise = found.at, found.left, found.noise
    white = noise.whiten(at.declared)
    score = score_of(found) - 0.5 * float(np.linalg.slogdet(white.T @ white)[1])
    score -= 0.0 if noise.family == "gauss" else LEAST_NATS
    # of its two parameters
    return score - (0.0 if noise.wandering is None else LEAST_NATS + np.log(len(left)))


def basis_of(jacobian: np.ndarray) -> np.ndarray:
    """(N, m, b) of columns (N, m, P)."""
    flat = jacobian.reshape(-1, jacobian.shape[2])
    return orthonormal(flat, WEAKEST).reshape(*jacobian.shape[:2], -1)


def alike(one: NoiseModel, other: NoiseModel) -> bool:
    """Whether two noise models weigh the rows alike, so that a search under either finds the same."""
    scale = lambda noise: np.sqrt(noise.weight)[:, None] / noise.sigma
    apart = scale(one) / (scale(other) + 1e-300)
    kept = one.family == other.family and abs(one.shared - other.shared) < 0.2 and one.wanders_like(other)
    kept = kept and (one.rounding is None) == (other.rounding is None)
    return kept and float(np.max(np.abs(apart - 1.0))) < _SAME_SCALE


def _prediction(picture: Picture, members: Members, at: At, noise: NoiseModel) -> np.ndarray:
    """(N, m) what the set and the declared parameters, moved along, take from the residual (linear
    picture)."""
    taken = picture.response(members)
    left = at.residual - taken
    design, right = noise.whiten(at.jacobian), noise.whiten(left[:, :, None])[:, 0]
    norm = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    step = lstsq(design / norm, right, rcond=1e-10)[0] / norm
    return taken + at.jacobian @ step
