"""The report of a diagnosis: verdict, what to do next, the causes one line each, their curves, then the
evidence."""

from functools import partial

import numpy as np

from exactarm.commands.design_for import experiments_table
from exactarm.commands.effect_sections import (
    causes_in_words,
    curves_figure,
    effects_tables,
    in_words,
    listed_places,
    orders_table,
    parameters_table,
    percent,
    sizes_figure,
)
from exactarm.commands.error_sections import error_figures, error_table, highlights
from exactarm.commands.measure_more import measure_more, to_tell_noise, wild_elsewhere, worse_elsewhere
from exactarm.commands.next_steps import HEADING
from exactarm.data.kinds import CLOSURES, kind_of
from exactarm.diagnose.contribution import Contribution
from exactarm.diagnose.decisions import CREDIBLE
from exactarm.diagnose.diagnosis import Diagnosis, Finding
from exactarm.diagnose.dossier import Dossier
from exactarm.diagnose.held_out_evidence import AGAINST
from exactarm.diagnose.verdict import (
    EXPLAINED,
    NOTHING,
    UNEXPLAINED,
    beside,
    falls,
    remains,
    spoken_against,
    stood_and_refuted,
)
from exactarm.report import Figure, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import change, fixed, number, quantities
from exactarm.report.plots.arm import arm_with_errors
from exactarm.report.plots.residual import left_over_signal
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot

_LESS = 1.02  # of the error with the accepted causes: a rival below leaves no more than they do
_MANY = 0.02  # of the rows left out: a tracker's wild rows are fewer
_NEVER = 1e-16  # p-values below are all the same to a reader
_NOT_DRAWN = " Rows left out as outliers are not drawn, before and after alike."


def report_of(robot: Robot, results: list[Diagnosis], rule: str, skipped: list[str]) -> Report:
    """One report; further kinds of data follow the first; `skipped` says which could not be judged."""
    first = results[0]
    sections: list = []
    for result in results:
        found = found_effects(result)
        if len(results) > 1:
            sections.append(Text(f"Data read as {result.kind.replace('_', ' ')}",
                                 (verdict_of(robot, result, found),)))
        sections += _sections(robot, result, found, rule)
    if skipped:
        sections.append(Warnings(tuple(skipped)))
    good = first.verdict != UNEXPLAINED and (not first.findings or _pays(first))
    tone = "good" if good else "caution"
    return Report(f"Diagnosis of {robot.name}", verdict_of(robot, first, found_effects(first)),
                  tuple(sections), tone)


def _pays(result: Diagnosis) -> bool:
    """Whether the causes found lower the error of rows that were never fitted: by anything, if they are
    sure."""
    sure = all(finding.probability >= CREDIBLE for finding in result.findings)
    return falls(result.before, result.after) or sure and falls(result.before, result.after, 0.0)


def found_effects(result: Diagnosis) -> list[tuple[Finding, Contribution | None]]:
    """Every finding with what it does by itself."""
    return [(finding, result.contribution_of(finding)) for finding in result.findings]


def verdict_of(robot: Robot, result: Diagnosis, found: list[tuple[Finding, Contribution | None]]) -> str:
    """The verdict in a technician's words."""
    judged = "validation" if result.after["validation"].n else "identification"
    rows = kind_of(result.kind).rows
    named, refuted = stood_and_refuted(result.findings)
    if not named:
        return result.sentence
    before, after = result.before[judged].rms, result.after[judged].rms
    whose = (f"{rows} that were never fitted" if judged == "validation"
             else f"the fitted {rows} (none were held out)")
    lacks = {finding.effect.label for finding in named}
    lacked = [pair for pair in found if pair[0].effect.label in lacks]
    text = (
        f"The model {causes_in_words(result, lacked, robot.axes)}. With this in it the RMS error"
        f"{result.problem.error_along} on {whose} {change(before, after, result.unit)}"
        f"{_many_left_out(result, judged)}."
        f"{beside(refuted, result.dropped)}")
    doubtful = [a for a in result.alternatives if a.collides]
    if doubtful:
        own = next((f.effect for f in result.findings if f.effect.label == doubtful[0].instead_of), None)
        if own is not None:
            rival = doubtful[0].effect.title
            more = "more of " if rival in {finding.effect.title for finding in result.findings} else ""
            text += f" These data cannot tell {own.title} from {more}{rival}."
    if result.held_out_gain < AGAINST:
        text += spoken_against(len(found))
    elif result.verdict == UNEXPLAINED and not result.by_rival:
        text += (" Something is left that no known cause explains: "
                 f"{remains(result.dossier_after, result.excess, result.unknown)}.")
    return text + result.preferred


def _sections(robot: Robot, result: Diagnosis, found: list[tuple[Finding, Contribution | None]],
              rule: str) -> list:
    unit = result.unit
    name, row = kind_of(result.kind).error, kind_of(result.kind).row
    note = f"Before: the declared model with its own parameters estimated again. {rule}"
    sections: list = [highlights(result.before, result.after, unit), *_next(robot, result, found),
                      *_undecided(result)]
    if found:
        judged = "validation" if result.after["validation"].n else "identification"
        sections += [*effects_tables(result, found), *curves_figure(found),
                     orders_table(found, robot),
                     *sizes_figure(result, found, result.after[judged].rms), parameters_table(found, robot)]
    sections += [*_left_over(result), *_drafts(result)]
    sections += [error_table(result.before, result.after, unit, name.capitalize(), note),
                 *_axes_table(result), *_arm(result)]
    sections += _error_figures(result, name, row)
    if result.alternatives:
        sections.append(_rivals(result))
    if result.experiments:
        sections.append(experiments_table(result.experiments))
    sections += [
        Table("Noise floor", ("", "", "from"),
              (("no model can do better than", Quantity(result.noise.value, unit), result.noise.source),)),
        *([_dossier_table("What the error follows, before", result.dossier_before),
           _dossier_table("What the error still follows, after", result.dossier_after)] if found
          else [_dossier_table("What the error follows", result.dossier_after)])]
    outliers = _outliers(result)
    told = (*result.unconverged, *outliers, *_between(result), *result.left_out)
    if told:
        sections.append(Warnings(told))
    return sections


def _between(result: Diagnosis) -> tuple[str, ...]:
    """Validation rows that a step may lie before or behind."""
    if not result.undecided:
        return ()
    rows = ("1 validation row judges" if len(result.undecided) == 1
            else f"{len(result.undecided)} validation rows judge")
    return (f"{rows} nothing{listed_places(result.undecided)}: between the fitted rows before and after what "
            "happened at once",)


def _many_left_out(result: Diagnosis, judged: str) -> str:
    """A better error that is that of fewer rows, where they are many."""
    rows = result.before[judged].n
    left = rows - result.after[judged].n - (len(result.undecided) if judged == "validation" else 0)
    return f" ({left} of the {rows} left out as outliers)" if left > _MANY * rows else ""


def _outliers(result: Diagnosis) -> tuple[str, ...]:
    """How many rows of each set are taken for wrong measurements; an error after is that of the others."""
    counts = {"identification": result.excluded,
              "validation": len(result.excluded_elsewhere)}
    told = " and ".join(f"{n} {name} row{'s' if n > 1 else ''}" for name, n in counts.items() if n)
    if not told:
        return ()
    one = sum(counts.values()) == 1
    told += listed_places(result.excluded_elsewhere)
    often = result.excluded_more * (
        "; of the rows that were not fitted these are more than chance makes: they may follow what the model "
        "lacks, and be no wrong measurements")
    return (f"{told} {'was left out as an outlier' if one else 'were left out as outliers'}{often}",)


def _next(robot: Robot, result: Diagnosis, found: list[tuple[Finding, Contribution | None]]) -> list[Text]:
    """What the reader does with this page."""
    lines = []
    stood, refuted = stood_and_refuted(result.findings)
    corrected = sorted({f.effect.in_plain_words_on(robot) for f in stood if f.effect.compensable})
    if result.problem.misdeclared:
        lines.append("Look first at where gravity points: mend `gravity_m_s2` of your robot file and "
                     "diagnose again. What is found until then may stand for it.")
    elif result.preferred:
        lines.append("Keep your robot file: rows that were not fitted speak for another cause than those "
                     "found.")
    elif found and not _pays(result):
        lines.append("The causes are probable by the fitted rows, but do not lower the error of the others: "
                     "keep your robot file until a new measurement decides.")
    elif corrected:
        lines.append("Use `robot.toml` of this folder in place of your robot file"
                     + (f": `exactarm compensate` (programs) and `exactarm plan` (paths) with it make up for "
                        f"{in_words(corrected)}." if robot.has_geometry else
                        f"; it holds {in_words(corrected)}. To correct programs with them it needs the arm's "
                        "geometry too."))
    elif result.dropped and not found:
        lines.append("Keep your robot file: `robot.toml` of this folder is the same with its own parameters "
                     "estimated again, and holds nothing of what the fitted rows ask for.")
    elif result.verdict == NOTHING and robot.has_geometry:
        lines.append("Nothing need be added. `robot.toml` of this folder is your robot file with its own "
                     "parameters estimated again from these data.")
    if refuted and corrected:
        titles = [*dict.fromkeys(finding.effect.title for finding in refuted)]
        lines.append(f"It also holds {in_words(titles)}, less likely than not: take its `[[effects]]` out of "
                     "`robot.toml` unless new rows speak for it.")
    if wild := wild_elsewhere(result):
        lines.insert(0, "Look first at what the warning names: rows that were not fitted, and miss by far "
                        "more than the others.")
    elif result.verdict == NOTHING and (worse := worse_elsewhere(result)):
        lines.append(worse)
    if result.verdict in (NOTHING, EXPLAINED) and not result.noise.measured and not wild:
        lines.append(to_tell_noise(result))
    if found:
        lines.append(f"{kind_of(result.kind).anew} and run `exactarm evaluate robot.toml NEW.csv`: the error "
                     "there is the one to trust.")
    if result.next_experiment:
        lines.append(result.next_experiment)
    springs = any(joint.spring_linear for joint in robot.joints)
    loaded = result.kind == CLOSURES.name and robot.links is not None
    if result.verdict == UNEXPLAINED and loaded and not springs:
        lines.append("`exactarm calibrate` estimates springs beside the geometry; few touches hardly tell "
                     "which of them comes first: diagnose with the `robot.toml` that it writes.")
    if result.verdict == UNEXPLAINED and result.converged and not result.by_rival:
        lines.append(measure_more(result))
    if result.drafts:
        one = len(result.drafts) == 1
        number, it = ("an effect", "it") if one else (f"{len(result.drafts)} effects", "them")
        lines.append(f"`draft.toml` holds {number} for what is left. Check {it}, then `exactarm accept "
                     f"draft.toml` and diagnose again: every command knows {it} from then on.")
    return [Text(HEADING, tuple(lines))] if lines else []


def _undecided(result: Diagnosis) -> list[Table]:
    """The causes of which one is missing, each with its probability."""
    place = result.selection.open_place
    if place is None or not place.credible_set:
        return []
    effects = (place.effect, *(rival.effect for rival in place.rivals))
    titles = {(effect.name, effect.joint): effect.title for effect in effects}
    shares: dict[str, float] = {}
    for name, joint, probability in place.credible_set:
        title = titles.get((name, joint), "something that the library lacks")
        shares[title] = shares.get(title, 0.0) + probability
    ranked = sorted(shares.items(), key=lambda row: -row[1])
    rest = 1.0 - sum(shares.values())
    rows = tuple((title, percent(share)) for title, share in (*ranked, ("none of these", rest)))
    return [Table("Which cause is missing", ("cause", "probability"), rows,
                  "None of them is in `robot.toml`.")]


def _left_over(result: Diagnosis) -> list[Figure]:
    """The picture of what no known cause explains."""
    left = result.left_over
    if left is None:
        return []
    panel = partial(left_over_signal, left.x, left.residual, unit=left.unit, name=str(left.direction),
                    signal_name=str(left.signal), signal_unit=left.signal_unit)
    return [figure_of_panel(
        "left_over", "What is left, over what it follows", panel, 3.2,
        f"The error of the fitted {kind_of(result.kind).rows} as {left.direction}, over the "
        f"{left.signal}: of all signals the one that it follows most plainly.",
        f"points and their means in bins: the error as {left.direction} over the {left.signal}")]


def _drafts(result: Diagnosis) -> list:
    """What is left, as formulas: draft.toml in words."""
    if not result.drafts:
        return []
    unit = result.unit
    formula = lambda draft: draft.effect.form if draft.short else "a series of cosines"
    rows = tuple((draft.effect.title, f"{formula(draft)}, {draft.unit}", percent(draft.probability),
                  *(Quantity(value, unit) for value in draft.held_out)) for draft in result.drafts)
    header = ("drafted effect", "formula", "probability", "held-out RMS before", "with it")
    sentences = tuple(draft.sentence for draft in result.drafts)
    return [Text("Drafted effects: formulas for what is left", sentences),
            Table("Drafts", header, rows,
                  "In `draft.toml`; no part of `robot.toml` until they are accepted.")]


def _axes_table(result: Diagnosis) -> list[Table]:
    if not result.axes or len(result.axes) < 2:
        return []
    judged = "validation" if result.after["validation"].n else "identification"
    rows = tuple(
        (str(axis["joint"]), Quantity(axis["before"], result.unit), Quantity(axis["after"], result.unit),
         ", ".join(f.effect.title for f in result.findings if f.effect.joint in (None, axis["joint"])))
        for axis in result.axes)
    return [Table(f"RMS error by axis, {judged} rows", ("axis", "before", "after", "found on it"), rows)]


def _arm(result: Diagnosis) -> list[Figure]:
    space = result.in_space
    if space is None:
        return []
    return [Figure("arm", "Where in space",
                   partial(arm_with_errors, space.arm, space.position, space.before, space.after),
                   f"{space.which.capitalize()} poses in the robot's base frame; the arm stands at one of "
                   f"them.{_NOT_DRAWN if _outliers(result) else ''}",
                   "the arm with an arrow for the error of every pose, before and after", main=1)]


def _rivals(result: Diagnosis) -> Table:
    titles = {f.effect.label: f.effect.title for f in result.findings}
    judged = "validation" if result.after["validation"].n else "identification"
    reached = result.after[judged].rms
    rows = tuple(
        (a.effect.title, titles.get(a.instead_of, a.instead_of), Quantity(a.rms_after, result.unit),
         percent(a.probability), _why(a, reached))
        for a in {(a.effect.title, a.instead_of): a for a in reversed(result.alternatives)}.values()
    )[::-1]  # of two of one name the better
    header = ("runner-up", "instead of", f"{judged} RMS with it", "probability", "why it was not chosen")
    most = max(a.rms_after for a in result.alternatives)
    note = (f"With the causes found: {quantities([reached, most], result.unit)[0]}. Held-out rows choose "
            "nothing: the fitted rows decide.")
    return Table("Runners-up", header, rows, note if judged == "validation" else "")


def _why(rival, reached: float) -> str:
    if rival.collides:
        return "cannot be told apart by these data"
    if rival.rms_after > _LESS * reached:
        return f"leaves {100.0 * (rival.rms_after / reached - 1.0):.0f} % more error"
    less = 100.0 * (1.0 - rival.rms_after / reached)
    others = f"it leaves {less:.0f} % less error" if less >= 0.5 else "about as good"
    return f"less probable on the fitted rows, though {others} on the others"


def _dossier_table(heading: str, dossier: Dossier) -> Table:
    rows = tuple(
        (str(f.signal), str(f.direction), f"{100 * f.share:.1f} %",
         number(f.p_value, 2) if f.p_value > _NEVER else f"< {number(_NEVER, 1)}",
         "yes" if f.significant else "no")
        for f in dossier.follows[:8])
    note = (f"Share of the square sum explained by bins of the signal; p-values corrected for all tests. "
            f"Autocorrelation from row to row: {fixed(dossier.autocorrelation, 2)}.")
    return Table(heading, ("signal", "along", "share", "p-value", "beyond chance"), rows, note)


def _error_figures(result: Diagnosis, name: str, row: str) -> tuple:
    sets = list(result.errors_before)
    before = np.concatenate([result.errors_before[s] for s in sets])
    after = np.concatenate([result.errors_after[s] for s in sets])
    used = np.isfinite(before) & np.isfinite(after)
    identification = np.concatenate([np.full(len(result.errors_before[s]), s == "identification")
                                     for s in sets])
    order = f" The fitted {row}s stand first." if len(sets) > 1 else ""
    order += _NOT_DRAWN if _outliers(result) else ""
    part = "fit" if any(each.contradicted for each in result.dropped) else "fit or choice"
    return error_figures(before[used], after[used], identification[used], result.unit, name, row, order, part)
