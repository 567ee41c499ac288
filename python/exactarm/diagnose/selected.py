"""What a selection has found: effects in the model, and the fits on the way to them."""

from __future__ import annotations

from dataclasses import dataclass

from exactarm.diagnose.problem import Fitted
from exactarm.diagnose.scan import Candidate
from exactarm.effects.base import Effect


@dataclass(frozen=True)
class Accepted:
    """An effect in the model: its evidence, its probability among all rivals, the rivals by evidence.

    round: it came in between fits[round] and fits[round + 1] of the selection. share: of it beside unknown
    functions, where the kind of data has them for rivals; likelier: such a function that beats it, in words.
    """

    effect: Effect
    evidence: float
    probability: float
    rivals: tuple[Candidate, ...]
    round: int
    credible_set: tuple[tuple[str, int | None, float], ...] = ()
    share: float = 1.0
    likelier: str = ""


@dataclass(frozen=True)
class Selection:
    """fits[0] is the declared model, fits[i] the one after i rounds."""

    fits: tuple[Fitted, ...]
    accepted: tuple[Accepted, ...]
