"""One case of a study: a plan, and how it went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.commands.compare import Played
from exactarm.plan.optimal import Plan


@dataclass(frozen=True)
class Case:
    """One plan, nu the weight of the acceleration it compares with, and how it went on the virtual robot."""

    nu: float
    plan: Plan
    played: Played
    bandwidth: tuple[float | None, ...]  # Hz per axis, plan/spectrum.py
    ringing: np.ndarray  # (n,) rad/s^2, output side

    @property
    def widest(self) -> float:
        """Hz: the largest bandwidth of an axis."""
        return max((value for value in self.bandwidth if value is not None), default=0.0)
