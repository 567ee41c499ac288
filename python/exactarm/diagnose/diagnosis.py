"""Diagnosis: from data to a verdict.

The declared model re-identified, the effects that the residual asks for, what they earn on rows that chose nothing,
who else could have explained it, and what is still unexplained.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.dataset import Dataset
from exactarm.diagnose.confusion import DOUBT, next_experiment
from exactarm.diagnose.contribution import Contribution, contributions
from exactarm.diagnose.dossier import Dossier, dossier
from exactarm.diagnose.in_space import InSpace
from exactarm.diagnose.noise import NoiseFloor, noise_floor
from exactarm.diagnose.problem import Fitted, Problem
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.selection import Accepted, Progress, Selection, refit, select
from exactarm.effects.base import Effect
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.robot import Robot
from exactarm.split import DEFAULT_SEED

EXPLAINED, NOTHING, UNEXPLAINED = "explained", "no_undeclared_effect", "unexplained"
_NOISE_REACHED = 1.25  # RMS after, beside the noise floor
_FAR_ABOVE_NOISE = 1.5  # RMS after, beside a measured noise floor: something is left, whatever it follows
_SHARE_EXPLAINED = 0.5  # of the square sum above the noise; less, and the cause is not found
_CARRIES_OVER, _WRONG_SHARE = 1.6, 0.1  # held-out error beside the expected one; share of rows that may be wrong by themselves
_SHARE_STRAY = 0.25  # of what the held-out error had above noise and spread of the fit; more, and the structure left counts
_MUCH_LEFT = 0.5  # of the RMS of a torque: drives are noisy, but a model that leaves half of it has not explained it
_SPREADS = 4.0  # a chance of few parameters: times the expected spread
_RIVALS_EACH, _RIVALS = 2, 5
_MANY_PARAMETERS = 200  # above it, only the strongest rival is fitted in the other's place


@dataclass(frozen=True)
class Finding:
    """One effect that was added: values with 95 % intervals (k, 2), certainty, and the validation RMS before and after
    the round that added it (independent causes are added in one round).

    derived: numbers that follow from the values, name -> (value, low, high).
    """

    effect: Effect
    intervals: np.ndarray
    rms_before: float
    rms_after: float
    probability: float
    evidence: str
    derived: dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Alternative:
    """A rival of a finding: what it would leave on the validation rows, and whether this data can tell them apart."""

    effect: Effect
    instead_of: str
    rms_after: float
    probability: float
    collides: bool


@dataclass(frozen=True)
class Diagnosis:
    """Everything that a report says; errors (N,) are per judged number of the rows of `data`."""

    robot: Robot
    kind: str
    unit: str
    noise: NoiseFloor
    before: dict[str, ErrorSummary]
    after: dict[str, ErrorSummary]
    findings: tuple[Finding, ...]
    alternatives: tuple[Alternative, ...]
    verdict: str
    sentence: str
    next_experiment: str | None
    dossier_before: Dossier
    dossier_after: Dossier
    errors_before: dict[str, np.ndarray]
    errors_after: dict[str, np.ndarray]
    selection: Selection
    problem: Problem
    excluded: int
    excess: float
    axes: list | None
    left_out: tuple[str, ...]
    contributions: tuple[Contribution, ...] = ()
    in_space: InSpace | None = None


def diagnose(
    robot: Robot, data: Dataset, *, seed: int = DEFAULT_SEED, threads: int = 1, progress: Progress = lambda text: None
) -> Diagnosis:
    """Finds what the model of `robot` lacks on `data` (of one kind); validation rows choose nothing."""
    identification = data.split(seed)
    train, held_out = data.select(identification), data.select(~identification)
    problem = problem_for(robot, train, held_out, threads, seed)
    declared = problem.declared()
    selection = _search(problem, declared, progress)
    selection = replace(selection, fits=tuple(problem.settled(f) for f in selection.fits))
    first, last = selection.fits[0], selection.fits[-1]
    progress("what is left")
    noise = noise_floor(problem, last)
    left, had = dossier(problem, last), dossier(problem, first)
    errors = [_errors(problem, fitted) for fitted in selection.fits]
    before = {name: summarise(values[np.isfinite(values)]) for name, values in errors[0].items()}
    after = {name: summarise(values[np.isfinite(values)]) for name, values in errors[-1].items()}
    findings = tuple(
        _finding(accepted, last, declared, place, errors, problem)
        for place, accepted in enumerate(selection.accepted)
    )
    alternatives = _alternatives(problem, declared, selection)
    spread = problem.spread(last)
    excess = held_out_excess(errors[-1], problem.error_of_unit_noise(last), _SPREADS * spread)
    verdict = _verdict(problem, before, after, noise, left, bool(findings), spread)
    verdict = UNEXPLAINED if excess > _CARRIES_OVER else verdict
    if verdict == NOTHING and not noise.measured and problem.share_of_measured(last) > _MUCH_LEFT:
        verdict = UNEXPLAINED  # a floor that comes from the fit proves nothing by itself
    return Diagnosis(
        robot=_bound(problem.updated_robot(last), robot, data),
        kind=problem.kind,
        unit=problem.unit,
        noise=noise,
        before=before,
        after=after,
        findings=findings,
        alternatives=alternatives,
        verdict=verdict,
        sentence=_sentence(verdict, findings, alternatives, before, after, left, excess),
        excess=excess,
        next_experiment=next_experiment(problem, last, findings, alternatives),
        dossier_before=had,
        dossier_after=left,
        errors_before=errors[0],
        errors_after=errors[-1],
        selection=selection,
        problem=problem,
        excluded=int(np.sum((last.weight == 0.0) & (first.weight > 0.0))),  # by effects of the record
        axes=problem.axes(first, last),
        left_out=problem.left_out(),
        contributions=contributions(problem, last, declared),
        in_space=problem.in_space(first, last),
    )


def _bound(updated: Robot, robot: Robot, data: Dataset) -> Robot:
    """The updated robot, whose new effects that tell of one record act on these data files alone."""
    effects = (effect if effect in robot.effects else effect.bound_to(data) for effect in updated.effects)
    return replace(updated, effects=tuple(effects))


def _search(problem: Problem, declared: Layout, progress: Progress) -> Selection:
    """Selection on as many rows as it takes; first and last model are then fitted to all identification rows."""
    rows = problem.search_rows()
    if rows is None:
        return select(problem, declared, progress)
    part = type(problem)(problem.robot, problem.data.select(rows), problem.held_out, problem.threads, problem.seed)
    found = select(part, declared, progress)
    progress("fitting all identification rows")
    first = problem.fit(declared)
    effects = [accepted.effect for accepted in found.accepted]
    fits = [first, *found.fits[1:-1]] + ([refit(problem, declared, effects, first)] if effects else [])
    return replace(found, fits=tuple(fits))


def _errors(problem: Problem, fitted: Fitted) -> dict[str, np.ndarray]:
    """Errors of both sets; NaN where an effect of the record leaves a row out."""
    held = problem.held_out
    return {
        "identification": problem.errors(fitted, problem.data),
        "validation": problem.errors(fitted, held) if len(held) else np.zeros(0),
    }


def _judged(errors: dict[str, np.ndarray]) -> np.ndarray:
    values = errors["validation"] if errors["validation"].size else errors["identification"]
    return values[np.isfinite(values)]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _finding(accepted: Accepted, last, declared, place, errors, problem) -> Finding:
    index = len(declared.effects) + place
    effect, where, free = last.layout.effects[index], last.layout.slices[index], last.layout.free[index]
    intervals = np.column_stack([effect.values, effect.values]).astype(float)
    intervals[free] = last.fit.interval()[where]
    covariance = np.zeros((len(effect.values),) * 2)
    covariance[np.ix_(free, free)] = last.fit.covariance[where, where]
    derived = {}
    for name, value, sigma in effect.derived(covariance):
        half = float(last.fit.half_width(sigma))
        derived[name] = (value, value - half, value + half)
    caveat = effect.caveat(covariance)
    before, after = errors[accepted.round], errors[accepted.round + 1]
    judged = "validation" if before["validation"].size else "identification"
    fall = f"{judged} RMS {_rms(_judged(before)):.3g} to {_rms(_judged(after)):.3g} {problem.unit}"
    return Finding(
        effect,
        intervals,
        _rms(_judged(before)),
        _rms(_judged(after)),
        accepted.probability,
        f"{effect.describe()}; log evidence {accepted.evidence:.0f} over a model without it, {fall}"
        + (f"; {caveat}" if caveat else ""),
        derived,
    )


def _alternatives(problem: Problem, declared: Layout, selection: Selection) -> tuple[Alternative, ...]:
    """The strongest rivals of the findings, each fitted in its place."""
    chosen = [a.effect for a in selection.accepted]
    last = selection.fits[-1]
    strongest = sorted(
        ((rival, place) for place, a in enumerate(selection.accepted) for rival in a.rivals[:_RIVALS_EACH]
         if rival.evidence > 0.0),
        key=lambda pair: selection.accepted[pair[1]].evidence - pair[0].evidence,
    )
    found = []
    for rival, place in strongest[: _RIVALS if last.layout.size < _MANY_PARAMETERS else 1]:
        accepted = selection.accepted[place]
        fitted = problem.settled(refit(problem, declared, chosen[:place] + [rival.effect] + chosen[place + 1 :], last))
        left = _rms(_judged(_errors(problem, fitted)))
        probability = float(np.exp(min(rival.evidence - accepted.evidence, 0.0)) * accepted.probability)
        found.append(Alternative(
            fitted.layout.effects[len(declared.effects) + place], accepted.effect.label,
            left, probability, probability > DOUBT,
        ))
    return tuple(sorted(found, key=lambda a: -a.probability))


def held_out_excess(errors: dict[str, np.ndarray], unit: float, spread: float = 0.0) -> float:
    """How many times more the model errs on held-out rows than its fit lets expect; 1 where nothing is held out.

    RMS of the two sets (N,), each without its worst tenth (wrong rows are no lack of the model). A fit with few degrees of freedom
    errs less on its own rows, and more on others, than the noise `unit`: by about the same factor.
    spread: mean square of the held-out errors that the uncertainty of the parameters may explain.
    """
    held, fitted = (np.sort(np.abs(values[np.isfinite(values)])) for values in (errors["validation"], errors["identification"]))
    if not held.size or not fitted.size:
        return 1.0
    most = lambda values: _rms(values[: max(1, int((1.0 - _WRONG_SHARE) * len(values)))])
    return float(np.sqrt(max(most(held) ** 2 - spread, 0.0)) / max(most(fitted), 1e-300) / max(1.0, unit / max(_rms(fitted), 1e-300)) ** 2)


def _verdict(problem, before, after, noise: NoiseFloor, left: Dossier, found: bool, spread: float) -> str:
    judged = "validation" if after["validation"].n else "identification"
    rms_before, rms_after = before[judged].rms, after[judged].rms
    above, remaining = rms_before**2 - noise.value**2, rms_after**2 - noise.value**2
    strongest = left.strongest
    still = left.structure and strongest.share > problem.share_left
    if noise.measured:
        still = still or (rms_after > _NOISE_REACHED * noise.value and left.structure)
        still = still and remaining > (1.0 - _SHARE_EXPLAINED) * max(above, 1e-300)
        still = still or rms_after > _FAR_ABOVE_NOISE * noise.value
    elif still:
        # What follows the signal is structure, the rest at most noise.
        structure = strongest.share * rms_after**2
        taken = max(rms_before**2 - rms_after**2, 0.0)
        still = strongest.share > _SHARE_EXPLAINED or structure > (1.0 - _SHARE_EXPLAINED) * (taken + structure)
        still = still or (spread > 0.0 and remaining - spread > _SHARE_STRAY * max(above - spread, 1e-300))
    if still:
        return UNEXPLAINED
    return EXPLAINED if found else NOTHING


def remains(left: Dossier, excess: float) -> str:
    """What is known of a structure that nothing explains."""
    if left.structure:
        known = f"it follows the {left.strongest.signal} best, along {left.strongest.direction}"
    else:
        known = "it follows no single signal beyond chance"
    if excess > _CARRIES_OVER:
        known += f", and on rows that were not fitted the error is {excess:.1f} times what the fit lets expect"
    return known


def _sentence(verdict, findings, alternatives, before, after, left: Dossier, excess: float) -> str:
    """The verdict in one sentence that a technician understands."""
    judged = "validation" if after["validation"].n else "identification"
    if findings:
        causes = ", ".join(f.effect.title for f in findings[:3])
        more = f" and {len(findings) - 3} more" if len(findings) > 3 else ""
        fall = 1.0 - after[judged].rms / before[judged].rms
        it = "it" if len(findings) == 1 else "them"
        falls = f"falls by {100 * fall:.0f} %" if fall >= 0.005 else "does not fall"
        text = f"The model lacks {causes}{more}; with {it} the {judged} RMS error {falls}."
        doubtful = [a for a in alternatives if a.collides]
        if doubtful:
            a = doubtful[0]
            own = next(f.effect for f in findings if f.effect.label == a.instead_of)
            text += f" This data cannot tell {own.title} from {a.effect.title}."
        if verdict == UNEXPLAINED:
            text += f" A structure is left that nothing in the library explains; {remains(left, excess)}."
        return text
    if verdict == UNEXPLAINED:
        return f"The residual has a structure that nothing in the library explains; {remains(left, excess)}."
    if left.structure:
        return (f"No effect of the library earns its place: the residual follows the {left.strongest.signal} beyond chance, "
                f"but this is {100 * left.strongest.share:.0f} % of its square sum.")
    return "Nothing is missing: the residual of the declared model cannot be told from noise."
