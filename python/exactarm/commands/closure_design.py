"""What `exactarm design --contact socket` says: where to put a fixture of two seats, and the poses that touch
them; for a gravity sensor the poses to read it in; for a camera where to put the board, and the poses."""

import numpy as np

from exactarm.commands.calibrate import dropped_table
from exactarm.commands.design_for import pose_columns
from exactarm.commands.result import CommandResult
from exactarm.data.fixture import CameraSetup
from exactarm.design.camera_design import CORNER_PX, REPEATS_M, CameraDesign, design_pictures
from exactarm.design.closure_design import ClosureDesign, ClosureDesignOptions, design_closures
from exactarm.design.gravity_design import SIGMA_RAD, GravityDesign, design_gravity
from exactarm.measurement.board_views import LEAST_SEEN, Views
from exactarm.report import Quantity, Report, Table, Text
from exactarm.report.numbers import quantity
from exactarm.robot.robot import Robot


def designed_closures(robot: Robot, options: ClosureDesignOptions) -> CommandResult:
    """The design as a result: `poses.csv` with session and socket, and the fixture file for its distance."""
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
        report=_report(robot, options, found), tables={"poses.csv": columns}, texts={"fixture.toml": fixture})


def _expected(found: ClosureDesign | GravityDesign | CameraDesign) -> dict:
    """What every design of closures says in result.json."""
    return {
        "deviation_m": dict(zip(("drawing", "random_poses", "design"), found.deviation)),
        "poses": len(found.q),
        "identifiable": found.identifiability.identifiable,
        "dropped": [{"parameter": entry.name, "why": entry.why} for entry in found.identifiability.dropped]}


def designed_readings(robot: Robot, sensor: str, options: ClosureDesignOptions) -> CommandResult:
    """Poses in which a gravity sensor on the flange is to be read: `poses.csv`."""
    found = design_gravity(robot, sensor, options)
    alone, random, chosen = found.deviation
    name = "inclinometer" if sensor == "tilt" else "accelerometer"
    verdict = (
        f"{len(found.q)} poses to read the {name} in: what the angles that it shows are wrong by will move "
        f"the target by {quantity(chosen, 'm')} (RMS over the work space), with random poses by "
        f"{quantity(random, 'm')}, from the drawing alone by {quantity(alone, 'm')}.")
    if found.hidden:
        hidden, one = sorted(map(str, found.hidden)), len(found.hidden) == 1
        verdict += (
            f" But {', '.join(hidden)} turn{'s' if one else ''} the sensor as other axes do, and "
            f"move{'s' if one else ''} the target otherwise: with {'it' if one else 'them'} "
            f"{quantity(found.with_hidden, 'm')} are left. Touch a fixture, or track the target, in some "
            "poses as well.")
    return CommandResult(
        json=_expected(found) | {"deviation_with_hidden_m": found.with_hidden},
        report=Report(f"Poses for a gravity sensor: {robot.name}", verdict, (
            dropped_table(found.identifiability.dropped),
            Text("How", (
                "The sensor's axes are taken for those of the flange, an averaged reading for good to "
                f"{quantity(SIGMA_RAD, 'rad')}. Wait until the arm has come to rest, and average.",)),
        ), "good"),
        tables={"poses.csv": {"session": np.ones(len(found.q), int)} | pose_columns(robot, found.q, None)})


def designed_pictures(robot: Robot, setup: CameraSetup, options: ClosureDesignOptions,
                      views: Views) -> CommandResult:
    """Where to put the board (or the camera), and the poses in which to take pictures: `poses.csv`."""
    found = design_pictures(robot, setup, options, views)
    alone, random, chosen = found.deviation
    stands = "board" if setup.on_flange else "camera"
    verdict = (
        f"{len(found.q)} pictures, the {stands} at {len(found.cameras)} places: the target's position over "
        f"the work space will be known to {quantity(chosen, 'm')} (RMS), with random poses that see the "
        f"board at these places to {quantity(random, 'm')}, from the drawing alone to {quantity(alone, 'm')}."
    )
    placed = [{"session": session, stands: {"position_m": place.tolist(), "rotation": turn.tolist()}}
              for session, (turn, place) in enumerate((camera.frames()[1] for camera in found.cameras), 1)]
    seen = [(number, *(Quantity(float(x), "m") for x in entry[stands]["position_m"]),
             *(Quantity(float(row[2])) for row in entry[stands]["rotation"]),
             int(np.sum(found.session == number))) for number, entry in enumerate(placed, 1)]
    what = "outer corner" if setup.on_flange else "lens"
    return CommandResult(
        json=_expected(found) | {"places": placed},
        report=Report(f"Poses for pictures of a board: {robot.name}", verdict, (
            Table(f"Where the {stands} stands",
                  ("place", "x", "y", "z", "z axis: x", "z axis: y", "z axis: z", "pictures"), tuple(seen),
                  f"Its {what} in the robot's base frame, and where its z axis points (of a board: into it). "
                  "It may stand centimetres elsewhere: it is estimated."),
            dropped_table(found.identifiability.dropped),
            Text("How", (
                f"In every pose {100 * LEAST_SEEN:.0f} % of the corners or more are in the picture, "
                f"the board's middle is {quantity(views.near, 'm')} to {quantity(views.far, 'm')} before the "
                f"lens, and the view within {np.degrees(views.lean):.0f} degrees of the board's normal. "
                "What the flange carries is taken to sit at the target of the robot file and to look along "
                "its z: give the rotation of [tool] where it does not.",
                f"A corner is taken to be good to {CORNER_PX:g} px, the arm to repeat to "
                f"{quantity(REPEATS_M, 'm')}. The body of the arm may hide the board, and cables and "
                "obstacles are not known here: look at each picture, and leave out those that show nothing.",
            ))), "good"),
        tables={"poses.csv": {"session": found.session} | pose_columns(robot, found.q, None)})


def _report(robot: Robot, options: ClosureDesignOptions, found: ClosureDesign) -> Report:
    alone, random, chosen = found.deviation
    verdict = (
        f"{len(found.q)} touches at {len(set(found.session))} places: the target's position over the work "
        f"space will be known to {quantity(chosen, 'm')} (RMS), with random poses at these places to "
        f"{quantity(random, 'm')}, from the drawing alone to {quantity(alone, 'm')}.")
    rows = tuple((str(session), str(socket), *(Quantity(x, "m") for x in seat),
                  int(np.sum((found.session == session) & (found.socket == socket))))
                 for (session, socket), seat in found.seats.items())
    return Report(f"Fixture and poses: {robot.name}", verdict, (
        Table("Seats", ("place", "socket", "x", "y", "z", "touches"), rows,
              "Centres in the robot's base frame. A seat may stand centimetres elsewhere: it is estimated; "
              "the arm is led to it by hand or by sight, near the angles of poses.csv."),
        dropped_table(found.identifiability.dropped),
        Text("How", (
            f"Two seats {quantity(options.apart, 'm')} apart. Places are taken one after the other, each "
            "time the one that lowers the mean variance of the target's position over the work space most; "
            "poses are exchanged by the same measure. A touch is taken to be good to 0.1 mm; mechanisms of "
            "the hand, cables and obstacles are not known here.",))), "good")
