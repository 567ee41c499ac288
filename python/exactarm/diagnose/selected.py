"""What a selection has found: effects in the model, and the fits on the way to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.diagnose.decisions import CREDIBLE, DOUBT, LEAST_EVIDENCE, NAMED_AT
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.scan import Candidate
from exactarm.diagnose.signal import Structure
from exactarm.effects.base import Effect

UNKNOWN = "unknown"  # in the place of a name, for a cause that the library lacks


@dataclass(frozen=True)
class Accepted:
    """An effect in the model: its evidence, its probability among all rivals, the rivals by evidence.

    round: it came in between fits[round] and fits[round + 1] of the selection. share: of it beside unknown
    functions, where the kind of data has them for rivals; likelier: such a function that beats it.
    """

    effect: Effect
    evidence: float
    probability: float
    rivals: tuple[Candidate, ...]
    round: int
    credible_set: tuple[tuple[str, int | None, float], ...] = ()
    share: float = 1.0
    likelier: Structure | None = None

    def in_its_place(self) -> tuple[tuple[str, int | None, float], ...]:
        """The credible set; of effects found step by step, itself, by their evidence its rivals, and what
        the library lacks."""
        if self.credible_set:
            return self.credible_set
        own = self.effect.name, self.effect.joint
        others: dict[tuple[str, int | None], float] = {}
        for rival in self.rivals:
            place = rival.effect.name, rival.effect.joint
            if place != own:
                sure = self.probability * float(np.exp(min(rival.evidence - self.evidence, 0.0)))
                others[place] = others.get(place, 0.0) + sure
        left = min(1.0, (1.0 - self.probability) / max(sum(others.values()), np.finfo(float).tiny))
        named = {own: self.probability} | {place: left * sure for place, sure in others.items()}
        each = {place: self.share * sure for place, sure in named.items()}
        each[UNKNOWN, None] = (1.0 - self.share) * sum(named.values())
        found: list[tuple[str, int | None, float]] = []
        for (name, joint), sure in sorted(each.items(), key=lambda one: -one[1]):
            if not found or sure >= DOUBT and sum(probability for *_, probability in found) < CREDIBLE:
                found.append((name, joint, sure))
        return tuple(found)


@dataclass(frozen=True)
class Undecided:
    """Titles of causes of which one is missing; sure: no cause at all is next to impossible."""

    titles: tuple[str, ...]
    sure: bool

    def __str__(self) -> str:
        return " or ".join(self.titles)


@dataclass(frozen=True)
class Selection:
    """fits[0] is the declared model, fits[i] the one after i rounds; asked: what earned a place that may be
    filled by a rival as well, and is not in the model."""

    fits: tuple[Fitted, ...]
    accepted: tuple[Accepted, ...]
    asked: tuple[Accepted, ...] = ()

    @property
    def open_place(self) -> Accepted | None:
        """Where a cause is missing, by all that is known, and none is likelier than not."""
        lost = [a for a in self.asked if a.probability < NAMED_AT and a.rivals]
        return max(lost, key=lambda each: each.evidence) if lost else None

    @property
    def undecided(self) -> Undecided | None:
        """The causes of which one is missing there."""
        if (best := self.open_place) is None:
            return None
        alike = [c.effect for c in best.rivals if c.evidence > best.evidence - LEAST_EVIDENCE]
        titles = tuple(dict.fromkeys(effect.title for effect in (best.effect, *alike)))
        whole = sum(probability for *_, probability in best.credible_set)
        return Undecided(titles, not best.credible_set or whole >= CREDIBLE)
