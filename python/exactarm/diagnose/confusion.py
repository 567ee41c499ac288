"""Confusion: causes that this data cannot tell apart, and the measurements that would tell them apart.

A rival of a finding is doubtful when its posterior probability beside the finding is not negligible: its
prediction, with everything else fitted anew, is then as good within the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.selected import Accepted
from exactarm.effects.base import Effect


@dataclass(frozen=True)
class Place:
    """A cause that was found, and its doubtful rivals, each with its probability."""

    effect: Effect
    probability: float
    rivals: tuple[tuple[Effect, float], ...]

    @property
    def titles(self) -> str:
        return " or ".join([self.effect.title, *(rival.title for rival, _ in self.rivals)])


def doubtful_places(findings, alternatives) -> tuple[Place, ...]:
    """Every finding that has doubtful rivals, the most doubtful first."""
    places = []
    for finding in findings:
        rivals = tuple((a.effect, a.probability)
                       for a in alternatives if a.collides and a.instead_of == finding.effect.label)
        if rivals:
            places.append(Place(finding.effect, finding.probability, rivals))
    return tuple(sorted(places, key=lambda place: -max(p for _, p in place.rivals)))


def open_places(place: Accepted | None) -> tuple[Place, ...]:
    """A place of causes of which none is in the model, or none."""
    if place is None:
        return ()
    rivals = tuple((rival.effect, place.probability * float(np.exp(rival.evidence - place.evidence)))
                   for rival in place.rivals)
    return (Place(place.effect, place.probability, rivals),)


def next_experiments(problem: Problem, fitted: Fitted, findings, alternatives,
                     place: Accepted | None = None) -> tuple[str | None, tuple]:
    """What to measure to part the doubtful causes: in words (None where none is doubtful), and as experiments
    where the kind of data can plan them, the best first; place: of causes of which none is in the model."""
    places = (*open_places(place), *doubtful_places(findings, alternatives))
    return problem.next_experiments(fitted, places) if places else (None, ())
