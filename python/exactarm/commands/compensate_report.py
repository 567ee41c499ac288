"""What `compensate` hands back of its corrections: compensation.csv, result.json, the page."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from exactarm.commands.model_trust import trust_highlights, trust_json, trust_text
from exactarm.compensate.correction import Correction
from exactarm.compensate.frames import CellFrames
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Program
from exactarm.errors import line_name
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.report import Figure, Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import quantity, with_prefixes
from exactarm.report.plots.compensation import shift_per_target, shift_view
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot

OWN = ("No target moves: the model is the controller's own. Expected the robot file of a calibration or "
       "diagnosis.")
FINEST_M = 1e-9  # the law ends at a tenth of it; what is left is rounding, not a distance


def compensation_table(corrections: Sequence[Correction], radius: np.ndarray | None) -> dict:
    """Columns of compensation.csv: one row a target. radius: (T,) m, where the robot file tells it."""
    stack = lambda pick: np.concatenate([np.asarray(pick(c), float) for c in corrections])
    targets = [
        (c.program.files[target.file].path.name, target) for c in corrections for target in c.program.targets]
    turn, moved = stack(lambda c: c.q_after - c.q_before), stack(lambda c: c.moved)
    columns = {"file": [name for name, _ in targets],
               "line": [t.line for _, t in targets],
               "name": [t.name for _, t in targets]}
    columns |= {f"dq_{i + 1}_rad": turn[:, i] for i in range(turn.shape[1])}
    columns |= {f"d{axis}_mm": 1e3 * moved[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"dr{axis}_rad": moved[:, 3 + i] for i, axis in enumerate("xyz")}
    columns |= {} if radius is None else {"radius95_mm": 1e3 * radius}
    return columns | {"why": [why for c in corrections for why in c.why]}


def summary_of(corrections: Sequence[Correction], frames: CellFrames, model: CompensationModel,
               radius: np.ndarray | None) -> dict:
    """The command's keys of result.json."""
    return {"frames": {"choice": frames.choice, "base_shift_m": frames.base.position,
                       "flange_shift_m": frames.flange.position},
            "programs": [_program(correction) for correction in corrections],
            "correction": _sizes(corrections).to_json(),
            "as_written_max_m": _largest([c.reached for c in corrections]),
            "refused": [str(error) for c in corrections for error in c.refused],
            "effects": [effect.label for effect in model.layout.effects],
            "not_compensated": [effect.label for effect in model.left_out],
            "warnings": [*([OWN] if _own(_sizes(corrections)) else []),
                         *_warnings(corrections, frames, model, radius)]}


def _program(correction: Correction) -> dict:
    corrected = ~np.isnan(correction.q_after).any(axis=1)
    return {"files": [str(source.path) for source in correction.program.files],
            "dialect": correction.program.dialect,
            "targets": len(corrected),
            "corrected": int(corrected.sum()),
            "refused": len(correction.refused),
            "as_written_max_m": _largest([correction.reached]),
            "straight_motions": [{"target": correction.program.targets[bend.target].name,
                                  "line": bend.line,
                                  "off_line_m": bend.before,
                                  "points_in_between": bend.points,
                                  "off_line_after_m": bend.after}
                                 for bend in correction.bends]}


def _own(sizes: ErrorSummary) -> bool:
    """Whether targets were corrected and none of them moves."""
    return bool(sizes.n and sizes.max < FINEST_M)


def _sizes(corrections: Sequence[Correction]) -> ErrorSummary:
    sizes = np.concatenate([np.linalg.norm(c.shifts, axis=1) for c in corrections])
    return summarise(sizes[~np.isnan(sizes)])


def _largest(parts) -> float | None:
    values = np.concatenate([np.asarray(part, float) for part in parts])
    return None if np.isnan(values).all() else float(np.nanmax(values))


def _shown(length: float | None) -> float | None:
    """An upper bound that a reader can believe: FINEST_M at least."""
    return None if length is None else max(length, FINEST_M)


def _warnings(corrections: Sequence[Correction], frames: CellFrames, model: CompensationModel,
              radius: np.ndarray | None) -> list[str]:
    names = [correction.program.files[0].path.name for correction in corrections]
    found = [warning if len(names) == 1 or warning.startswith(name) else f"{name}: {warning}"
             for name, correction in zip(names, corrections) for warning in correction.warnings]
    found += frames.warnings
    sizes, known = _sizes(corrections), trust_json(radius)
    if known and sizes.n and not _own(sizes) and known["radius95_median_m"] > sizes.mean:
        found.append(f"the model itself is known to {quantity(known['radius95_median_m'], 'm')} (95 %), the "
                     f"corrections are {quantity(sizes.mean, 'm')} on average: the arm may end up no better; "
                     "`diagnose` looks for what is left")
    if model.left_out:
        left = ", ".join(effect.where_unknown for effect in model.left_out)
        found.append(f"in the robot file, but no program can compensate it: {left}")
    refused = sum(len(correction.refused) for correction in corrections)
    return found + (
        [f"{refused} {'target' if refused == 1 else 'targets'} could not be corrected, left as written: "
         "see the table"] if refused else [])


def report_of(robot: Robot, corrections: Sequence[Correction], frames: CellFrames, model: CompensationModel,
              radius: np.ndarray | None) -> Report:
    sizes = _sizes(corrections)
    moved = sizes.n and not _own(sizes)
    count = sum(len(correction.program.targets) for correction in corrections)
    written = _shown(_largest([correction.reached for correction in corrections]))
    if not sizes.n:
        verdict, tone = (f"None of the {count} targets was corrected: their numbers are as they were.",
                         "caution")
    elif not moved:
        verdict, tone = OWN, "caution"
    else:
        verdict = (f"{sizes.n} of {count} targets corrected, by {quantity(sizes.mean, 'm')} on average and "
                   f"{quantity(sizes.max, 'm')} at most; "
                   f"on the identified model the written numbers meet them within {quantity(written, 'm')}.")
        tone = "good" if sizes.n == count else "caution"
    sections = [Highlights((Highlight("mean correction", Quantity(sizes.mean if moved else None, "m")),
                            Highlight("largest correction", Quantity(sizes.max if moved else None, "m")),
                            Highlight("left over on the model, at most", Quantity(written, "m")),
                            *trust_highlights(radius))),
                Text("Base and flange", (frames.choice,)), _programs(corrections), *_figures(corrections),
                _bends(corrections), _largest_rows(corrections), _left(corrections),
                Text("What was compensated", (_effects(robot, model),)),
                trust_text(radius, "at the targets"),
                Warnings(tuple(_warnings(corrections, frames, model, radius)))]
    return Report(f"Compensation by {robot.name}", verdict, tuple(sections), tone)


def _programs(corrections: Sequence[Correction]) -> Table:
    rows = []
    for correction in corrections:
        one = _program(correction)
        names = ", ".join(source.path.name for source in correction.program.files)
        rows.append((names, one["dialect"], one["targets"], one["corrected"], one["refused"],
                     Quantity(_shown(one["as_written_max_m"]), "m")))
    return Table("Programs", ("file", "dialect", "targets", "corrected", "refused", "left over, at most"),
                 tuple(rows),
                 "Left over: the new file was read again, and the identified arm compared with the targets.")


def _figures(corrections: Sequence[Correction]) -> tuple[Figure, ...]:
    points, shifts = (
        np.concatenate([getattr(c, name) for c in corrections]) for name in ("positions", "shifts"))
    good = ~np.isnan(shifts).any(axis=1)
    if not good.any():
        return ()
    sizes = np.linalg.norm(shifts, axis=1)
    return (
        Figure(
            "correction_view", "What moved", partial(shift_view, points[good], shifts[good]),
            "Targets (of the flange) in the base frame of the controller; arrows: how their commands moved.",
            "targets with arrows of their corrections, from above and from the side"),
        figure_of_panel(
            "correction_per_target", "By how much", partial(shift_per_target, sizes), 2.8,
            "Change of the commanded position of each target, in the order of the programs; of many "
            "targets the smallest and the largest of each stretch.",
            "size of the correction of each target"))


def _line(program: Program, line: int) -> int | str:
    """As a column `line` has it: a table in memory has none."""
    path = program.files[0].path
    return line if isinstance(path, Path) else line_name(path, line)


def _largest_rows(corrections: Sequence[Correction], most: int = 12) -> Table:
    rows = [
        (float(np.linalg.norm(c.shifts[i])), c.program.files[target.file].path.name,
         _line(c.program, target.line), target.name, float(np.abs(c.q_after[i] - c.q_before[i]).max()))
        for c in corrections for i, target in enumerate(c.program.targets) if not np.isnan(c.shifts[i, 0])]
    rows.sort(key=lambda row: -row[0])
    cells = tuple((name, file, line, Quantity(size, "m"), Quantity(turn, "rad"))
                  for size, file, line, name, turn in rows[:most])
    return Table("Largest corrections", ("target", "file", "line", "moved", "largest turn of an axis"), cells,
                 "All of them are in compensation.csv.")


def _bends(corrections: Sequence[Correction], most: int = 12) -> Table:
    rows = [(bend, c.program) for c in corrections for bend in c.bends]
    rows.sort(key=lambda row: -row[0].before)
    cells = tuple(
        (program.targets[bend.target].name, program.files[0].path.name, _line(program, bend.line),
         Quantity(bend.before, "m"),
         bend.points, Quantity(bend.after, "m"))
        for bend, program in rows[:most])
    return Table(
        "Lines and paths",
        ("to", "file", "line", "off the line", "points in between", "off the line then"),
        cells,
        "Largest distance of the real tip from the straight line between corrected ends; in a time series of "
        "the real flange from the path between its points, where it is above the tolerance.")


def _left(corrections: Sequence[Correction], most: int = 20) -> Table:
    rows = [(target.name, c.program.files[target.file].path.name, _line(c.program, target.line), why)
            for c in corrections
            for target, why in zip(c.program.targets, c.why) if why]
    note = f"{len(rows) - most} more are in compensation.csv." if len(rows) > most else ""
    return Table("Left as they are", ("target", "file", "line", "why"), tuple(rows[:most]), note)


def _effects(robot: Robot, model: CompensationModel) -> str:
    parts = ["The identified geometry and joint offsets"]
    parts += (["gear tables by the direction of approach"]
              if any(joint.has_harmonics for joint in robot.joints) else [])
    parts += (["the declared joint springs under gravity"]
              if robot.links is not None and any(j.spring_linear for j in robot.joints) else [])
    parts += [effect.describe_on(robot) for effect in model.layout.effects]
    return with_prefixes("; ".join(parts)) + "."
