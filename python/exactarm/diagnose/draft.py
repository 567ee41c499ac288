"""Draft: an effect that nobody wrote yet, as a formula, where a diagnosis finds something else at work.

1. Unknown functions (unknown.py) are asked for once more beside the final model, whose parameters keep their
   priors; those that turn an axis are grouped by it, the likeliest axis first (unknown_axes.py).
2. The formulas of the dictionary in the signals of an axis are compared by the evidence of the linear picture
   (evidence.py), grids of their non-linear parameters summed over. The first term, and each further one, is
   `LEAST_NATS` more likely than without. A series takes part, and wins where no short formula fits nearly as
   well (`LEAST_EVIDENCE`).
3. The winner has to lower the cross-validated square sum over whole poses, or pieces of runs; then everything
   is fitted together through the chain. An axis that no formula describes is left, and the next is tried.

Held-out rows choose nothing; a formula against which they speak (held_out_evidence.py) is no draft. An
unknown function of the device is not drafted: a formula turns one axis.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.cross_validation import folds_of
from exactarm.diagnose.decisions import DOUBT, DRAFTS, LEAST_EVIDENCE, LEAST_NATS, MANY_PARAMETERS, NAMED_AT
from exactarm.diagnose.dictionary import forms_of, is_series, sum_of
from exactarm.diagnose.evidence import Absorbed, Members
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.held_out_evidence import AGAINST, held_out_gains
from exactarm.diagnose.joint_fit import refit
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Quantity, Signal, Structure
from exactarm.diagnose.standing import errors_of
from exactarm.diagnose.unknown_axes import UnknownAxes, unknown_axes
from exactarm.diagnose.vocabulary import vocabulary_of
from exactarm.effects.axis_units import moves_by
from exactarm.effects.base import Effect
from exactarm.effects.expression import Expression, signal_of
from exactarm.noise.model import NoiseModel
from exactarm.numerics.formula import LONGEST
from exactarm.robot.robot import Robot

_MOST_TERMS, _MOST_SIGNALS = 3, 3
_IN_FORMULAS = {Quantity.ANGLE: "q", Quantity.TRAVEL: "q", Quantity.LOAD: "torque",
                Quantity.APPROACH: "approach", Quantity.DIRECTION: "approach"}
_PARAMETER = re.compile(r"[abcw]\d*(_\d+)?$")  # what a formula of the dictionary calls its parameters
_GAPS_TOLD = 3  # of each signal; the file has all


def gaps_in_words(signal: str, gaps: Sequence[tuple[float, float]],
                  slides: frozenset[int] = frozenset()) -> str:
    """The widest, in the order of the signal; angles in degrees, places of axes (from 1) that slide in mm."""
    widest = sorted(sorted(gaps, key=lambda gap: gap[0] - gap[1])[:_GAPS_TOLD])
    angle = re.fullmatch(r"(q|theta)_(\d+)", signal)
    unit, factor = (" deg", np.degrees(1.0)) if angle else ("", 1.0)
    if angle and angle[1] == "q" and int(angle[2]) in slides:
        unit, factor = " mm", 1e3
    told = ", ".join(f"{factor * low:.4g} to {factor * high:.4g}" for low, high in widest)
    others = len(gaps) - len(widest)
    more = f" and {others} narrower gap{'s' if others > 1 else ''}" if others else ""
    return f"{signal} from {told}{unit}{more}"


@dataclass(frozen=True)
class Draft:
    """effect at its fitted values with intervals (k, 2); measured: signal -> (low, high); gaps: signal ->
    intervals inside without a value; log_bayes over the model without it; held_out: RMS error before and
    after it, judged_in this unit; short: a formula, not a series; slides: axes (from 1) that slide."""

    effect: Expression
    intervals: np.ndarray
    measured: dict[str, tuple[float, float]]
    gaps: dict[str, tuple[tuple[float, float], ...]]
    log_bayes: float
    probability: float
    held_out: tuple[float, float]
    suspect: str
    short: bool  # a formula, not a series
    slides: frozenset[int] = frozenset()
    judged_in: str = "m"

    @property
    def unit(self) -> str:
        """Of what the formula adds to its axis."""
        return "m" if self.effect.joint in self.slides else "rad"

    @property
    def sentence(self) -> str:
        """Where it acts, what it follows and how, and what may be behind it."""
        formula = self.effect.form if self.short else "no short formula fits; a series of cosines does"
        numbers = (
            ", ".join(f"{name} = {value:.3g}" for name, value in zip(self.effect.names, self.effect.values))
            if self.short else "")
        gaps = [gaps_in_words(name, gaps, self.slides) for name, gaps in self.gaps.items() if gaps]
        values = f" {self.unit} with {numbers}" if numbers else ""
        return (f"{self.effect.title}: {formula}{values}. Suspect: {self.suspect}."
                + (f" Not measured: {'; '.join(gaps)}." if gaps else ""))

    def to_table(self) -> dict:
        """An entry [[effects]] of draft.toml."""
        effect = self.effect
        table = effect.to_table() | {"station": effect.station.name}
        table["intervals"] = {
            name: [float(low), float(high)] for name, (low, high) in zip(effect.names, self.intervals)}
        table["measured_between"] = {name: list(ends) for name, ends in self.measured.items()}
        if any(self.gaps.values()):
            table["gaps"] = {name: [list(gap) for gap in gaps] for name, gaps in self.gaps.items() if gaps}
        table["evidence"] = {"log_bayes": self.log_bayes, "probability": self.probability,
                             f"held_out_rms_{self.judged_in}": list(self.held_out)}
        return table | {"short_formula": self.short, "suspect": self.suspect, "status": "draft"}


def drafts_of(problem: Problem, declared: Layout, last: Fitted, seen: UnknownAxes | None = None
              ) -> tuple[tuple[Draft, ...], tuple[Structure, ...], Fitted]:
    """Unknown functions that turn an axis beside the model `last`, the likeliest axis first, each as a
    formula beside those before it, what no formula describes, and the fit with all formulas; an axis that
    none describes is left. seen: those beside `last`, where they are known."""
    found: list[Draft] = []
    fitted, seen, left = last, seen or unknown_axes(problem, last), set[int]()
    while problem.drafts and len(found) < DRAFTS:
        likely = {axis: each[0] for axis, each in seen.likely.items() if axis not in left}
        if not likely or max(likely.values()) < NAMED_AT:
            break
        axis = max(likely, key=lambda a: likely[a])
        left.add(axis)
        formula, log_bayes = _best_formula(fitted, seen.noise, problem, axis, seen.likely[axis][1])
        if formula is None:
            continue
        titled = replace(formula, heading=_title(formula, problem.robot))
        chosen = [*fitted.layout.effects[len(declared.effects) :], titled]
        trial = refit(problem, declared, chosen, fitted, _weighed_alike(problem, last, seen))
        if trial.fit.converged and not _spoken_against(problem, fitted, trial):
            found.append(_draft(problem, fitted, trial, log_bayes, likely[axis], not is_series(formula)))
            fitted = trial
            if not problem.by_posterior:
                seen = unknown_axes(problem, fitted)
        elif trial.layout.size > MANY_PARAMETERS:
            break  # seconds each, and the likeliest has failed
    drafted = {draft.effect.joint for draft in found}
    return tuple(found), tuple(what for axis, what in seen.others if axis not in drafted), fitted


def _weighed_alike(problem: Problem, last: Fitted, seen: UnknownAxes) -> NoiseModel | None:
    """The noise whose row weights a trial takes: none where `last` was fitted without them, for the RMS of
    other rows grows by weights alone."""
    used = last.weight[last.weight > 0.0]
    return seen.noise if problem.by_posterior and np.ptp(used) > 0.0 else None


def _spoken_against(problem: Problem, before: Fitted, after: Fitted) -> bool:
    """Whether held-out rows are predicted too much worse with a formula for it to be right."""
    errors = [errors_of(problem, each) for each in (before, after)]
    return held_out_gains(errors, problem.numbers_of_error, problem.correlation_factor(after))[0] < AGAINST


def _best_formula(fitted: Fitted, noise, problem: Problem, axis: int,
                  found: list[Signal]) -> tuple[Expression | None, float]:
    """The likeliest formula in the signals found, its log Bayes factor; None where none holds."""
    formulas = [formula for formula in map(_in_formulas, found) if formula is not None][:_MOST_SIGNALS]
    signals = {name: signal_of(fitted.view, name) for name in formulas}
    if not signals:
        return None, 0.0
    absorbed = Absorbed.of(fitted.residual, fitted.jacobian, noise, fitted.prior)
    parted = absorbed.parted(folds_of(problem.groups(), problem.seed))
    best, value, picture, members = _likeliest(fitted, absorbed, forms_of(axis, signals))
    for term in range(2, _MOST_TERMS + 1):
        if best is None or is_series(best):
            break
        fixed = replace(best, searched=())
        sums = [sum_of(fixed, form) for form in forms_of(axis, signals, term) if not is_series(form)]
        further = [form for form in sums if len(form.form) <= LONGEST]
        more, sum_value, *rest = _likeliest(fitted, absorbed, further)
        if more is None or sum_value < value + LEAST_NATS:
            break
        best, value, (picture, members) = more, sum_value, rest
    if best is None or value < LEAST_NATS:
        return None, 0.0
    if picture.held_out(members, parted) >= picture.held_out(Members((), ()), parted):
        return None, 0.0
    return best, value


def _likeliest(fitted: Fitted, absorbed: Absorbed, forms: list[Expression]):
    """The likeliest of formulas at its best grid point and coefficients, its log Bayes factor (its grid
    summed over), picture, set."""
    vocabulary = vocabulary_of(fitted, forms, [])
    if not vocabulary.blocks:
        return None, -np.inf, None, None
    picture = absorbed.picture(vocabulary)
    additions = picture.additions(Members((), ()))
    weight = additions.log_weight - picture.log_prior
    names, which = vocabulary.labels
    value = np.array(
        [np.logaddexp.reduce(weight[which == k]) - np.log(np.sum(which == k)) for k in range(len(names))])
    series = {block.label for block in vocabulary.blocks if is_series(block.effect)}
    # a short formula up to 150 times less likely than a series is still the one to read and to check
    top = int(np.argmax(value - LEAST_EVIDENCE * np.isin(names, list(series))))
    index = int(np.argmax(np.where(which == top, weight, -np.inf)))
    members = Members((index,), (int(additions.scale[index]),))
    block = vocabulary.blocks[index]
    values = np.asarray(block.effect.values, float).copy()
    values[block.free] = picture.coefficients(members)[0]
    return block.effect.with_values(values), float(value[top]), picture, members


def _draft(problem: Problem, before: Fitted, after: Fitted, log_bayes: float, probability: float,
           short: bool) -> Draft:
    effect, where, free = after.layout.effects[-1], after.layout.slices[-1], after.layout.free[-1]
    # what was found is plausible from now on: a library that doubts its own sizes would never name them again
    effect = replace(effect, plausible=tuple(np.maximum(effect.plausible, np.abs(effect.values)).tolist()))
    intervals = np.column_stack([effect.values, effect.values]).astype(float)
    intervals[free] = after.fit.interval()[where]
    signals = {name: signal_of(after.view, name) for name in effect.of}
    data, slides = problem.judged, frozenset(
        i for i, joint in enumerate(problem.robot.joints, start=1) if joint.type == "prismatic")
    return Draft(
        effect, intervals,
        {name: (float(values.min()), float(values.max())) for name, values in signals.items()},
        {name: gaps_of(values) for name, values in signals.items()}, log_bayes, probability,
        tuple(float(np.sqrt(np.nanmean(problem.errors(fitted, data) ** 2))) for fitted in (before, after)),
        _suspect(effect, slides), short, slides, problem.unit)


def gaps_of(values: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Intervals inside the range of a signal (N,) without a value, wider than evenly scattered values would
    leave: of N gaps the widest exceeds g with a chance of about N exp(-N g / range)."""
    sorted_values = np.unique(values)
    count = len(sorted_values)
    if count < 2:
        return ()
    widest = (sorted_values[-1] - sorted_values[0]) * np.log(count / DOUBT) / count
    wide = np.flatnonzero(np.diff(sorted_values) > widest)
    return tuple((float(sorted_values[k]), float(sorted_values[k + 1])) for k in wide)


def _in_formulas(signal: Signal) -> str | None:
    """What a formula calls a signal of a problem; None where it has no name for it."""
    name = signal.quantity
    if signal.axis is not None:
        return f"{_IN_FORMULAS[name]}_{signal.axis}" if name in _IN_FORMULAS else None
    if name == Quantity.TIME:
        return "time_h"
    return name if name.isidentifier() and not _PARAMETER.match(name) and name != Quantity.POSITION else None


def _title(effect: Expression, robot: Robot) -> str:
    """As a technician says it."""
    return f"axis {effect.joint} follows {' and '.join(_in_words(signal, robot) for signal in effect.of)}"


def _in_words(signal: str, robot: Robot) -> str:
    kind, _, axis = signal.rpartition("_")
    words = {"torque": "the load of axis", "approach": "the direction of axis"}
    if kind == "q" and axis.isdigit():
        return f"the {moves_by(robot, int(axis))}"
    if kind in words and axis.isdigit():
        return f"{words[kind]} {axis}"
    return "time" if signal == "time_h" else signal


def _suspect(effect: Effect, slides: frozenset[int]) -> str:
    """What may be behind it, in words: a place to look at, not a finding; slides: axes (from 1) that
    slide."""
    found = []
    for signal in effect.of:
        kind, _, axis = signal.rpartition("_")
        own = axis.isdigit() and int(axis) == effect.joint
        if signal == "time_h":
            found.append("something that settles, warms up or creeps with time")
        elif kind == "torque":
            found.append("something elastic or slack under its own load" if own
                         else f"something that bends under the load of axis {axis}")
        elif kind == "approach":
            found.append("friction or play that stays after a motion" if own
                         else f"a mechanical path that the last motion of axis {axis} strains")
        elif kind == "q" and axis.isdigit() and int(axis) in slides:
            found.append("the screw or the scale of the axis itself" if own
                         else f"the guide of axis {axis}, or a cable that it pulls along")
        elif kind == "q":
            found.append("the gear or the encoder of the axis itself" if own
                         else f"a hose, a cable or a linkage that axis {axis} pulls along or winds up")
        else:
            found.append(f"something that changes with {signal}")
    return "; ".join(dict.fromkeys(found))
