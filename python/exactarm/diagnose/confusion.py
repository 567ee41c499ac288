"""Confusion: causes that this data cannot tell apart, and the measurement that would part them.

A rival of a finding is doubtful when its posterior probability beside the finding is not negligible: its
prediction, with everything else fitted anew, is then as good within the noise.
"""

from __future__ import annotations

from exactarm.diagnose.problem import Fitted, Problem

DOUBT = 0.01  # a rival that is this probable cannot be ruled out


def next_experiment(problem: Problem, fitted: Fitted, findings, alternatives) -> str | None:
    """What to measure to part the most probable rival from the finding it stands beside; None when none is doubtful."""
    doubtful = [a for a in alternatives if a.collides]
    if not doubtful:
        return None
    rival = doubtful[0]
    own = next(f.effect for f in findings if f.effect.label == rival.instead_of)
    return problem.separating_experiment(fitted, own, rival.effect)
