"""`exactarm diagnose`: closes the loop: residual, cause, new effect, error before and after."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_files, add_fixture, add_robot, add_sessions
from exactarm.commands.call import (
    AnyData,
    AnyFixture,
    AnyRobot,
    AnyTable,
    asked,
    command,
    data_of,
    files_among,
    robot_of,
    table_option,
    threads_of,
)
from exactarm.commands.design_for import experiment_json
from exactarm.commands.diagnose_report import report_of
from exactarm.commands.effect_sections import rows_left_out
from exactarm.commands.load_section import with_load_section, with_payload_section
from exactarm.commands.measure_more import wild_among_fitted, wild_elsewhere
from exactarm.commands.memory import within_memory
from exactarm.commands.outcome import recorded
from exactarm.commands.output import PICTURES, ROBOT_FILES
from exactarm.commands.result import CommandResult, estimate
from exactarm.commands.steps import CHECKING, READING, STEPS, step_of, steps_of_kinds
from exactarm.commands.suspicions import suspicions
from exactarm.data.kinds import MOTION, kind_of
from exactarm.data.split import DEFAULT_SEED
from exactarm.diagnose.diagnosis import Diagnosis, Finding
from exactarm.diagnose.diagnosis import diagnose as find_causes
from exactarm.diagnose.draft import Draft
from exactarm.diagnose.not_noise import probability_of as probability_not_noise
from exactarm.diagnose.posterior import Causes
from exactarm.diagnose.selected import UNKNOWN, Accepted
from exactarm.diagnose.signal import Quantity
from exactarm.diagnose.verdict import UNEXPLAINED, remains, stood_and_refuted
from exactarm.errors import InputError
from exactarm.identify.calibration_doubts import far_from_drawing
from exactarm.identify.session_payloads import session_payloads
from exactarm.identify.statistics import summarise
from exactarm.progress import SILENT, Progress
from exactarm.robot.writer import tables_text

NAME = "diagnose"
DRAFT_FILE = "draft.toml"
WRITES = (*ROBOT_FILES, *PICTURES, "residuals.csv", DRAFT_FILE)
HELP = "find what the model lacks: residual, cause, new effect, error before and after"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)
    add_fixture(parser)
    add_sessions(parser)


@command
def diagnose(robot: AnyRobot, data: AnyData, *, seed: int = DEFAULT_SEED, threads: int | None = None,
             kind: str | None = None, fixture: AnyFixture = None, sessions: AnyTable | None = None,
             progress: Progress = SILENT) -> CommandResult:
    """Finds what the model lacks: the effects behind the residual, their size, certainty, and error before
    and after.

        >>> import exactarm as ea
        >>> made = ea.simulate("ur10", count=40, counts=0, noise=1e-5)
        >>> ea.diagnose("ur10", made.data, threads=1)["verdict"]
        'no_undeclared_effect'
    """
    progress.plan(STEPS["diagnose"], long=True)
    progress.stage(READING)
    declared = known = robot_of(robot)
    sessions = table_option(sessions, "sessions")
    rows = data_of(data, declared, kind, fixture, sessions, weighs=(MOTION.name,))
    results: list[Diagnosis] = []
    skipped: list[str] = []
    warnings: list[str] = []
    kinds = (rows.kind,) if kind else rows.kinds
    progress.plan(steps_of_kinds(kinds), long=True)
    for each in kinds:
        tell = lambda text, name=each: progress.stage(step_of(text, name, kinds))
        tell(CHECKING)
        worked, told = within_memory("diagnose", each, rows, progress)
        try:
            with suspicions(known, replace(worked, kind=each, kinds=(each,))) as found:
                result = find_causes(known, replace(worked, kind=each), seed=seed,
                                     threads=threads_of(threads), progress=tell)
        except InputError as error:
            # The same file may hold more than this robot's tables can judge, as torques of an arm without
            # geometry.
            if not results:
                raise
            skipped.append(f"the file also holds {each.replace('_', ' ')} data, which was not diagnosed: "
                           f"{error}")
            continue
        doubts = (*result.problem.doubts(result.selection.fits[-1]), *far_from_drawing(known, result.robot))
        warnings += [line for line in (*told, *found, *doubts) if line not in warnings]
        # What the first kind of data has found is part of the model that the next kind judges.
        known = result.robot
        results.append(result)
    lines = (line for each in results for line in (
        _mounted_otherwise(each), _doubted(each), _objected(each), wild_elsewhere(each),
        wild_among_fitted(each)))
    warnings += dict.fromkeys(line for line in lines if line is not None)
    first = results[0]
    also: dict[str, Any] = {"also": [_json(other) for other in results[1:]]} if len(results) > 1 else {}
    also |= {"skipped": skipped} if skipped else {}
    call = asked("diagnose", robot, rows, seed, {"kind": kind, "fixture": fixture, "sessions": sessions})
    made = CommandResult(
        json={"robot_name": declared.name} | _json(first) | also,
        report=report_of(declared, results, rows.split_rule(), skipped),
        robot=recorded(known, call), tables={"residuals.csv": _residuals(first)},
        texts=_drafted([draft for result in results for draft in result.drafts]),
        inputs=files_among(fixture, sessions),
        asked=call).warned(warnings)
    last = first.selection.fits[-1]
    payloads = session_payloads(first.problem.data, last.layout, last.fit.interval())
    made = with_payload_section(made, payloads, "Estimated with what the model lacked.")
    return with_load_section(made, declared, rows)


def run(arguments: argparse.Namespace) -> CommandResult:
    return diagnose(arguments.robot, arguments.files, seed=arguments.seed, threads=arguments.threads,
                    kind=arguments.kind,
                    fixture=arguments.fixture, sessions=arguments.sessions, progress=arguments.progress)


def _mounted_otherwise(result: Diagnosis) -> str | None:
    """In words: what no spring explains follows a load of declared masses, as under another gravity; of poses
    there is a test (identify/springs_left.py). Torques are of that load themselves: what follows it there is
    a drive's gain as well."""
    follow = any(signal.quantity == Quantity.LOAD
                 for structure in result.unknown for signal in structure.signals)
    others = result.kind == MOTION.name or result.problem.by_posterior
    if not follow or others or result.problem.robot.links is None or result.problem.robot.generic_masses:
        return None
    return ("what no spring explains follows the load that the robot file's masses make: is the arm mounted "
            "as its file's gravity_m_s2 says?")


def _doubted(result: Diagnosis) -> str | None:
    """In words: what the robot file holds although it does not stand, and programs would be corrected by."""
    refuted = [finding.effect.title for finding in stood_and_refuted(result.findings)[1]
               if finding.effect.compensable]
    if not refuted:
        return None
    return (f"robot.toml holds {', '.join(dict.fromkeys(refuted))} although it is less likely than not: it "
            "tells what was measured here, elsewhere it may be wrong; do not correct programs by it")


def _objected(result: Diagnosis) -> str | None:
    """In words: what rows that were not fitted took out, and that their error has seen it."""
    titles = ", ".join(dict.fromkeys(each.effect.title for each in result.dropped if each.contradicted))
    if not titles:
        return None
    return (f"rows that were not fitted took {titles} out of the model: the error that they show has seen "
            "this choice; new ones judge without it (exactarm evaluate)")


def _json(result: Diagnosis) -> dict[str, Any]:
    effects = [_effect(finding, result) for finding in result.findings]
    if result.verdict == UNEXPLAINED:
        effects.append(_unknown(result))
    rows = {"identification": result.problem.data, "validation": result.problem.held_out}
    sets = lambda summaries, errors, fitted: {name: summary.to_json() | _per_axis(result, errors[name])
                                              | result.problem.also_judged(fitted, rows[name])
                                              for name, summary in summaries.items()}
    after = sets(result.after, result.errors_after, result.selection.fits[-1])
    if result.excluded:
        after["identification"]["excluded"] = result.excluded
        after["validation"]["excluded"] = len(result.excluded_elsewhere)
    axes = {} if result.axes is None else {"axes": result.axes}
    return {
        "data_kind": result.kind,
        "unit": result.unit,
        "noise_floor": result.noise.value,
        "noise_source": result.noise.source,
        "before": sets(result.before, result.errors_before, result.selection.fits[0]),
        "after": after,
        "effects": effects,
        "dropped": [each.to_json() for each in result.dropped],
        "alternatives": [{"effect": a.effect.name, "joint": a.effect.joint, "instead_of": a.instead_of,
                          "validation_rms_after": a.rms_after, "probability": a.probability,
                          "held_out_gain_nats": a.gain, "cannot_be_told_apart": a.collides}
                         for a in result.alternatives],
        "verdict": result.verdict,
        "sentence": result.sentence,
        "next_experiment": result.next_experiment or "",
        "experiments": [experiment_json(experiment) for experiment in result.experiments],
        "left_out": list(result.left_out),
        "held_out_gain_nats": result.held_out_gain,
        "converged": result.converged,
        "warnings": list(result.unconverged),
        "drafts": [draft.to_table() | {"file": DRAFT_FILE} for draft in result.drafts],
    } | axes | _posterior(result)


def _drafted(drafts: list[Draft]) -> dict[str, str]:
    """draft.toml, where anything was drafted."""
    if not drafts:
        return {}
    head = "# Effects that no library knows yet. Check each formula, change it by hand if need be, then:\n"
    head += f"#   exactarm accept {DRAFT_FILE}\n\n"
    entries = [(draft.effect.title, draft.to_table()) for draft in drafts]
    return {DRAFT_FILE: head + tables_text("[[effects]]", entries)}


def _per_axis(result: Diagnosis, errors: np.ndarray) -> dict[str, Any]:
    """A summary of each axis, in motions, where every sample holds a number for each."""
    if result.axes is None or result.kind != MOTION.name:
        return {}
    columns = errors.reshape(-1, len(result.axes)).T
    return {"axes": [{"joint": axis["joint"]} | summarise(column[np.isfinite(column)]).to_json()
                     for axis, column in zip(result.axes, columns)]}


def _effect(finding: Finding, result: Diagnosis) -> dict[str, Any]:
    effect = finding.effect
    parameters = {
        p.name: value if p.fixed and low == high else estimate(value, float(low), float(high))
        for p, value, (low, high) in zip(effect.parameters(), effect.values, finding.intervals)
        if not np.isnan(low)
    } | {name: estimate(*numbers) for name, numbers in finding.derived.items()}
    return {"effect": effect.name, "joint": effect.joint, "parameters": parameters,
            "validation_rms_before": finding.rms_before, "validation_rms_after": finding.rms_after,
            "probability": finding.probability, "evidence": finding.evidence,
            "compensable": effect.compensable} | _own(finding, result)


def _own(finding: Finding, result: Diagnosis) -> dict[str, Any]:
    """What the effect does by itself, and what could stand in its place."""
    found: dict[str, Any] = {"set": [{"effect": name, "joint": joint, "probability": p}
                                     for name, joint, p in finding.credible_set]}
    if finding.own_share is not None:
        found["own_share"] = finding.own_share
    moves = result.contribution_of(finding)
    at_tool = None if moves is None else moves.at_tool
    if (left := rows_left_out(result, finding)) is not None:
        at_tool = left.value
    if at_tool is not None:
        found["at_tool_um"] = 1e6 * at_tool
    return found


def _posterior(result: Diagnosis) -> dict[str, Any]:
    """Probabilities that nothing is missing, and that something else is."""
    causes = result.causes
    if causes is None:
        something = result.beyond.something if result.beyond else None
        without = min(map(_empty, result.findings), default=1.0)
        return {"probability_nothing": None if something is None else without * (1.0 - something),
                "probability_something_else": something, "false_alarm_rate": None, "self_test": None}
    return {"probability_nothing": causes.probability_nothing,
            "probability_something_else": causes.probability_something_else,
            "false_alarm_rate": causes.test.false_alarms,
            "self_test": {"sets": causes.test.sets, "share_right": causes.test.share_right,
                          "draws": causes.test.draws},
            "noise": _noise(causes)}


def _empty(finding: Finding) -> float:
    """Probability that nothing acts in the place of a finding: neither it nor another one of its set."""
    sure = sum(probability for *_, probability in finding.credible_set)
    own = next((p for name, joint, p in finding.credible_set
                if (name, joint) == (finding.effect.name, finding.effect.joint)), 0.0)
    return 1.0 - min(finding.probability * (sure / own if own > 0.0 else 1.0), 1.0)


def _noise(causes: Causes) -> dict[str, Any]:
    """The law of the noise, and what neighbouring rows share of it."""
    noise, wandering = causes.noise, causes.noise.wandering
    return {"family": noise.family,
            "degrees_of_freedom": noise.freedom if np.isfinite(noise.freedom) else None,
            "shared_by_neighbours": 0.0 if wandering is None else wandering.ratio / (1.0 + wandering.ratio),
            "memory_rows": None if wandering is None else wandering.memory}


def _unknown(result: Diagnosis) -> dict[str, Any]:
    place, causes = result.selection.open_place, result.causes
    rms = result.after["validation" if result.after["validation"].n else "identification"].rms
    told = (_another(result) if result.by_rival else
            _structure(result) if place is None or causes is None else _one_of_many(result, causes, place))
    return {"effect": UNKNOWN, "joint": None, "parameters": {}, "validation_rms_before": rms,
            "validation_rms_after": rms, "compensable": False} | told


def _structure(result: Diagnosis) -> dict[str, Any]:
    """What the last model leaves and nothing in the library explains."""
    left = result.dossier_after
    signal = left.strongest if left.structure else None
    share = (f" ({100 * signal.share:.0f} % of the remaining square sum, p = {signal.p_value:.1e})"
             if signal else "")
    probability = 1.0 - (signal.p_value if signal else 0.0)
    unknown, causes = result.unknown, result.causes
    if unknown and causes is not None:
        share = ""
        probability = (causes.probability_something_else if causes.unknown
                       else probability_not_noise(causes.noise))
    elif signal is None and causes is not None:
        probability = 1.0 - causes.probability_nothing
    if not unknown and signal is None and result.dropped:
        titles = ", ".join(dict.fromkeys(each.effect.title for each in result.dropped))
        return {"probability": probability,
                "evidence": f"the fitted rows ask for {titles}, which does not stand; the rest follows no "
                            "single signal beyond chance"}
    return {
        "probability": probability,
        "evidence": f"a structure that no candidate explains: {remains(left, result.excess, unknown)}{share}"}


def _one_of_many(result: Diagnosis, causes: Causes, place: Accepted) -> dict[str, Any]:
    """A place that several causes of the library may fill, and none is likelier than not; probability: that
    none of the library's does."""
    return {
        "probability": causes.probability_something_else,
        "evidence": "one of several causes that this data cannot tell apart: "
                    f"{result.selection.undecided}",
        "set": [{"effect": name, "joint": joint, "probability": p} for name, joint, p in place.credible_set]}


def _another(result: Diagnosis) -> dict[str, Any]:
    """Where rows that were not fitted speak for a rival of what was found; probability: that none of the
    library's is it."""
    return {"probability": _posterior(result)["probability_something_else"] or 0.0,
            "evidence": result.preferred.strip()}


def _residuals(result: Diagnosis) -> dict[str, Any]:
    """Every judged number of both sets, before and after; empty where a row was left out. Where it is one of
    a row, where that came from."""
    errors, problem = result.errors_before, result.problem
    rows = {"identification": problem.data, "validation": problem.held_out}
    told: dict[str, Any] = {}
    if kind_of(result.kind).at_rest and all(len(errors[name]) == len(rows[name]) for name in errors):
        files = [source.path for source in problem.data.sources] or [""]
        joined = lambda column: np.concatenate([getattr(rows[name], column) for name in errors])
        told = {"file": [files[i] for i in joined("file_index")], "row": joined("row"),
                "session": joined("session")}
    return told | {"set": [name for name in errors for _ in errors[name]],
                   "number": np.concatenate([np.arange(1, len(errors[name]) + 1) for name in errors]),
                   "error_before": np.concatenate([errors[name] for name in errors]),
                   "error_after": np.concatenate([result.errors_after[name] for name in errors])}
