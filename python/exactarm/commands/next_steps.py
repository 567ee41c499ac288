"""What to do next: after a fit and a diagnosis with the page's numbers, and for every command with a line to
copy, which reads the files that the run has written.

A paragraph that is one `command` alone is such a line; it stands on a line of its own, as long as it is.
"""

import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from exactarm.commands.outcome import Asked, Outcome
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, kind_of
from exactarm.data.kinds.base import Device, Kind
from exactarm.files.examples import EXAMPLES
from exactarm.report import Highlights, Report, Text, Warnings
from exactarm.robot.robot import Robot
from exactarm.robot_file import shipped_robots

HEADING = "What to do next"
ENOUGH_FALL = 0.9  # of the error before: less is no success worth a new robot file
DAILY_POSES = 16  # `design` takes no fewer for seven axes: 4 numbers each, 9 of the frames, 3 a pose
_FITTED_BY = {Device.GEAR: "gear", Device.DRIVES: "identify"}  # else calibrate
_LOADED = {  # format of an export -> where the file goes
    "ur_description": "Give it to the driver as `kinematics_params_file`.",
    "mjcf": "MuJoCo opens it: `python -m mujoco.viewer --mjcf=robot.xml`.",
    "csv": "Its columns are those of the robot file: DH parameters, offsets, ratios.",
    "offsets": "Type the offsets into the controller's mastering, or into a program, not into both.",
    "robodk": "Run it in RoboDK's own Python, with the station open.",
    "urdf": "Any program that reads URDF takes it.",
}


# Masses of a drawing are wrong by per cents, and a diagnosis would find them first; few touches tell springs
# beside the geometry, and hardly which of them comes first.
_FROM_WHAT_WAS_FITTED = (MOTION, CLOSURES)


def to_improve(kind: Kind) -> Text:
    """After a judgement."""
    fit = _FITTED_BY.get(kind.device, "calibrate")
    return Text(HEADING, (
        f"If this is more than your work allows, run `exactarm {fit}` and `exactarm diagnose` with other "
        f"{kind.rows}; keep these to judge by.",))


def next_steps(robot: Robot, kind: Kind, before: float, after: float, worse: bool = False,
               doubted: bool = False) -> Text:
    """before, after: errors of the rows that judge; worse: a warning says that the model is, all the same;
    doubted: one says that no arm is like that, or no fixture."""
    lines = []
    if doubted:
        lines.append("Look first at what the warnings name: no arm, or no fixture, is like that. Until it is "
                     "explained `robot.toml` of this folder is not to be used.")
    elif worse:
        lines.append("Look at the largest errors before `robot.toml` of this folder is used: are these rows "
                     "right, and is the arm measured well around them?")
    elif after < ENOUGH_FALL * before:
        lines.append("Use `robot.toml` of this folder in place of your robot file"
                     + (": `exactarm compensate` (programs) and `exactarm plan` (paths) calculate with it."
                        if robot.has_geometry else "."))
        lines.append(f"{kind.anew} and run `exactarm evaluate robot.toml NEW.csv`: the error there is the "
                     "one to trust.")
    else:
        lines.append("Keep your robot file: what was estimated hardly lowers the error.")
    model = "this `robot.toml` and the same" if kind in _FROM_WHAT_WAS_FITTED else "the same robot and"
    lines.append(f"`exactarm diagnose` with {model} files looks for the causes of what is left.")
    return Text(HEADING, tuple(lines))


def after_check(unexplained: bool, base: bool = False, one_day: bool = False) -> Text:
    """After an alarm: these few poses detect, they do not calibrate. base: it may be the base; one_day: only
    the last day tells of it."""
    again = (
        "One day alone tells of it: measure the poses once more before anything else. A day of larger noise "
        "looks alike.",) if one_day else ()
    if unexplained:
        return Text(HEADING, (
            *again,
            "Measure some fifty poses and run `exactarm diagnose`: it tells what these few poses cannot. "
            "Until then the robot file is not to be trusted."))
    anew = (
        "If the instrument was set up anew, give the files of these days a column `session` with a number "
        "that BEFORE does not have.",) if base else ()
    return Text(HEADING, (
        *again, *anew,
        "See what happened: a collision, a belt that slipped or new mastering moves a zero; a push moves the "
        "base or the instrument; mounting the target anew moves the tool.",
        "If it is the arm, measure some fifty poses and `exactarm calibrate` anew. Then measure BEFORE "
        "again: all later days are compared with it."))


# -- lines to copy -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Run:
    """What a run has read and written, as words of a command line."""

    result: Outcome
    asked: Asked
    folder: Path

    @property
    def robot(self) -> str:
        """As it was named, or ROBOT where only a value in Python is known."""
        name = self.asked.robot or ""
        named = self.asked.line.startswith("exactarm ") or f"({name!r}" in self.asked.line
        known = name in shipped_robots() or os.path.isfile(name.partition("#")[0])
        return name if named and known else "ROBOT"

    @property
    def data(self) -> list[str]:
        """FILES that were read, with the options that say how."""
        read = [source.path for source in self.asked.files
                if source.rows is not None and source.path != str(self.asked.robot)]
        files = [path for path in read if path not in map(str, self.result.inputs)] or read[:1]
        return [*(_named(Path(file)) for file in files), *self.asked.reading]

    def written(self, name: str) -> str:
        return str(self.folder / name)

    def line(self, what: str, command: str, *words: str) -> str:
        """`what` names the folder of the next run, beside this one."""
        named = self.folder.name not in ("", "..")
        out = self.folder.with_name(f"{self.folder.name}_{what}") if named else self.folder / what
        return f"`{shlex.join(['exactarm', command, *words, '--out', str(out)])}`"


def _named(path: Path) -> str:
    """A shipped file by its short name."""
    inside = path.is_absolute() and path.is_relative_to(EXAMPLES)
    return path.relative_to(EXAMPLES).with_suffix("").as_posix() if inside else str(path)


def _plan(run: _Run) -> Sequence[str]:
    return (
        "Play it on a virtual robot before the real one drives it:",
        run.line("played", "simulate", run.robot, run.written(next(iter(run.result.tables)))),
        *(() if run.result.texts else ("The real one takes the joint angles in the words of its controller: "
                                       "`exactarm plan` with `--send`.",)))


def _simulate(run: _Run) -> Sequence[str]:
    if "compare.csv" in run.result.tables:
        from exactarm.plan.path_file import shipped_paths  # with it comes the whole planner

        path = run.result.json["path"]["name"]
        line = run.line("planned", "plan", run.robot, path)
        return ("Plan the same path for the real arm:", line) if path in shipped_paths() else ()
    kind = kind_of(run.result.data.kind)
    command = "diagnose" if "tracked.csv" in run.result.tables else _FITTED_BY.get(kind.device, "calibrate")
    fixture = ["--fixture", run.written("fixture.toml")] if "fixture.toml" in run.result.texts else []
    return ("The rows are read as measured ones are. To see what a method finds of the truth:",
            run.line(command, command, run.robot, run.written(next(iter(run.result.tables))), *fixture))


def _design(run: _Run) -> Sequence[str]:
    if "experiments" in run.result.json:  # of what a diagnosis has left open
        return ("Drive to the poses of `poses.csv`, write what the tracker shows beside the angles, and run "
                f"`exactarm diagnose {run.robot} FIRST.csv MEASURED.csv --out DIR`, with the first file as "
                "below.",)
    if "deviation_m" in run.result.json:  # without a tracker
        given = ["fixture.toml"] if "fixture.toml" in run.result.texts else map(str, run.result.inputs)
        fixture = "".join(f" --fixture {shlex.quote(each)}" for each in given)
        return ("Drive to the poses of `poses.csv`, write what is touched or read there beside the joint "
                f"angles, and run `exactarm calibrate {run.robot} TOUCHED.csv{fixture} --out DIR`.",)
    return (
        "Rehearse the measurement on a virtual robot:",
        run.line("rehearsed", "simulate", run.robot, run.written("poses.csv"), "--measure",
                 POSES.measured_as),
        "Then drive to the poses of `poses.csv`, write what the tracker shows into columns `x_mm`, `y_mm`, "
        f"`z_mm` beside the angles, and run `exactarm calibrate {run.robot} MEASURED.csv --out DIR`.")


def _identifiable(run: _Run) -> Sequence[str]:
    if "--fixture" in run.asked.reading:
        return ()
    return ("Poses that show the parameters best, to be measured:", run.line("designed", "design", run.robot))


def _certify(run: _Run) -> Sequence[str]:
    return ("Keep the certificate with the arm. A few poses a day tell when it no longer holds "
            "(`exactarm check`; five are enough). Poses that show every parameter:",
            run.line("daily", "design", run.robot, "--count", str(DAILY_POSES), "--validation", "0"))


def _compensate(run: _Run) -> Sequence[str]:
    read = {Path(source.path).name: source.path for source in run.asked.files}
    name = next((name for name in run.result.contents if name in read and not name.endswith(".parquet")), "")
    changed = shlex.join(["diff", read[name], run.written(name)]) if name else ""
    return (
        *(["See what has changed; only numbers have:", f"`{changed}`"] if name else []),
        "Drive the corrected program slowly at first: clearances were not checked. Then measure some of its "
        f"poses and run `exactarm evaluate {run.robot} NEW.csv`.")


def _check(run: _Run) -> Sequence[str]:
    if run.result.json["moved"]:
        return ("Fifty poses to measure:", run.line("designed", "design", run.robot))
    words = [run.robot, *run.data, "NEXT.csv"]
    return ("Measure the same poses on the next day, and give all days again with the new one behind them:",
            run.line("next", "check", *words))


def _evaluate(run: _Run) -> Sequence[str]:
    return ("To see its causes in these rows, which then no longer judge:",
            run.line("diagnosed", "diagnose", run.robot, *run.data))


def _fitted(run: _Run) -> Sequence[str]:
    kind = {"gear": GEAR_RUN, "identify": MOTION}.get(run.asked.command)  # a file may hold two kinds
    fitted = kind_of(run.result.json["data_kind"]) if "data_kind" in run.result.json else kind
    read = run.data if kind is None or "--kind" in run.data else [*run.data, "--kind", kind.name]
    robot = run.written("robot.toml") if fitted in _FROM_WHAT_WAS_FITTED else run.robot
    return (run.line("diagnosed", "diagnose", robot, *read),)


def _table(run: _Run) -> Sequence[str]:
    return ("Calibrate with the table:",
            run.line("calibrated", "calibrate", run.robot, run.written(next(iter(run.result.tables)))))


def _corners(run: _Run) -> Sequence[str]:
    return ("Calibrate with them:",
            run.line("calibrated", "calibrate", run.robot, run.written(next(iter(run.result.tables))),
                     *run.asked.reading))


def _accept(run: _Run) -> Sequence[str]:
    return ("Run `exactarm diagnose` with the same robot and files again: it chooses among the effects of"
            " your library as among its own. `exactarm accept` writes no robot file.",)


def _export(run: _Run) -> Sequence[str]:
    format = run.result.json["format"]
    if format != "urdf":
        return (_LOADED[format],)
    return (_LOADED[format], "To see what a program reads in it, written as a table:",
            run.line("read", "export", run.written(run.result.json["file"]), "--format", "csv"))


NEXT: dict[str, Callable[[_Run], Sequence[str]]] = {
    "calibrate": _fitted, "gear": _fitted, "identify": _fitted, "evaluate": _evaluate, "check": _check,
    "plan": _plan, "simulate": _simulate, "design": _design, "certify": _certify, "compensate": _compensate,
    "export": _export, "merge": _table, "corners": _corners, "accept": _accept,
    "identifiable": _identifiable,
}


def with_lines(report: Report, result: Outcome, asked: Asked, folder: Path) -> Report:
    """The report with the lines to copy after what it says itself, or behind the numbers that matter most."""
    make = NEXT.get(asked.command)
    lines = tuple(make(_Run(result, asked, folder))) if make else ()
    if not lines:
        return report
    sections = list(report.sections)
    own = next((k for k, each in enumerate(sections) if getattr(each, "heading", "") == HEADING), None)
    if own is not None and isinstance(said := sections[own], Text):
        sections[own] = replace(said, paragraphs=(*said.paragraphs, *lines))
        return replace(report, sections=tuple(sections))
    first = next((k for k, each in enumerate(sections) if not isinstance(each, (Highlights, Warnings))),
                 len(sections))
    sections.insert(first, Text(HEADING, lines))
    return replace(report, sections=tuple(sections))
