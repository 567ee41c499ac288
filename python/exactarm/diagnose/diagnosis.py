"""Diagnosis: from data to a verdict.

The declared model re-identified, the effects that the residual asks for, what they earn on rows that chose
nothing, who else could have explained it, and what is still unexplained.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.split import DEFAULT_SEED
from exactarm.diagnose.alternatives import (
    Alternative,
    alternatives_of,
    in_words,
    left_by,
    preferred_elsewhere,
)
from exactarm.diagnose.confusion import next_experiments
from exactarm.diagnose.contribution import Contribution, contributions
from exactarm.diagnose.decisions import NAMED_AT
from exactarm.diagnose.dossier import Dossier, dossier
from exactarm.diagnose.draft import Draft, drafts_of
from exactarm.diagnose.fitted import Fitted, rows_undecided
from exactarm.diagnose.held_out_evidence import AGAINST
from exactarm.diagnose.in_space import InSpace
from exactarm.diagnose.intervals import derived_of, intervals_of
from exactarm.diagnose.joint_fit import known_beside, refit
from exactarm.diagnose.left_over import LeftOver, left_over
from exactarm.diagnose.noise import NoiseFloor, noise_floor
from exactarm.diagnose.not_noise import not_noise
from exactarm.diagnose.own_share import Own
from exactarm.diagnose.posterior import Causes, find_causes, selection_of, steps_win
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.selected import Accepted, Selection
from exactarm.diagnose.selection import Progress, select, select_anew
from exactarm.diagnose.signal import Structure
from exactarm.diagnose.standing import Dropped, Judged
from exactarm.diagnose.unknown_axes import UnknownAxes, supported_axes, unknown_axes
from exactarm.diagnose.verdict import (
    UNEXPLAINED,
    farther_out,
    held_out_excess,
    judged_of,
    more_left_out,
    no_verdict,
    rises,
    rms_of,
    sentence_of,
    stood_and_refuted,
    verdict_by_rules,
    verdict_of_causes,
    without_refuted,
)
from exactarm.diagnose.wave_in_time import wave_instead
from exactarm.effects.base import Effect
from exactarm.identify.loads import kept_masses
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.robot.robot import Robot

# Steps as they are told, in their order; ALL_ROWS only where the search takes a part of them.
DECLARED, SEARCHING, ALL_ROWS = "the declared model", "searching for causes", "fitting all rows"
LEFT, NEXT, DRAFTING = "what is left", "the next experiment", "drafting what is left"
STEPS = (DECLARED, SEARCHING, ALL_ROWS, LEFT, NEXT, DRAFTING)

_SPREADS = 4.0  # a chance of few parameters: times the expected spread


@dataclass(frozen=True)
class Finding:
    """One effect that was added: values with 95 % intervals (k, 2), certainty, and the validation RMS before
    and after the round that added it (independent causes are added in one round).

    derived: numbers that follow from the values, name -> (value, low, high). credible_set: (effect, joint,
    probability) of the causes that hold 95 % of what could stand in its place, with everything else in the
    model; own_share of the held-out square sum; likelier: an unknown function that is likelier.
    """

    effect: Effect
    intervals: np.ndarray
    rms_before: float
    rms_after: float
    probability: float
    evidence: str
    derived: dict[str, tuple[float, float, float]]
    credible_set: tuple[tuple[str, int | None, float], ...] = ()
    own_share: float | None = None
    likelier: Structure | None = None
    caveat: str = ""  # what the estimate cannot tell


@dataclass(frozen=True)
class Diagnosis:
    """Everything that a report says; errors (N,) are per judged number of the rows of `data`; held_out_gain
    in nats, of all effects together (held_out_evidence.py), where none is left of those that were tried."""

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
    experiments: tuple
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
    causes: Causes | None = None
    unconverged: tuple[str, ...] = ()
    held_out_gain: float = 0.0
    dropped: tuple[Dropped, ...] = ()
    drafts: tuple[Draft, ...] = ()
    unknown: tuple[Structure, ...] = ()  # what is known of causes that the library lacks
    excluded_error: float | None = None  # m, median of the rows that are left out
    excluded_places: tuple[str, ...] = ()  # of these rows, in words
    excluded_elsewhere: tuple[str, ...] = ()  # of those among the validation rows
    excluded_more: bool = False  # of the validation rows, than chance makes of wrong ones
    preferred: str = ""  # of a rival for which rows that were not fitted speak
    by_rival: bool = False  # whether nothing else than that is left
    undecided: tuple[str, ...] = ()  # validation rows of which nothing says whether a step lies before them
    left_over: LeftOver | None = None
    # of series, beside a model to which nothing else objects; of poses that no posterior of all causes judged
    beyond: UnknownAxes | None = None

    @property
    def converged(self) -> bool:
        """Whether the fits that the verdict rests on have all arrived."""
        return not self.unconverged

    def contribution_of(self, finding: Finding) -> Contribution | None:
        """What it does by itself; one axis may have several waves of one name."""
        own = finding.effect
        return next((c for c in self.contributions
                     if c.effect.label == own.label and c.effect.values == own.values), None)


def diagnose(robot: Robot, data: Dataset, *, seed: int = DEFAULT_SEED, threads: int = 1,
             progress: Progress = lambda text: None) -> Diagnosis:
    """Finds what the model of `robot` lacks on `data` (of one kind); validation rows choose nothing, they may
    only object (standing.py)."""
    identification = data.split(seed)
    train, held_out = data.select(identification), data.select(~identification)
    problem = problem_for(robot, train, held_out, threads, seed)
    progress(DECLARED)
    declared = problem.declared()
    selection, causes = _search(problem, declared, progress)
    for _ in range(problem.most_waves_in_time):
        wave = wave_instead(problem, selection, len(declared.effects))
        calm = problem.without_hum(selection.fits[-1]) if wave is None else problem.without_wave(wave)
        if calm is None:
            break
        problem = calm
        declared = problem.declared()
        selection, causes = _search(problem, declared, progress)
    declared = Layout(declared.effects, selection.fits[0].layout.free)
    selection = replace(selection, fits=tuple(problem.settled(f) for f in selection.fits))
    progress(LEFT)
    asked = judged = Judged.of(problem, declared, selection, causes)
    withdrawn, dropped = (), ()
    if (calmed := without_refuted(causes, judged.sure, sum(judged.gains))) is not None:
        withdrawn = tuple(dict.fromkeys(accepted.effect.title for accepted in selection.accepted))
        causes = calmed
        asked = judged = Judged.of(problem, declared, Selection(selection.fits[:1], ()), causes)
    else:
        judged, causes, dropped = judged.standing(problem, declared, causes)
    selection, errors, own = judged.selection, judged.errors, judged.own
    first, last = selection.fits[0], selection.fits[-1]
    noise = noise_floor(problem, last)
    left = dossier(problem, last)
    had = left if first is last else dossier(problem, first)
    # of the validation: left out by the last model, and not by the first
    gone = np.flatnonzero(np.isfinite(errors[0]["validation"]) & np.isnan(errors[-1]["validation"]))
    between = rows_undecided(last.layout, problem.data, problem.held_out)[gone]
    before, after, tried = ({name: summarise(values[np.isfinite(values)]) for name, values in each.items()}
                            for each in (_without(errors[0], gone[between]), errors[-1], asked.errors[-1]))
    findings = tuple(_finding(accepted, last, declared, place, errors, problem,
                              own[place] if own else None, judged.sure[place])
                     for place, accepted in enumerate(selection.accepted))
    alternatives = alternatives_of(problem, declared, selection, errors[-1])
    rival = preferred_elsewhere(alternatives)
    preferred = in_words(rival, [finding.effect for finding in findings])
    findings = tuple(replace(f, probability=left_by(rival, f.effect.label, f.probability))
                     for f in findings)
    progress(NEXT)
    words, experiments = next_experiments(problem, last, findings, alternatives, selection.open_place)
    spread = problem.spread(last)
    chance = _SPREADS * spread
    excess = held_out_excess(errors[-1], problem.error_of_unit_noise(last), chance)
    if causes is None:
        verdict = verdict_by_rules(problem, before, after, noise, left, bool(findings), spread, excess,
                                   problem.share_of_measured(last), chance)
    else:
        verdict = verdict_of_causes(causes, after, noise, excess, left.of_posture, chance)
    beyond = None
    if causes is None and problem.by_posterior:
        beyond = unknown_axes(problem, last)
    elif verdict != UNEXPLAINED and problem.unknown_rivals:
        beyond = supported_axes(problem, last)
    if beyond and beyond.something >= NAMED_AT:
        verdict = UNEXPLAINED
    waves = problem.waves(last, noise.value if noise.measured else None)
    unknown = _unknown_beside(causes, (*findings, *dropped))
    unconverged = _unconverged(selection)
    stood, refuted = stood_and_refuted((*findings, *dropped))
    refuted = refuted and not (causes and stood)  # what stands explains it all the same
    # where nothing stands, the sentence is about what was tried
    gain, told = sum((judged if findings else asked).gains), after if findings else tried
    worse = gain < 0.0 and rises(before, told)
    undecided = selection.undecided
    wrong = (last.weight == 0.0) & (first.weight > 0.0)  # rows that an effect of the record leaves out
    more = more_left_out(int(wrong.sum()), len(wrong), int(np.sum(~between)), len(problem.held_out))
    far = (farther_out(errors[-1], problem.poses, problem.error_of_unit_noise(last))
           if problem.by_posterior and findings else 0)
    if (unconverged or refuted or worse or waves or undecided or gain < AGAINST or more or far
            or problem.misdeclared):
        verdict = UNEXPLAINED
    of_what_is_left, verdict = verdict, UNEXPLAINED if preferred else verdict
    drafts = ()
    may_draft = ((problem.drafts or problem.unknown_rivals) and not unconverged and not undecided
                 and not problem.misdeclared)
    if of_what_is_left == UNEXPLAINED and may_draft:
        progress(DRAFTING)
        bare = _without_outdone(problem, declared, last, findings)
        drafts, others, drafted = drafts_of(problem, declared, bare, beyond if bare is last else None)
        if causes is None and (drafts or others):
            unknown = tuple(Structure(draft.effect.title) for draft in drafts) + others
            waves = problem.waves(drafted, noise.value if noise.measured else None)
    if problem.misdeclared:
        unknown = (Structure("the arm may be mounted otherwise than its robot file says"), *unknown)
    unknown += (Structure(f"{far} of the poses that were not fitted err farther than all fitted ones"),
                ) * bool(far)
    unknown += waves or (problem.shakes(last) if of_what_is_left == UNEXPLAINED else ())
    return Diagnosis(
        robot=kept_masses(_bound(problem.updated_robot(last), robot, data), robot),
        kind=problem.kind, unit=problem.unit, noise=noise, before=before, after=after, findings=findings,
        alternatives=alternatives, verdict=verdict,
        sentence=no_verdict(unconverged) if unconverged else sentence_of(
            of_what_is_left, findings, alternatives, before, told, left, excess, unknown, gain, undecided,
            withdrawn, dropped[::-1], bool(beyond and beyond.faint), problem.error_along) + preferred,
        preferred=preferred, by_rival=bool(preferred) and of_what_is_left != UNEXPLAINED,
        dropped=dropped,
        causes=causes, unconverged=unconverged, drafts=drafts, unknown=unknown, excess=excess,
        held_out_gain=gain, next_experiment=words, experiments=experiments, dossier_before=had,
        dossier_after=left, errors_before=errors[0], errors_after=errors[-1], selection=selection,
        problem=problem, excluded=int(wrong.sum()),
        excluded_error=_median_error(last.residual[wrong]),
        excluded_places=tuple(problem.data.place_of(row) for row in np.flatnonzero(wrong)),
        excluded_elsewhere=tuple(problem.held_out.place_of(row) for row in gone[~between]),
        excluded_more=more, undecided=tuple(problem.held_out.place_of(row) for row in gone[between]),
        axes=problem.axes(first, last),
        left_out=problem.left_out() + tuple(filter(None, map(_unseen, findings))),
        contributions=contributions(problem, last, declared),
        in_space=problem.in_space(first, last),
        left_over=left_over(problem, last, left) if verdict == UNEXPLAINED else None, beyond=beyond)


def _without_outdone(problem: Problem, declared: Layout, last: Fitted, findings) -> Fitted:
    """The last fit without the effects that something else outdoes: they would hide it."""
    kept = [finding.effect for finding in findings if finding.likelier is None]
    return last if len(kept) == len(findings) else refit(problem, declared, kept, last)


def _unknown_beside(causes: Causes | None, findings) -> tuple[Structure, ...]:
    """What is known of causes that the library lacks."""
    if causes is not None:
        return causes.unknown + not_noise(causes.noise)
    return tuple(dict.fromkeys(finding.likelier for finding in findings if finding.likelier))


def _unconverged(selection: Selection) -> tuple[str, ...]:
    """In words: which of the fits that a verdict rests on stopped before they had arrived."""
    fits = {"of the declared model": selection.fits[0], "with the effects found": selection.fits[-1]}
    return tuple(f"the fit {name} did not converge: {fitted.fit.reason}" for name, fitted in fits.items()
                 if not fitted.fit.converged)


def _median_error(residual: np.ndarray) -> float | None:
    """Of positions (N, 3 or more) m; only their effects leave rows out."""
    return float(np.median(np.linalg.norm(residual[:, :3], axis=1))) if len(residual) else None


def _bound(updated: Robot, robot: Robot, data: Dataset) -> Robot:
    """The updated robot, whose new effects that tell of one record act on these data files alone."""
    effects = (effect if effect in robot.effects else effect.bound_to(data) for effect in updated.effects)
    return replace(updated, effects=tuple(effects))


def _search(problem: Problem, declared: Layout, progress: Progress) -> tuple[Selection, Causes | None]:
    """Selection on as many rows as it takes; first and last model are then fitted to all identification
    rows."""
    rows = problem.search_rows()
    part = problem
    if rows is not None:
        part = type(problem)(problem.robot, problem.data.select(rows), problem.held_out, problem.threads,
                             problem.seed)
    progress(SEARCHING)
    causes = find_causes(part, declared, progress) if problem.by_posterior else None
    declared = declared if causes is None else causes.fits[0].layout
    if causes is None:
        declared, found = select_anew(part, declared, progress)
    else:
        found = selection_of(causes)
        curved = any(place.effect.any_curve for place in causes.places)
        if all(place.effect.any_curve for place in causes.places) and (causes.unknown or curved):
            # Forms that no block has (an order with its overtone) are reached step by step only: unknown
            # functions, or a curve of other orders, stand in for them.
            by_steps = select(part, declared, progress)
            if by_steps.accepted and steps_win(causes, by_steps):
                found, causes, curved = by_steps, None, False
        if curved:
            # Where one gear has an error of many orders, the others will: too many for one picture.
            more = select(part, declared, progress, found)
            found, causes = (found, causes) if more is None else (more, None)
    fits = list(found.fits)
    if rows is not None:
        progress(ALL_ROWS)
        first = problem.fit(declared)
        effects = [accepted.effect for accepted in found.accepted]
        start = replace(first, sigma=fits[-1].sigma)  # what the effects leave
        fits = [first, *fits[1:-1]] + ([refit(problem, declared, effects, start)] if effects else [])
    if causes is not None:
        fits[-1] = known_beside(problem, fits[-1], causes.noise, rows)
    return replace(found, fits=tuple(fits)), causes


def _without(errors: dict[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The errors without those of validation rows that judge nothing."""
    validation = errors["validation"].copy()
    validation[rows] = np.nan
    return errors | {"validation": validation}


def _unseen(finding: Finding) -> str:
    """In words: the values of an effect that the rows do not show."""
    hidden = [p.name for p, (low, _) in zip(finding.effect.parameters(), finding.intervals) if np.isnan(low)]
    return f"{', '.join(hidden)} of the {finding.effect.title}: these rows do not show it" if hidden else ""


def _finding(accepted: Accepted, last, declared, place, errors, problem, own: Own | None,
             probability: float) -> Finding:
    index = len(declared.effects) + place
    effect, where, free = last.layout.effects[index], last.layout.slices[index], last.layout.free[index]
    covariance = np.zeros((len(effect.values),) * 2)
    covariance[np.ix_(free, free)] = last.fit.covariance[where, where]
    caveat = effect.caveat(covariance)
    before, after = (rms_of(judged_of(errors[k])) for k in (accepted.round, accepted.round + 1))
    if own is not None:  # with all others in the model, whose round it shares
        after = rms_of(judged_of(errors[-1]))
        before = own.without * after
    judged = "validation" if errors[0]["validation"].size else "identification"
    evidence = (f"log evidence {accepted.evidence:.0f} over a model without it, "
                if np.isfinite(accepted.evidence) else "")  # of rows that are wrong: a share, no odds
    fall = f"{judged} RMS {before:.3g} to {after:.3g} {problem.unit}"
    return Finding(
        effect, intervals_of(effect, last, where, free), before, after, probability,
        f"{effect.describe_on(problem.robot)}; " + evidence + fall
        + (f"; {caveat}" if caveat else "")
        + (f"; likelier: {accepted.likelier}" if accepted.likelier else ""),
        derived_of(effect, last, where, free), accepted.in_its_place(), own.share if own else None,
        accepted.likelier, caveat)
