"""`exactarm export`: the identified arm in the format of another program, with the accuracy that the format
loses."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import replace
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_robot
from exactarm.commands.call import AnyRobot, asked, command, robot_of
from exactarm.commands.result import CommandResult
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.export.chain import lost, not_carried, reported_chain
from exactarm.export.mjcf import mjcf_text
from exactarm.export.offsets import offsets_text
from exactarm.export.robodk import station_script
from exactarm.export.ur_description import kinematics_yaml, link_origins
from exactarm.export.urdf import patched_urdf
from exactarm.files.file_bytes import path_of, real_path
from exactarm.report import Highlight, Highlights, Quantity, Report, Text, Warnings
from exactarm.report.numbers import quantity
from exactarm.robot.mdh_frames import behind_axis, compose
from exactarm.robot.pseudo_inertia import inconsistencies
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import urdf_text

NAME = "export"
HELP = "the identified arm as URDF (patched in place), ur_description, MJCF, table, offsets or RoboDK script"
UNUSED_OPTIONS = ("seed", "threads")  # nothing in it is random


_HASH = re.compile(r"calib_[0-9]+")
ROUNDING_M = 1e-9  # all formats hold nine digits or more of numbers of some metres; no device shows less
FILES = {"urdf": "robot.urdf", "ur_description": "default_kinematics.yaml", "mjcf": "robot.xml",
         "csv": "parameters.csv", "offsets": "offsets.txt", "robodk": "station.py"}  # format -> its file


def _name(format: str, source: str | None) -> str:
    """Of the file written: a patched one keeps its own."""
    return FILES[format] if source is None else Path(source.partition("#")[0]).name


def WRITES(arguments: argparse.Namespace) -> list[str]:  # of other commands a tuple
    return [escape(_name(arguments.format, arguments.source))]


def _urdf(robot: Robot, source: str | None, given_hash: str | None) -> bytes:
    return urdf_text(robot).encode() if source is None else patched_urdf(robot, source)


def _parameters(robot: Robot, *_: Any) -> bytes:
    head = ("joint,type,sign,zero_rad,d_m,a_m,alpha_rad,beta_rad,q_offset_rad,"
            "controller_offset_rad,ratio,controller_ratio")
    rows = []
    for i, joint in enumerate(robot.joints):
        numbers = (joint.sign, joint.zero, joint.d, joint.a, joint.alpha, joint.beta or 0.0, robot.offsets[i],
                   robot.controller_offsets[i], robot.ratios[i], robot.controller_ratios[i])
        rows.append(f"{i + 1},{joint.type}," + ",".join(repr(float(number)) for number in numbers))
    return ("\n".join([head, *rows]) + "\n").encode()


FORMATS: dict[str, Callable[..., bytes]] = {
    "urdf": _urdf,
    "ur_description": lambda robot, source, given: kinematics_yaml(robot, given).encode(),
    "mjcf": lambda robot, *_: mjcf_text(robot).encode(),
    "csv": _parameters,
    "offsets": lambda robot, *_: offsets_text(robot).encode(),
    "robodk": lambda robot, *_: station_script(robot).encode(),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("--format", choices=tuple(FORMATS), required=True, help="what to write")
    parser.add_argument("--source", metavar="FILE[#[BASE:]TIP]",
                        help="urdf: the file to patch; all but its joints' origins stays")
    parser.add_argument(
        "--hash", metavar="calib_N", help="ur_description: the hash of the robot, as its driver reports it")


@command
def export(robot: AnyRobot, *, format: str, source: str | Path | None = None, hash: str | None = None,
           seed: int = DEFAULT_SEED) -> CommandResult:
    """The identified arm in the format of another program; the file is in `contents`.

    Nothing in it is random: `seed` is recorded alone.
    """
    arm = robot_of(robot)
    if not arm.has_geometry:
        raise InputError(f"robot {arm.name} declares no geometry; expected one to export", file=arm.file)
    if format not in FORMATS:
        raise InputError(f"format {format!r}; expected one of {', '.join(FORMATS)}")
    if hash is not None and format != "ur_description":
        raise InputError("--hash acts with --format ur_description only")
    if hash is not None and not _HASH.fullmatch(hash):
        raise InputError(f"--hash {hash!r}: expected calib_ and a whole number, as the driver reports it")
    if source is not None:
        path_of(source, "a URDF or xacro")
    given = None if source is None else str(source)
    name, content = _name(format, given), FORMATS[format](arm, given, hash)
    parts, cost = not_carried(arm), None
    if format == "offsets":  # a page, no arm: what the axes' own geometry is worth is in no file of a robot
        verdict = f"{name} is written: joint offsets, base and tool, for a person who types them in."
        parts.insert(0, "lengths and directions of the axes, which belong into no controller")
    elif (cost := lost(arm, _flange_poses(arm, format))).largest < ROUNDING_M:
        verdict = f"{name} is written; its arm is that of the whole model, exact to rounding."
    else:
        verdict = (f"{name} is written. By what the format cannot carry, the flange is off by "
                   f"{quantity(cost.mean, 'm')} on average and {quantity(cost.largest, 'm')} at most, "
                   "against the whole model over the work space.")
    told = {"lost_mean_m": cost and cost.mean, "lost_max_m": cost and cost.largest}
    carried = "Not in the file: " + "; ".join(parts) + "." if parts else "All of the model is in the file."
    options = {"format": format, "source": given, "hash": hash}
    return CommandResult(
        json={"format": format, "file": name} | told | {"not_carried": parts},
        report=Report(
            f"Export of {arm.name}", verdict,
            (*([] if cost is None or cost.largest < ROUNDING_M else
               [Highlights((Highlight("lost, mean", Quantity(cost.mean, "m")),
                            Highlight("lost, at most", Quantity(cost.largest, "m"))))]),
             Text("What the format cannot carry", (carried,)),
             Warnings((*_coupled(arm, format), *_warnings(arm, format)))),
            "plain"),
        contents={name: content},
        inputs=() if source is None else (str(source).partition("#")[0],),
        asked=asked("export", robot, None, seed, options, {"source": None, "hash": None}))


def run(arguments: argparse.Namespace) -> CommandResult:
    if arguments.source is not None:
        if arguments.format != "urdf":
            raise InputError("--source: is patched as URDF alone; expected --format urdf")
        if real_path(arguments.source.partition("#")[0]).parent == real_path(arguments.out):
            raise InputError("lies in the folder of results; expected another --out", file=arguments.source)
    return export(arguments.robot, format=arguments.format, source=arguments.source, hash=arguments.hash,
                  seed=arguments.seed)


def _flange_poses(robot: Robot, format: str) -> Callable[..., Any]:
    """Where the flange is by the exported file, q (N, n) -> Poses."""
    if format != "ur_description":
        return reported_chain(robot).poses
    # the file's last link stands on the last axis; its flange is that of the description, without a, alpha,
    # beta of the last frame
    chain, place = reported_chain(robot), Placement()
    for origin in link_origins(robot):
        place = compose(place, origin)
    return replace(chain, end=compose(place, robot.controller.flange)).poses


def _coupled(robot: Robot, format: str) -> tuple[str, ...]:
    rule = robot.controller.coupling_in_words
    if not rule or format == "offsets":
        return ()
    return (f"the file's joint angles are not those that the controller reports: {rule}",)


def _warnings(robot: Robot, format: str) -> tuple[str, ...]:
    if format in ("urdf", "mjcf"):
        return tuple(f"{text}; simulators refuse it (exactarm identify finds links that can exist)"
                     for text in inconsistencies(robot))
    last = behind_axis(robot.joints[-1])
    turned = np.abs(last.rotation - np.eye(3)).max() > 1e-9 or np.abs(last.position[:2]).max() > 1e-9
    if format == "ur_description" and turned:
        return ("the last frame's a, alpha and beta have no place in this format: the flange is that of the "
                "description",)
    if format == "offsets":
        return ("numbers for a person: changed masterings move all taught points",)
    if format == "robodk":
        return (
            "the script shows the identified axes and measures how far RoboDK's model is off; no documented "
            "call of its API takes the deviations of axes, and it has not been run in RoboDK itself",)
    return ()
