"""Forms of one cause on one axis: a single order, a run-out, or any repeatable curve of a gear.

Which of them the data asks for is decided by the cross-validated error over whole poses or runs: the form
with the fewest free parameters whose error is not certainly worse than the best one's (one standard error of
the paired differences between folds; Breiman et al. 1984).
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import Candidate, free_mask, linear_columns, prior_of, scan
from exactarm.effects.base import Effect

_HOPELESS = 2.0  # times the square sum that the closest fitting form leaves: held out it will not do better


def same_family(one: Effect, other: Effect) -> bool:
    """Whether both are forms of one cause on one axis."""
    return bool(one.family) and one.family == other.family and one.joint == other.joint


def parts_of_one_wave(first: Candidate, second: Candidate, least: float) -> bool:
    """Whether both were searched on one axis, by different laws, and the second is asked for beside the
    first: a wave that differs with the direction has a common half and one that changes its sign, and either
    alone is wrong in some runs."""
    one, other = first.effect, second.effect
    searched = all(any(p.search for p in effect.parameters()) for effect in (one, other))
    return searched and one.joint == other.joint and one.name != other.name and second.evidence >= least


def forms_of(without: Fitted, effect: Effect, field: list[Effect], count: float,
             least: float) -> dict[tuple, Candidate]:
    """The forms of `effect` among `field` by name and number of free parameters, each at its best point."""
    forms: dict[tuple, Candidate] = {}
    for form in (other for other in field if same_family(other, effect)):
        found = scan(without, [form], count)[0]
        key = (found.effect.name, int(free_mask(found.effect).sum()))
        if found.evidence >= least and (key not in forms or found.evidence > forms[key].evidence):
            forms[key] = found
    return forms


def best_form(problem: Problem, without: Fitted, effect: Effect, field: list[Effect], count: float,
              least: float) -> Candidate | None:
    """The form of `effect` among `field` that the data asks for; None where there is nothing to choose
    between.

    without: the fit without the effect; count: independent numbers; least: evidence that a form must have.
    """
    forms = forms_of(without, effect, field, count, least)
    if len(forms) < 2:
        return None
    square = float(without.free_residual @ without.free_residual)
    left = {key: square - found.gain for key, found in forms.items()}
    able = [key for key in forms if left[key] <= _HOPELESS * min(left.values())]
    if len(able) < 2:
        return forms[able[0]]
    parted = CrossValidation.of(without, folds_of(problem.groups(), problem.seed))
    errors = {key: parted.squares(linear_columns(without, forms[key].effect), prior_of(forms[key].effect))
              for key in able}
    best = min(able, key=lambda key: errors[key].sum())
    excess = {key: errors[key] - errors[best] for key in able}
    as_good = [key
               for key in able if excess[key].mean() <= excess[key].std(ddof=1) / np.sqrt(len(excess[key]))]
    return forms[min(as_good, key=lambda key: (key[1], errors[key].sum()))]
