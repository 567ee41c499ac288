"""What a result says of its loads: `load` in result.json, a line of the report, a warning of guessed ones."""

from __future__ import annotations

from dataclasses import replace

from exactarm.commands.result import CommandResult
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.identify.loads import guess_line, load_json, load_lines, with_loads
from exactarm.report import Text
from exactarm.robot.robot import Robot


def with_load_section(result: CommandResult, robot: Robot, data: Dataset) -> CommandResult:
    """The result with the loads of `robot` as declared on `data`."""
    if not kind_of(data.kind).shows_generic_loads:
        return result
    loaded = with_loads(robot, data)
    lines = load_lines(loaded, data)
    report = result.report
    if lines:
        report = replace(report, sections=(*report.sections, Text("Load", lines)))
    result = replace(result, json=dict(result.json) | {"load": load_json(loaded, data)}, report=report)
    effects = robot.effects if result.robot is None else result.robot.effects
    guess = guess_line(loaded, data)
    return result.warned([guess]) if guess and any(effect.by_load for effect in effects) else result
