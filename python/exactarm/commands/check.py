"""`exactarm check`: a few poses a day: has something moved, which parameter, since when."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from exactarm.commands.arguments import add_map, add_robot
from exactarm.commands.calibrate import require_poses
from exactarm.commands.call import AnyData, AnyRobot, asked, command, data_of, listed, robot_of, table_option
from exactarm.commands.next_steps import after_check
from exactarm.commands.output import PICTURES
from exactarm.commands.result import CommandResult, estimate
from exactarm.commands.steps import DETECTING, READING, SERIES, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.data.rows import Source, by_name
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.units_in_names import unit_of
from exactarm.errors import InputError
from exactarm.files.memory_table import is_memory_table
from exactarm.progress import SILENT, Progress
from exactarm.report import Estimate, Figure, Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import quantity
from exactarm.report.plots.change import MOST, statistic_over_days
from exactarm.robot.robot import Robot
from exactarm.verify.change import Alarms, detect, detectable
from exactarm.verify.copied_rows import copied_lines
from exactarm.verify.daily import Daily, daily
from exactarm.verify.explanation import Cause, Explanation, explain

NOT_SEEN = 0.1  # rad, m: what moves so far is seen without a check
NAME = "check"
HELP = "a few poses a day: has something moved, which parameter, since when"
UNUSED_OPTIONS = ("threads",)
WRITES = (*PICTURES, "days.csv")
DAYS_A_YEAR = 250.0  # working days on which the poses are measured
FEW_DAYS = 5  # within which a change is to be seen, for the table of what the check can see
MOVES = (
    "base_...: translation and rotation vector of the move, about the old origin of the base and in its old "
    "axes; tool_...: move of the target in the axes of the flange.")
UNEXPLAINED = 0.01  # p-value below which no single one of the parameters explains the change


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument(
        "before", metavar="BEFORE", type=Path, help="the poses when all was well, on several days if possible"
    )
    parser.add_argument("files", metavar="NEW", nargs="+", type=Path,
                        help="the same poses later: a file a day, or a column `day`")
    parser.add_argument(
        "--days-per-year", metavar="N", type=float, default=DAYS_A_YEAR,
        help="days on which the poses are measured; one false alarm in so many days (default %(default)g)")
    add_map(parser, "columns")


@command
def check(robot: AnyRobot, before: AnyData, new: AnyData | Sequence[Any], *,
          days_per_year: float = DAYS_A_YEAR, columns: Mapping[str, str] | None = None,
          seed: int = DEFAULT_SEED, progress: Progress = SILENT) -> CommandResult:
    """Whether an arm has moved since `before`: a sequential test over days with one false alarm in
    `days_per_year` days.

    before, new: files or data of poses; each file of `new` is a day, unless it has a column `day` or a time
    over days. columns: the files' names of columns -> ours.
    """
    if not 1.0 < days_per_year <= 366.0:
        raise InputError(
            f"--days-per-year {days_per_year:g}; expected days of measurement in a year, more than 1 and at "
            f"most 366")
    progress.plan(STEPS["check"])
    progress.stage(READING)
    arm = robot_of(robot)
    poses = lambda each, which: require_poses(
        data_of(cast("AnyData", table_option(each, which)), arm, POSES.name, columns=columns))
    reference = poses(before, "before")
    files = listed(new)
    if not files:
        raise InputError("no data of later days; expected at least one file", file=reference.first_file)
    files = _in_order(files)
    days = [(_label(each, i), poses(each, f"new {i}")) for i, each in enumerate(files, start=1)]
    progress.stage(SERIES)
    _require_new(reference, days)
    with suspicions(arm, reference, *(data for _, data in days)) as suspected:
        series = daily(arm, reference, days, seed)
    progress.stage(DETECTING)
    change = detect(series.before, series.days, series.hypotheses, days_per_year)
    found = explain(series.before, series.days, series.hypotheses, change, series.displaced)
    options = {"days_per_year": days_per_year}
    told = asked("check", robot, None, seed, options, {"days_per_year": DAYS_A_YEAR})
    sources = tuple(source for data in (reference, *(data for _, data in days)) for source in data.sources)
    return CommandResult(
        json=_json(series, change, found, days_per_year),
        report=_report(arm, series, change, found, days_per_year),
        tables={"days.csv": _table(series, change)},
        asked=replace(told, line=_line(robot, before, files, days_per_year, columns, seed),
                      files=(*told.files, *sources)),
    ).warned((*suspected, *copied_lines(series.copied, found.sigma)))


def run(arguments: argparse.Namespace) -> CommandResult:
    return check(arguments.robot, arguments.before, arguments.files, days_per_year=arguments.days_per_year,
                 columns=dict(arguments.columns), seed=arguments.seed, progress=arguments.progress)


def _in_order(files: list[Any]) -> list[Any]:
    """As given; what stands in the order of letters (`day*.csv` of a shell) by the numbers in the names:
    day2 before day10."""
    if not all(isinstance(each, (str, Path)) for each in files):
        return files
    return sorted(files, key=by_name) if list(map(str, files)) == sorted(map(str, files)) else files


def _label(data: Any, number: int) -> str:
    return Path(data).stem if isinstance(data, (str, Path)) else f"day {number}"


def _line(robot: Any, before: Any, files: Sequence[Any], days_per_year: float,
          columns: Mapping[str, str] | None, seed: int) -> str:
    word = lambda value: (repr(str(value)) if isinstance(value, (str, Path)) else "data"
                          if isinstance(value, Dataset) or is_memory_table(value) else "robot")
    changed = f", days_per_year={days_per_year:g}" if days_per_year != DAYS_A_YEAR else ""
    changed += f", columns={dict(columns)!r}" if columns else ""
    new = ", ".join(map(word, files))
    return f"exactarm.check({word(robot)}, {word(before)}, [{new}]{changed}, seed={seed})"


def _require_new(before: Dataset, days: Sequence[tuple[str, Dataset]]) -> None:
    """Every row of a file once: a day that is counted twice would be evidence that nobody measured."""
    seen: list[tuple[Source, set[int]]] = []
    for data in (before, *(data for _, data in days)):
        own = [(source, set(data.row[data.file_index == k].tolist()))
               for k, source in enumerate(data.sources)]
        for source, rows in own:
            same = [known for known, met in seen if known.sha256 == source.sha256 and met & rows]
            if other := next(iter(same), None):
                raise InputError(
                    f"the same content as {other.path}; expected each file once", file=source.path)
        seen += own


# -- what it says ----------------------------------------------------------------------------------------
def _json(series: Daily, change: Alarms, found: Explanation, days_per_year: float) -> dict[str, Any]:
    best = found.causes[0]
    moved = change.alarm is not None
    return {"moved": moved,
            "verdict": _verdict_key(change, found),
            "alarm": series.labels[change.alarm] if change.alarm is not None else None,
            "since": _since(series, best) if moved else None,
            "causes": [_cause(cause, series) for cause in found.causes if moved and _named(cause, found)],
            "cannot_be_told_apart": [best.name, *found.apart] if moved and found.apart else [],
            "unexplained_p": found.unexplained if moved else None,
            "noise_m": found.sigma,
            "noise_degrees_of_freedom": found.freedom,
            "noise_source": series.noise,
            "boundary": change.boundary,
            "days_per_year": days_per_year,
            "days": [{"day": label, "statistic": float(value)}
                     for label, value in zip(series.labels, change.statistic, strict=True)],
            "check_poses": len(series.poses),
            "detectable": [{"parameter": name, "within_days": FEW_DAYS, "size": size}
                           for name, size in _detectable(series, change, found)],
            "warnings": _warnings(series, change)}


def _warnings(series: Daily, change: Alarms) -> list[str]:
    noisy = [
        f"{label}: {1.0 / np.sqrt(weight):.2g} times the scatter of BEFORE away from BEFORE and from every "
        "other day; it counts the less" for label, weight in zip(series.labels, change.weights, strict=True)
        if weight < 1.0]
    return [*series.warnings, *noisy]


def _verdict_key(change: Alarms, found: Explanation) -> str:
    if change.alarm is None:
        return "nothing_moved"
    return "moved_unexplained" if found.unexplained < UNEXPLAINED else "moved"


def _named(cause: Cause, found: Explanation) -> bool:
    return cause is found.causes[0] or cause.name in found.apart


def _since(series: Daily, cause: Cause) -> dict[str, Any]:
    first, last = cause.days
    return {"day": series.labels[cause.first_day], "ci95": [series.labels[first], series.labels[last]]}


def _cause(cause: Cause, series: Daily) -> dict[str, Any]:
    values = zip(cause.parameters, cause.estimate, cause.intervals, strict=True)
    return {"cause": cause.name,
            "probability": cause.probability,
            "since": _since(series, cause),
            "parameters": {
                name: estimate(float(value), float(low), float(high)) for name, value, (low, high) in values}}


def _detectable(series: Daily, change: Alarms, found: Explanation) -> list[tuple[str, float]]:
    """Size of each parameter's change (rad, m) that is seen within `FEW_DAYS` days on the mean."""
    return [(name,
             found.sigma
             * detectable(h, i, series.occasions, FEW_DAYS, change.boundary, len(series.hypotheses)))
            for h in series.hypotheses for i, name in enumerate(h.parameters)]


def _table(series: Daily, change: Alarms) -> dict[str, Any]:
    columns: dict[str, Any] = {"day": list(series.labels), "statistic": change.statistic}
    for k in range(len(series.poses)):
        columns |= {f"moved_{k + 1}_{axis}_m": series.moved[:, k, i] for i, axis in enumerate("xyz")}
    return columns


def _sentence(series: Daily, change: Alarms, found: Explanation, days_per_year: float) -> str:
    rate = f"at most one false alarm in {days_per_year:g} days"
    if change.alarm is None:
        days = f"{len(series.labels)} days tell" if len(series.labels) > 1 else "one day tells"
        return f"Nothing has moved, as far as {days} (the test allows {rate})."
    best = found.causes[0]
    since = _since(series, best)
    span = (since["day"] if since["ci95"][0] == since["ci95"][1]
            else f"{since['day']} (95 %: {since['ci95'][0]} to {since['ci95'][1]})")
    if found.unexplained < UNEXPLAINED:
        return (
            f"Something has moved since {span}, and no single one of the zeros, base or tool explains it; "
            f"nearest: {best.name}. Alarm on {series.labels[change.alarm]} ({rate}).")
    names = " or ".join([best.name, *found.apart])
    what = f"The {names}" + (" (these poses cannot tell them apart)" if found.apart else "")
    return f"{what} has moved since {span}{_size(best)}. Alarm on {series.labels[change.alarm]} ({rate})."


def _size(cause: Cause) -> str:
    if len(cause.parameters) == 1:
        low, high = cause.intervals[0]
        unit = unit_of(cause.parameters[0])
        size, least, most = (quantity(float(value), unit) for value in (cause.estimate[0], low, high))
        return f" by {size} ({least} to {most})"
    parts = [(slice(0, 3), "m"), (slice(3, 6), "rad")][: len(cause.parameters) // 3]
    seen = [part for part in parts if any(low > 0.0 or high < 0.0 for low, high in cause.intervals[part[0]])]
    sizes = [quantity(float(np.linalg.norm(cause.estimate[rows])), unit) for rows, unit in seen or parts]
    return f" by {' and '.join(sizes)}"


def _report(robot: Robot, series: Daily, change: Alarms, found: Explanation, days_per_year: float) -> Report:
    moved = change.alarm is not None
    best = found.causes[0]
    distance = np.linalg.norm(series.moved, axis=2)
    last = distance[-1][np.isfinite(distance[-1])]
    sections: list[Any] = [
        Warnings(tuple(_warnings(series, change))),
        Highlights((Highlight("last day, largest move of a pose",
                              Quantity(float(last.max()) if last.size else None, "m")),
                    Highlight("noise of a coordinate", Quantity(found.sigma, "m")),
                    Highlight(f"evidence of a change, cut at 1e12 (alarm at {change.boundary:g})",
                              Quantity(min(float(change.statistic[-1]), MOST), ""))))]
    if moved:
        last = len(series.labels) - 1
        base = "base" in (best.name, *found.apart)
        sections.append(after_check(found.unexplained < UNEXPLAINED, base, change.alarm == last))
        rows = [(cause.name, name, Estimate(float(value), float(low), float(high), unit_of(name)),
                 f"{cause.probability:.3f}", series.labels[cause.first_day])
                for cause in found.causes if _named(cause, found)
                for name, value, (low, high) in zip(
                    cause.parameters, cause.estimate, cause.intervals, strict=True)]
        sections.append(
            Table("What has moved",
                  ("cause", "parameter", "change (95 %)", "probability", "since"),
                  tuple(rows),
                  MOVES + (" Causes that explain the days equally well stand below each other." if found.apart
                           else "")))
    since = best.days if moved else None
    sections += [
        Figure(
            "days", "Day by day",
            partial(statistic_over_days, change.statistic, change.boundary, distance,
                    float(np.sqrt(3.0)) * found.sigma, change.alarm, since),
            "Above: the evidence that something has changed on this or an earlier day, with the boundary of "
            "the alarm. Below: how far each pose lies from where BEFORE had it, and the noise of a day.",
            "statistic and moves of the poses by day"),
        Table("What this check can see", ("parameter", f"seen within {FEW_DAYS} days"),
              tuple((name, Quantity(size, unit_of(name)) if size < NOT_SEEN else "not by these poses")
                    for name, size in _detectable(series, change, found)),
              "A change of this size raises the alarm within so many days, with noise at its mean."),
        Text("How it is tested",
             (f"{len(series.poses)} poses, {len(series.labels)} "
              f"{'day' if len(series.labels) == 1 else 'days'}. Noise from {series.noise}. The statistic is "
              "a sum of likelihood ratios over all first days and causes; while nothing moves it grows by "
              f"one a day on the mean, so that it passes {change.boundary:g} once in {days_per_year:g} days "
              "at the most.",))]
    return Report(f"Check of {robot.name}", _sentence(series, change, found, days_per_year), tuple(sections),
                  "bad" if moved else "good")
