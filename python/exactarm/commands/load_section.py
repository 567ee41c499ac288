"""What a result says of its loads: `load` in result.json, a line of the report, a warning of guessed ones;
and of payloads that nobody weighed: `payloads` of result.json, a table, payloads.csv."""

from dataclasses import replace

from exactarm.commands.result import CommandResult, estimate
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.identify.loads import guess_line, load_json, load_lines, with_loads
from exactarm.identify.session_payloads import EstimatedPayload, payload_columns
from exactarm.report import Estimate, Quantity, Table, Text
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


def with_payload_section(result: CommandResult, payloads: tuple[EstimatedPayload, ...],
                         note: str) -> CommandResult:
    """The result with the payload of each session; as it is where none was estimated."""
    if not payloads:
        return result
    rows = tuple(
        (str(p.session), Estimate(p.mass, *p.interval, "kg") if p.estimated else Quantity(p.mass, "kg"),
         ", ".join(f"{1e3 * float(x):.0f}" for x in p.centre), "estimated" if p.estimated else "as given")
        for p in payloads)
    table = Table("Payload of each session", ("session", "mass (95 %)", "centre in the flange frame, mm", ""),
                  rows, f"{note} payloads.csv is a table for --sessions with these masses.")
    values = [{"session": p.session, "mass_kg": estimate(p.mass, *p.interval), "centre_m": p.centre.tolist(),
               "estimated": p.estimated} for p in payloads]
    return replace(result, json=dict(result.json) | {"payloads": values},
                   report=replace(result.report, sections=(*result.report.sections, table)),
                   tables=dict(result.tables) | {"payloads.csv": payload_columns(payloads)})
