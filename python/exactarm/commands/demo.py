"""`exactarm demo`: every command once, on the shipped measured data and on virtual robots."""

import argparse
import re
import time
from dataclasses import dataclass, replace
from typing import Any

from exactarm.commands.demo_steps import STEPS, Step
from exactarm.commands.execute import execute, parse
from exactarm.commands.listing import import_command
from exactarm.commands.output import PICTURES
from exactarm.commands.publish import Published
from exactarm.commands.result import CommandResult
from exactarm.errors import ComputationError, InputError
from exactarm.files.examples import data_path
from exactarm.report import Highlight, Highlights, Link, Quantity, Report, Section, Table, Text, Warnings
from exactarm.report.numbers import quantities

NAME = "demo"
HELP = "all of it, on shipped real and simulated data"
WRITES = PICTURES
REFERENCE = re.compile(r"\{(example|out)/([^}]+)\}")


@dataclass(frozen=True)
class Outcome:
    """How a step ended: what it published, or why it failed."""

    step: Step
    seconds: float
    published: Published | None
    failure: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--steps", metavar="NAMES", default="", help="only these, as a,b (default: all): "
                        + ", ".join(step.folder for step in STEPS))


def run(arguments: argparse.Namespace) -> CommandResult:
    outcomes = []
    for number, step in enumerate(chosen := _chosen(arguments.steps), start=1):
        arguments.progress.part(f"step {number} of {len(chosen)}, {step.folder}")
        outcomes.append(_run_step(step, arguments))
    arguments.progress.part("")
    failed = [outcome for outcome in outcomes if outcome.failure]
    return CommandResult(json={"steps": [_json(outcome) for outcome in outcomes]},
                         report=_report(outcomes, failed), exit_code=1 if failed else 0)


def _chosen(names: str) -> tuple[Step, ...]:
    if not names:
        return STEPS
    wanted, known = names.split(","), {step.folder: step for step in STEPS}
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise InputError(f"--steps: no step {unknown[0]!r}, expected some of {', '.join(known)}")
    return tuple(known[name] for name in wanted)


def _run_step(step: Step, arguments: argparse.Namespace) -> Outcome:
    """One step in its own folder. A failed one does not end the others."""
    def place(match: re.Match) -> str:
        return str(data_path(match[2]) if match[1] == "example" else arguments.out / match[2])

    words = [REFERENCE.sub(place, word) for word in step.words[1:]]
    words += ["--out", str(arguments.out / step.folder), "--seed", str(arguments.seed), "--threads",
              str(arguments.threads)]
    started = time.perf_counter()
    module = import_command(step.words[0])
    try:
        published = execute(module, parse(module, words), arguments.progress)
    except (InputError, ComputationError) as error:
        return Outcome(step, time.perf_counter() - started, None, str(error))
    except Exception as error:  # a fault of one command is told, and the others still run
        if arguments.debug:
            raise
        return Outcome(step, time.perf_counter() - started, None,
                       f"unexpected {type(error).__name__}: {error}")
    return Outcome(step, time.perf_counter() - started, published)


def _json(outcome: Outcome) -> dict[str, Any]:
    entry: dict[str, Any] = {"step": outcome.step.folder, "command": outcome.step.words[0],
                             "real_data": outcome.step.real,
                             "seconds": round(outcome.seconds, 3)}
    if outcome.published is None:
        return entry | {"failure": outcome.failure}
    before, after, unit = _errors(outcome.published.json)
    return entry | {"verdict": outcome.published.report.verdict,
                    "validation_mean_before": before, "validation_mean_after": after, "unit": unit}


def _errors(result: dict[str, Any]) -> tuple[float | None, float | None, str]:
    """Mean error on rows never fitted, before and after, and its unit, where the command has them."""
    def mean(key: str) -> float | None:
        sets = result.get(key)
        return sets["validation"]["mean"] if isinstance(sets, dict) and "validation" in sets else None

    unit = result.get("unit") or ("m" if mean("after") is not None else "")
    if isinstance(result.get("error"), dict):
        return None, result["error"].get("mean"), unit or "m"
    if "rounds" in result:  # of `loop`: as drawn, and at the end
        return result["rounds"][0]["tracking"]["mean"], result["rounds"][-1]["tracking"]["mean"], "m"
    if "deviation" in result:  # of `simulate --compare`, between the knots: the geometry alone, the plan
        by = {each["method"]: each["between"]["mean"] for each in reversed(result["tracking"])}
        return by["identified"], by["exactarm"], "m"
    return mean("before"), mean("after"), unit


def _report(outcomes: list[Outcome], failed: list[Outcome]) -> Report:
    done = len(outcomes) - len(failed)
    found = [(outcome, _errors(outcome.published.json)) for outcome in outcomes if outcome.published]
    rows, headlines, left = [], [], []
    for outcome, (before, after, unit) in found:
        rows.append((outcome.step.title, "measured" if outcome.step.real else "simulated",
                     *quantities([before, after], unit), Quantity(outcome.seconds, "s"),
                     Link(f"{outcome.step.folder}/report.html", "report")))
        if outcome.step.headline and before and after:
            headlines.append(Highlight(outcome.step.headline, Quantity(after, unit), Quantity(before, unit)))
            left += [100.0 * after / before] if outcome.step.real else []
    rows += [(outcome.step.title, "failed", "", "", Quantity(outcome.seconds, "s"), "") for outcome in failed]
    verdict = ("On real robots the mean error of measurements that were never fitted is now "
               f"{min(left):.0f} to {max(left):.0f} % of what it was. " if len(left) > 1 else "")
    verdict += f"{done} of {len(outcomes)} steps done" + (
        f"; {len(failed)} failed, see the warnings." if failed else ".")
    sections: list[Section] = [Highlights(tuple(headlines))] if headlines else []
    for outcome, _ in found:
        if outcome.step.picture:
            sections.append(Text(outcome.step.title, (outcome.published.report.verdict,)))
            sections += _picture(outcome)
    sections.append(Table(
        "All steps", ("step", "data", "mean error before", "after", "time", "report"),
        tuple(rows), "Errors are means over rows that were never fitted; of a plan, of the flange along the "
        "path: by inverse kinematics of the identified geometry, and by the plan."))
    sections.append(Warnings(tuple(f"{outcome.step.folder}: {outcome.failure}" for outcome in failed)))
    return Report("exactarm on shipped data", verdict, tuple(sections), "caution" if failed else "good")


def _picture(outcome: Outcome) -> list[Section]:
    """The figure of the step's own report that tells most; none where the report has not drawn it."""
    figures = (
        {figure.name: figure for figure in outcome.published.report.figures} if outcome.published else {})
    chosen = figures.get(outcome.step.picture)
    if chosen is None:
        return []
    return [replace(chosen, name=f"{outcome.step.folder}_{chosen.name}", heading="")]
