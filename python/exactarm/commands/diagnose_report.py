"""The report of a diagnosis: verdict, before and after, what was found, what betrayed it, rivals, next experiment."""

from __future__ import annotations

from functools import partial

import numpy as np

from exactarm.commands.error_sections import error_figures, error_table, highlights, unit_of
from exactarm.diagnose.diagnosis import NOTHING, UNEXPLAINED, Diagnosis
from exactarm.diagnose.dossier import Dossier, indicator
from exactarm.diagnose.problem import Fitted
from exactarm.effects.base import Effect
from exactarm.report import Estimate, Figure, Quantity, Report, Table, Text, Warnings
from exactarm.report.plots.parameters import candidate_bars
from exactarm.report.plots.residual import residual_over_signal
from exactarm.robot import Robot

_MOST_SHOWN = 6  # parameters of one effect in the table; a curve has many more
_FIGURES = 3
_SIGNAL_UNITS = {"angle": "rad", "motor": "rad", "load": "Nm", "time": "s", "position": "m", "speed": "rad/s"}


def report_of(robot: Robot, results: list[Diagnosis], rule: str, skipped: list[str]) -> Report:
    """One report; further kinds of data follow the first; `skipped` says which could not be judged."""
    first = results[0]
    sections: list = []
    for result in results:
        if len(results) > 1:
            sections.append(Text(f"Data read as {result.kind.replace('_', ' ')}", (result.sentence,)))
        sections += _sections(result, rule)
    if skipped:
        sections.append(Warnings(tuple(skipped)))
    tone = {NOTHING: "good", UNEXPLAINED: "caution"}.get(first.verdict, "good")
    return Report(f"Diagnosis of {robot.name}", first.sentence, tuple(sections), tone)


def _sections(result: Diagnosis, rule: str) -> list:
    unit = result.unit
    name = "position error" if result.kind == "poses" else "error"
    row = "pose" if result.kind == "poses" else "sample"
    note = f"Before: the declared model with its own parameters re-identified. {rule}"
    sections: list = [
        highlights(result.before, result.after, unit),
        error_table(result.before, result.after, unit, name.capitalize(), note),
        *_axes_table(result),
        Table("Noise floor", ("", "", "from"), (("no model can do better than", Quantity(result.noise.value, unit),
                                                 result.noise.source),)),
    ]
    if result.findings:
        sections += [_effects_table(result), *_betraying_figures(result)]
    if result.alternatives:
        sections += _rivals(result)
    if result.next_experiment:
        sections.append(Text("Next experiment", (result.next_experiment,)))
    sections.append(_dossier_table("What the residual follows, before", result.dossier_before))
    sections.append(_dossier_table("What the residual still follows, after", result.dossier_after))
    sections += _error_figures(result, name, row)
    outliers = (f"{result.excluded} identification rows were left out as outliers",) if result.excluded else ()
    if outliers or result.left_out:
        sections.append(Warnings((*outliers, *result.left_out)))
    return sections


def _axes_table(result: Diagnosis) -> list[Table]:
    if not result.axes or len(result.axes) < 2:
        return []
    judged = "validation" if result.after["validation"].n else "identification"
    rows = tuple(
        (str(axis["joint"]), Quantity(axis["before"], result.unit), Quantity(axis["after"], result.unit),
         ", ".join(f.effect.title for f in result.findings if f.effect.joint in (None, axis["joint"])))
        for axis in result.axes
    )
    return [Table(f"RMS error by axis, {judged} rows", ("axis", "before", "after", "found on it"), rows)]


def _effects_table(result: Diagnosis) -> Table:
    rows = []
    for finding in result.findings:
        effect = finding.effect
        shown = list(zip(effect.parameters(), effect.values, finding.intervals))[:_MOST_SHOWN]
        for place, (parameter, value, (low, high)) in enumerate(shown):
            more = len(effect.values) - len(shown)
            head = (effect.title, _percent(finding.probability),
                    Quantity(finding.rms_before, result.unit), Quantity(finding.rms_after, result.unit))
            name = parameter.name + (f" (and {more} more)" if more and place == len(shown) - 1 else "")
            cell = Estimate(float(value), float(low), float(high), unit_of(parameter.name))
            rows.append((*(head if place == 0 else ("", "", None, None)), name, cell))
    header = ("effect", "probability", "RMS before", "after", "parameter", "estimate (95 %)")
    return Table("Effects found, in the order they were added", header, tuple(rows))


def _betraying_figures(result: Diagnosis) -> list[Figure]:
    """Residual without and with each of the first effects found, over the signal that it follows best."""
    figures, last = [], result.selection.fits[-1]
    declared = len(last.layout.effects) - len(result.findings)
    for index, finding in enumerate(result.findings[:_FIGURES]):
        without = last.without(declared + index)
        place = _betrayal(result, without, finding.effect)
        if place is not None:
            figures.append(_residual_figure(result, without, finding.effect, *place, len(figures) + 1))
    return figures


def _residual_figure(result: Diagnosis, without: Fitted, effect: Effect, signal: str, direction: str, number: int) -> Figure:
    values = result.problem.signals(without)[signal]
    before, after = (_along(result, fitted, direction) for fitted in (without, result.selection.fits[-1]))
    turn = direction.startswith("a turn")
    unit = "rad" if turn else result.unit
    name = f"residual as {direction}" if turn else f"residual, {direction}"
    return Figure(
        f"residual_{number}", f"What betrayed {effect.title}",
        partial(residual_over_signal, values, before, after, unit=unit, name=name, signal_name=signal,
                                     signal_unit=_SIGNAL_UNITS.get(signal.split()[0], "")),
        f"Residual of the identification rows as {direction}, over the {signal}, with all other effects in the model; "
        "before: without this one, after: with it.",
        f"{name} over {signal}, without and with the effect",
    )


def _along(result: Diagnosis, fitted, direction: str) -> np.ndarray:
    """(N,) the residual as a movement along the direction: least squares in each row."""
    pattern = result.problem.directions(result.selection.fits[0])[direction] / fitted.sigma
    size = np.maximum(np.sum(pattern**2, axis=1), 1e-12 * np.max(np.sum(pattern**2, axis=1)))
    return np.sum(pattern * fitted.residual / fitted.sigma, axis=1) / size


def _betrayal(result: Diagnosis, without: Fitted, effect: Effect) -> tuple[str, str] | None:
    """(signal, direction) in which the residual of the model without the effect shows it most clearly."""
    directions, signals = result.problem.directions(without), result.problem.signals(without)
    own = [name for name in directions if effect.joint is not None and name.endswith(f" {effect.joint}")]
    best, best_share = None, 0.0
    for direction in own or list(directions):
        residual = _along(result, without, direction)
        for signal, values in signals.items():
            bins = indicator(values)
            mean = bins @ ((bins.T @ residual) / np.maximum(bins.sum(axis=0), 1.0))
            share = float(np.var(mean) / max(np.var(residual), 1e-300))
            if share > best_share:
                best, best_share = (signal, direction), share
    return best


def _rivals(result: Diagnosis) -> list:
    titles = {f.effect.label: f.effect.title for f in result.findings}
    rows = tuple(
        (a.effect.title, titles[a.instead_of], Quantity(a.rms_after, result.unit),
         _percent(a.probability), "cannot be told apart here" if a.collides else "explains less")
        for a in result.alternatives
    )
    header = ("runner-up", "instead of", "validation RMS after", "probability", "why not")
    judged = "validation" if result.after["validation"].n else "identification"
    labels = [f.effect.title for f in result.findings] + [a.effect.title for a in result.alternatives]
    values = np.array([f.rms_after for f in result.findings] + [a.rms_after for a in result.alternatives])
    chosen = [True] * len(result.findings) + [False] * len(result.alternatives)
    bars = Figure(
        "candidates", "What each candidate would leave",
        partial(candidate_bars, labels, values, result.unit, before=result.before[judged].rms,
                               noise_floor=result.noise.value, chosen=chosen),
        "Effects that were added, one after another, and the runners-up in the place of one of them.",
        "bars of the remaining error by candidate",
    )
    return [Table("Runners-up, and why they lost", header, rows), bars]


def _percent(probability: float) -> str:
    return "below 0.01 %" if probability < 1e-4 else f"{100 * probability:.2f} %" if probability < 0.9999 else "above 99.99 %"


def _dossier_table(heading: str, dossier: Dossier) -> Table:
    rows = tuple(
        (f.signal, f.direction, f"{100 * f.share:.1f} %", f"{f.p_value:.1e}", "yes" if f.significant else "no")
        for f in dossier.follows[:8]
    )
    note = (f"Share of the square sum explained by bins of the signal; p-values corrected for all tests. "
            f"Autocorrelation from row to row: {dossier.autocorrelation:.2f}.")
    return Table(heading, ("signal", "along", "share", "p-value", "beyond chance"), rows, note)


def _error_figures(result: Diagnosis, name: str, row: str) -> tuple:
    sets = list(result.errors_before)
    before = np.concatenate([result.errors_before[s] for s in sets])
    after = np.concatenate([result.errors_after[s] for s in sets])
    used = np.isfinite(after)
    identification = np.concatenate([np.full(len(result.errors_before[s]), s == "identification") for s in sets])
    return error_figures(before[used], after[used], identification[used], result.unit, name, row)
