"""Robot -> readable `.toml`, units in names, exact to the last bit; written whole or not at all."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.errors import InputError
from exactarm.files.table import atomic_file
from exactarm.robot.controller_frames import apart
from exactarm.robot.keys import FORMAT, FRAME_FIELDS, GEAR_KEYS, GEAR_TABLES, JOINT_KEYS
from exactarm.robot.robot import Controller, GearTable, Joint, Link, Placement, Robot

HEAD = """\
# Robot file of exactarm. Units are in the names; frame i of joint i is
#   Rot_z(sign q + zero) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)
# A key that is absent is not declared."""


def write_robot(path: str | Path, robot: Robot) -> None:
    """Write `robot` to `path`, a TOML file in a folder that is there; else InputError."""
    if not isinstance(path, (str, Path)) or not isinstance(robot, Robot):
        raise InputError(f"write_robot({type(path).__name__}, {type(robot).__name__}); expected a path, then "
                         "a robot")
    if Path(path).suffix.lower() == ".urdf":
        raise InputError("a robot file is TOML; expected a name that ends with .toml (`exactarm export` "
                         "writes a URDF)", file=str(path))
    if not Path(path).resolve().parent.is_dir():
        raise InputError(f"no folder {Path(path).parent}; expected one that is there", file=str(path))
    with atomic_file(path) as temporary:
        temporary.write_text(robot_text(robot), encoding="utf-8")


def robot_text(robot: Robot) -> str:
    """The content of the robot file."""
    blocks = [HEAD, _top(robot)]
    blocks += _table("record", robot.record, "How this file came about.")
    first, last = "Robot base", "the flange frame"
    if apart(robot.controller):
        first, last = "DH frame 0", "DH frame n"
    blocks += _placement("base", robot.base, f"{first} in the frame of the measuring device.")
    blocks += _placement("tool", robot.tool, f"Measured target in {last}.")
    blocks += _controller(robot.controller)
    blocks += [_joint(number, joint, robot.has_geometry)
               for number, joint in enumerate(robot.joints, start=1)]
    blocks += [_link(number, link) for number, link in enumerate(robot.links or (), start=1)]
    blocks += _effects(robot.effects)
    blocks += _table("intervals", {name: list(pair) for name, pair in robot.intervals.items()},
                     "95 % intervals.")
    if robot.covariance is not None:
        blocks += _table("covariance", robot.covariance.to_table(),
                         "Covariance of the estimates: factor times its transpose.")
    return "\n\n".join(blocks) + "\n"


def effects_text(effects: Iterable[Any]) -> str:
    """Effects alone, as in a robot file."""
    return "\n\n".join(_effects(effects)) + "\n"


def tables_text(head: str, tables: Iterable[tuple[str, Mapping[str, Any]]]) -> str:
    """(comment, values) of every table under the same head, as TOML."""
    return "\n\n".join(_lines(head, values, f"# {comment}") for comment, values in tables) + "\n"


def _effects(effects: Iterable[Any]) -> list[str]:
    return [_lines("[[effects]]", effect.to_table(), f"# {effect.label}") for effect in effects]


def _equal(left: np.ndarray, right: np.ndarray) -> bool:
    return np.asarray(left).tobytes() == np.asarray(right).tobytes()


def _top(robot: Robot) -> str:
    values = {"format": FORMAT, "name": robot.name, "gravity_m_s2": robot.gravity}
    if not robot.has_geometry:
        values["has_geometry"] = False
    if robot.mass is not None:
        values["mass_kg"] = robot.mass
    if robot.generic_masses:
        values["generic_masses"] = True
    comments = {
        "gravity_m_s2": f"in {'DH frame 0' if apart(robot.controller) else 'the robot base frame'}",
        "has_geometry": "only the drives are known",
        "mass_kg": "of the whole arm",
        "generic_masses": "the links below are no declaration: derived from the geometry, for loads at rest"}
    return "\n".join(_line(key, value, comments.get(key, "")) for key, value in values.items())


def _placement(name: str, placement: Placement, comment: str) -> list[str]:
    identity = Placement()
    if _equal(placement.rotation, identity.rotation) and _equal(placement.position, identity.position):
        return []
    rows = [f"# {comment}", f"[{name}]", _line("position_m", placement.position)]
    return ["\n".join([*rows, "rotation = " + _matrix(placement.rotation)])]


def _controller(controller: Controller) -> list[str]:
    """What the controller works with; nothing where nothing is on record."""
    plain = Controller()
    values = {
        name: value for name in ("chain", "absolute_accuracy", "coupling", "pulses_per_rad", "joint_names")
        if (value := getattr(controller, name)) != getattr(plain, name)}
    blocks = _table("controller", values, "What the controller works with, whatever a calibration has found.")
    blocks += _placement("controller.base", controller.base, "DH frame 0 in the controller's base frame.")
    blocks += _placement("controller.flange", controller.flange,
                         "The controller's flange in the last DH frame.")
    for number, frame in enumerate(controller.frames, start=1):
        values = {key.name(frame.type): value for key in JOINT_KEYS
                  if key.field in FRAME_FIELDS and (value := getattr(frame, key.field)) is not None
                  and not (key.field == "d" and frame.beta is not None)}
        blocks.append(_lines("[[controller.frames]]", values, f"# Frame {number} as the controller has it"))
    return blocks


def _joint(number: int, joint: Joint, has_geometry: bool) -> str:
    lines = [f"# Joint {number}", "[[joints]]"]
    if joint.type != "revolute":
        lines.append(_line("type", joint.type))
    geometry = {"zero", "d", "a", "alpha"}
    untold = {"sign": 1.0, "zero": 0.0, "spring_cubic": 0.0}
    for key in JOINT_KEYS:
        value = getattr(joint, key.field)
        plain = key.field in untold and value == untold[key.field]
        bare = not has_geometry and key.field in geometry and not value
        without = key.field == "d" and joint.beta is not None and value == 0.0
        if value is None or ((plain or bare or without) and not _is_minus_zero(value)):
            continue
        name = key.name(joint.type)
        lines.append(_line(name, float(value), _degrees(name, value) or key.note))
    for field, meaning in GEAR_TABLES.items():
        if (table := getattr(joint, field)) is not None:
            lines.append(_gear(field, table, meaning))
    return "\n".join(lines)


def _is_minus_zero(value: float | None) -> bool:
    return value == 0.0 and math.copysign(1.0, value) < 0.0


def _degrees(name: str, value: float) -> str:
    for ending in ("_rad", "_rad_s", "_rad_s2"):
        if name.endswith(ending) and "_Nm_" not in name and value:
            return f"{math.degrees(value):.7g} {ending[1:].replace('rad', 'deg')}".replace("_", "/")
    return ""


def _gear(field: str, table: GearTable, meaning: str) -> str:
    lines = [f"[joints.gear_{field}]  # {meaning}; u = ratio (1 + sum a cos(order phi) - b sin(order phi))"]
    return "\n".join(lines + [_line(key, getattr(table, name)) for name, key in GEAR_KEYS.items()])


def _link(number: int, link: Link) -> str:
    lines = [f"# Link {number}, in frame {number}; inertia about the centre of mass, 0 where absent",
             "[[links]]"]
    lines += [_line("mass_kg", float(link.mass)), _line("centre_of_mass_m", link.centre_of_mass)]
    if not _equal(link.inertia, np.zeros((3, 3))):
        lines.append("inertia_kg_m2 = " + _matrix(link.inertia))
    return "\n".join(lines)


def _table(name: str, values: Mapping[str, Any], comment: str) -> list[str]:
    return [_lines(f"[{name}]", values, f"# {comment}")] if values else []


def _lines(head: str, values: Mapping[str, Any], comment: str) -> str:
    return "\n".join([comment, head, *(_line(key, value) for key, value in values.items())])


def _line(key: str, value: Any, comment: str = "") -> str:
    return f"{_key(key)} = {_value(value)}" + (f"  # {comment}" if comment else "")


def _key(key: str) -> str:
    bare = key and all(char.isascii() and (char.isalnum() or char in "_-") for char in key)
    return key if bare else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Iterable) and not isinstance(value, str):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return _text(str(value))


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _matrix(matrix: np.ndarray) -> str:
    return "[\n" + "".join(f"  {_value(row)},\n" for row in np.asarray(matrix)) + "]"
