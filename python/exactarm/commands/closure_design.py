"""What `exactarm design --contact socket` says: where to put a fixture of two seats, and the poses that touch
them; and for a gravity sensor the poses to read it in."""

from __future__ import annotations

import numpy as np

from exactarm.commands.design_for import pose_columns
from exactarm.commands.result import CommandResult
from exactarm.identify.closure_design import ClosureDesign, ClosureDesignOptions, design_closures
from exactarm.identify.gravity_design import SIGMA_RAD, GravityDesign, design_gravity
from exactarm.report import Quantity, Report, Table, Text
from exactarm.report.numbers import quantity
from exactarm.robot import Robot


def designed_closures(robot: Robot, options: ClosureDesignOptions) -> CommandResult:
    """The design as a command's result: `poses.csv` with session and socket, and the fixture file for its
    distance."""
    found = design_closures(robot, options)
    columns = {"session": found.session, "socket": found.socket}
    reported = robot.controller.reported(found.q)
    for i, joint in enumerate(robot.joints):
        columns[f"q_{i + 1}_{'m' if joint.type == 'prismatic' else 'rad'}"] = np.round(reported[:, i], 9)
    alone, random, chosen = found.deviation
    fixture = f'[[distances]]\ncontact = "socket"\nbetween = [0, 1]\nlength_mm = {1e3 * options.apart:g}\n'
    return CommandResult(
        json=_expected(found) | {"seats": [{"session": s, "socket": k, "position_m": seat.tolist()}
                                           for (s, k), seat in found.seats.items()]},
        report=_report(robot, options, found),
        tables={"poses.csv": columns},
        texts={"fixture.toml": fixture},
    )


def _expected(found: ClosureDesign | GravityDesign) -> dict:
    """What every design of closures says in result.json."""
    return {
        "deviation_m": dict(zip(("drawing", "random_poses", "design"), found.deviation)),
        "poses": len(found.q),
        "identifiable": found.identifiability.identifiable,
        "dropped": [{"parameter": entry.name, "why": entry.why} for entry in found.identifiability.dropped],
    }


def designed_readings(robot: Robot, sensor: str, options: ClosureDesignOptions) -> CommandResult:
    """Poses in which a gravity sensor on the flange is to be read: `poses.csv`."""
    found = design_gravity(robot, sensor, options)
    alone, random, chosen = found.deviation
    name = "inclinometer" if sensor == "tilt" else "accelerometer"
    verdict = (
        f"{len(found.q)} poses to read the {name} in: what the arm's angles are wrong by will move the "
        f"target by {quantity(chosen, 'm')} (RMS over the work space), with random poses by "
        f"{quantity(random, 'm')}, "
        f"from the drawing alone by {quantity(alone, 'm')}."
    )
    dropped = tuple((entry.name, entry.why) for entry in found.identifiability.dropped)
    return CommandResult(
        json=_expected(found),
        report=Report(f"Poses for a gravity sensor: {robot.name}", verdict, (
            Table("Not identified", ("parameter", "why"), dropped, "These keep their declared values."),
            Text("How", (
                "The sensor's axes are taken for those of the flange, an averaged reading for good to "
                f"{quantity(SIGMA_RAD, 'rad')}. Wait until the arm has come to rest, and average.",
            )),
        ), "good"),
        tables={"poses.csv": {"session": np.ones(len(found.q), int)} | pose_columns(robot, found.q, None)},
    )


def _report(robot: Robot, options: ClosureDesignOptions, found: ClosureDesign) -> Report:
    alone, random, chosen = found.deviation
    verdict = (
        f"{len(found.q)} touches at {len(set(found.session))} places: the target's position over the work "
        "space will be known to "
        f"{quantity(chosen, 'm')} (RMS), with random poses at these places to {quantity(random, 'm')}, from "
        "the drawing "
        f"alone to {quantity(alone, 'm')}."
    )
    rows = tuple(
        (str(session), str(socket), *(Quantity(x, "m") for x in seat),
         int(np.sum((found.session == session) & (found.socket == socket))))
        for (session, socket), seat in found.seats.items()
    )
    dropped = tuple((entry.name, entry.why) for entry in found.identifiability.dropped)
    return Report(f"Fixture and poses: {robot.name}", verdict, (
        Table("Seats", ("place", "socket", "x", "y", "z", "touches"), rows,
              "Centres in the robot's base frame. A seat may stand centimetres elsewhere: it is estimated; "
              "the arm is led to it by hand or "
              "by sight, near the angles of poses.csv."),
        Table("Not identified", ("parameter", "why"), dropped, "These keep their declared values."),
        Text("How", (
            f"Two seats {quantity(options.apart, 'm')} apart. Places are taken one after the other, each "
            "time the one that lowers the mean "
            "variance of the target's position over the work space most; poses are exchanged by the same "
            "measure. A touch is taken to be "
            "good to 0.1 mm; mechanisms of the hand, cables and obstacles are not known here.",
        )),
    ), "good")
