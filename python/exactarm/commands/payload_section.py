"""Payloads of sessions that nobody weighed, in a result: `payloads` of result.json, a table, payloads.csv."""

from __future__ import annotations

from dataclasses import replace

from exactarm.commands.result import CommandResult, estimate
from exactarm.identify.session_payloads import EstimatedPayload, payload_columns
from exactarm.report import Estimate, Quantity, Table


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
