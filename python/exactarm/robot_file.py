"""Robot files: a shipped name, a `.toml` or a `.urdf` -> Robot, checked key by key.

    load_robot("ur10" or path) -> Robot        write_robot(path, robot)

A file that does not hold a robot is refused with one line that names the key and what was expected.
Writing and reading again gives the same numbers to the last bit.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.effects import DoesNotFit, Effect, effect_from_table, library
from exactarm.errors import InputError
from exactarm.files.examples import is_table, no_such_robot
from exactarm.files.file_bytes import path_of
from exactarm.files.toml_file import fits_shape, is_number, read_toml
from exactarm.robot.covariance import ParameterCovariance
from exactarm.robot.keys import (
    CONTROLLER_KEYS,
    FORMAT,
    FRAME_FIELDS,
    GEAR_KEYS,
    GEAR_TABLES,
    GRAVITY,
    JOINT_KEYS,
    MOST_AXES,
    NOT_NEGATIVE,
    OTHER_UNITS,
    POSITIVE,
)
from exactarm.robot.robot import Controller, GearTable, Joint, Link, Placement, ReportedAngles, Robot, provide
from exactarm.robot.ur_calibration import read_ur_calibration
from exactarm.robot.urdf import read_urdf
from exactarm.robot.writer import write_robot

__all__ = ["AnyRobot", "Robot", "load_robot", "read_robot", "robot_of", "shipped_robots", "write_robot"]

AnyRobot = Robot | str | Path
SHIPPED = Path(__file__).parent / "data" / "robots"
ROTATION_TOLERANCE = 1e-6  # a matrix typed by hand has at least seven digits

TOP_KEYS = ("format", "name", "gravity_m_s2", "has_geometry", "mass_kg", "generic_masses", "record", "base",
            "tool", "joints", "controller", "links", "effects", "intervals", "covariance")


def _at_reported_angles() -> ReportedAngles:
    """Imported at its first use: the chain takes half a second."""
    from exactarm.chain import controller

    return controller


provide(_at_reported_angles)


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


@cache
def _shipped(name: str) -> Robot:
    return replace(read_robot(SHIPPED / f"{name}.toml"), file=name)


def load_robot(name_or_path: str | Path) -> Robot:
    """The robot of that shipped name, or of that `.toml` or `.urdf` file."""
    text, path = str(name_or_path), path_of(name_or_path, "a robot, its file or the name of a shipped one")
    if text in shipped_robots():
        return _shipped(text)
    if text.partition("#")[0].lower().endswith(".urdf"):
        return replace(read_urdf(path), file=text)
    if path.suffix.lower() == ".xacro":
        raise InputError("is a xacro; expected it expanded to a URDF: xacro FILE > robot.urdf", file=text)
    file, _, nominal = text.partition("#")
    if file.lower().endswith(".conf"):
        if not nominal:
            raise InputError("holds deltas alone; expected the nominal arm behind it, as "
                             "calibration.conf#ur10", file=text)
        return replace(read_ur_calibration(file, load_robot(nominal)), file=text)
    if is_table(path):
        raise InputError("is measured data; expected a robot before it", file=text)
    if path.suffix.lower() == ".toml" or os.path.exists(path) or len(path.parts) > 1:
        return read_robot(path)
    raise InputError(no_such_robot(text, shipped_robots()), file=text or repr(text))


def robot_of(robot: AnyRobot) -> Robot:
    """A robot as it is, or the one of that name or file."""
    return robot if isinstance(robot, Robot) else load_robot(robot)


def read_robot(path: str | Path) -> Robot:
    """The robot of a `.toml` file."""
    return replace(_Reader(path).robot(read_toml(path, "a robot file (.toml or .urdf)")), file=str(path))


class _Reader:
    """Turns tables of one file into a robot; every refusal names the file and the key."""

    def __init__(self, path: str | Path):
        self.path = path

    def refuse(self, key: str, message: str) -> InputError:
        return InputError(f"key {key}: {message}", file=self.path)

    # -- values ------------------------------------------------------------------------------------
    def known(self, table: Mapping[str, Any], keys: Collection[str], where: str) -> None:
        for key in table:
            if key not in keys:
                close = difflib.get_close_matches(key, keys, n=1)
                hint = f"expected {close[0]}" if close else f"expected one of {', '.join(keys)}"
                raise self.refuse(where + key, f"is not known; {hint}")

    def take(self, table: Mapping[str, Any], key: str, kind: type, where: str, expected: str) -> Any:
        if key not in table:
            raise self.refuse(where + key, f"is missing; expected {expected}")
        if not isinstance(table[key], kind) or (kind is not bool and isinstance(table[key], bool)):
            raise self.refuse(where + key, f"{_short(table[key])}; expected {expected}")
        return table[key]

    def number(self, value: Any, key: str, expected: str = "a number", finite: bool = True) -> float:
        good = is_number(value) and not math.isnan(value)
        if not good or (finite and math.isinf(value)):
            raise self.refuse(key, f"{_short(value)}; expected {expected}")
        return float(value)

    def array(self, value: Any, key: str, shape: tuple[int | None, ...], expected: str) -> np.ndarray:
        if not fits_shape(value, shape):
            raise self.refuse(key, f"{_short(value)}; expected {expected}")
        return np.array(value, dtype=float)

    def with_units(self, table: Mapping[str, Any], keys: Collection[str], where: str) -> dict[str, Any]:
        """The table with degrees and mm turned into rad and m."""
        out: dict[str, Any] = {}
        for key, value in table.items():
            meant = key
            for ending, (si, factor) in OTHER_UNITS.items():
                if key not in keys and key.endswith(ending) and key.removesuffix(ending) + si in keys:
                    meant = key.removesuffix(ending) + si
                    value = factor * self.number(value, where + key)
                    break
            if meant in out or (meant != key and meant in table):
                raise self.refuse(where + key, f"the same as {meant}; expected one of the two")
            out[meant] = value
        return out

    # -- robot -------------------------------------------------------------------------------------
    def robot(self, tables: Mapping[str, Any]) -> Robot:
        self.known(tables, TOP_KEYS, "")
        if tables.get("format", FORMAT) != FORMAT:
            raise self.refuse("format", f"{_short(tables['format'])}; expected {FORMAT}, the format that "
                                        "this program reads")
        name = self.take(tables, "name", str, "", "a name in quotes")
        entries = self.take(tables, "joints", list, "", "one [[joints]] for each axis")
        if not entries or not all(isinstance(entry, dict) for entry in entries):
            raise self.refuse("joints", "expected one [[joints]] for each axis")
        if len(entries) > MOST_AXES:
            raise self.refuse("joints", f"{len(entries)} axes; expected at most {MOST_AXES}")
        joints = tuple(self.joint(entry, f"joints[{i}].") for i, entry in enumerate(entries, start=1))
        optional: dict[str, Any] = {}
        if "gravity_m_s2" in tables:
            gravity = self.array(tables["gravity_m_s2"], "gravity_m_s2", (3,), "three numbers")
            if not GRAVITY[0](size := float(np.linalg.norm(gravity))):
                raise self.refuse("gravity_m_s2", f"{size:g} m/s²; expected {GRAVITY[1]}")
            optional["gravity"] = gravity
        if "has_geometry" in tables:
            optional["has_geometry"] = self.take(tables, "has_geometry", bool, "", "true or false")
        for key in ("base", "tool"):
            if key in tables:
                optional[key] = self.placement(self.take(tables, key, dict, "", f"a table [{key}]"),
                                               f"{key}.")
        if "controller" in tables:
            optional["controller"] = self.controller(
                self.take(tables, "controller", dict, "", "a table [controller]"), joints
            )
        if "links" in tables:
            optional["links"] = self.links(tables, len(joints))
        optional |= self.masses(tables)
        effects = self.take(tables, "effects", list, "", "[[effects]]") if "effects" in tables else []
        optional["effects"] = tuple(self.effect(e, f"effects[{i}].", len(joints))
                                    for i, e in enumerate(effects, start=1))
        optional["intervals"] = self.intervals(tables)
        if "covariance" in tables:
            try:
                optional["covariance"] = ParameterCovariance.from_table(tables["covariance"])
            except (KeyError, TypeError, ValueError) as error:
                raise self.refuse("covariance",
                                  f"does not fit ({error}); expected names, noise_m and factor") from None
        if "record" in tables:
            optional["record"] = self.take(tables, "record", dict, "", "a table [record]")
        return Robot(name, joints, **optional)

    def joint(self, table: Mapping[str, Any], where: str) -> Joint:
        kind = table.get("type", "revolute")
        if kind not in ("revolute", "prismatic"):
            raise self.refuse(where + "type", f'{_short(kind)}; expected "revolute" or "prismatic"')
        keys = {key.name(kind): key for key in JOINT_KEYS}
        tables = [f"gear_{direction}" for direction in GEAR_TABLES]
        values = self.with_units(table, keys, where)
        self.known(values, ["type", *keys, *tables], where)
        fields: dict[str, Any] = {"type": kind}
        for name, key in keys.items():
            if name in values:
                holds, expected = key.rule_of(kind)
                value = self.number(values[name], where + name, expected)
                if not holds(value):
                    raise self.refuse(where + name, f"{value:g}; expected {expected}")
                fields[key.field] = value
        for direction in GEAR_TABLES:
            if (name := f"gear_{direction}") in table:
                fields[direction] = self.gear_table(self.take(table, name, dict, where, "a table"),
                                                    f"{where}{name}.")
        self.check_joint(fields, kind, where)
        return Joint(**fields)

    def check_joint(self, fields: Mapping[str, Any], kind: str, where: str) -> None:
        names = {key.field: where + key.name(kind) for key in JOINT_KEYS}
        if fields.get("q_min", -math.inf) >= fields.get("q_max", math.inf):
            raise self.refuse(names["q_max"], f"{fields['q_max']:g}; expected more than {fields['q_min']:g}, "
                                              "the minimum")
        for field in ("cw", "ccw", "controller_ratio"):
            if field in fields and "ratio" not in fields:
                raise self.refuse(names["ratio"], "is missing; expected the gear ratio that the joint's gear "
                                                  "keys refer to")

    def gear_table(self, table: Mapping[str, Any], where: str) -> GearTable:
        self.known(table, tuple(GEAR_KEYS.values()), where)
        values = {}
        for field, key in GEAR_KEYS.items():
            listed = self.take(table, key, list, where, "a list of numbers")
            values[field] = self.array(listed, where + key, (None,), "a list of numbers")
            count = len(values["order"])
            if len(values[field]) != count:
                raise self.refuse(where + key,
                                  f"{len(values[field])} numbers; expected {count}, one for each order")
        return GearTable(**values)

    def placement(self, table: Mapping[str, Any], where: str) -> Placement:
        self.known(table, ("position_m", "rotation"), where)
        fields = {}
        if "position_m" in table:
            fields["position"] = self.array(table["position_m"], where + "position_m", (3,), "three numbers")
        if "rotation" in table:
            rotation = self.array(table["rotation"], where + "rotation", (3, 3),
                                  "three rows of three numbers")
            orthonormal = np.abs(rotation @ rotation.T - np.eye(3)).max() < ROTATION_TOLERANCE
            if not orthonormal or np.linalg.det(rotation) <= 0:
                raise self.refuse(where + "rotation",
                                  "is no rotation; expected orthonormal rows, right-handed")
            fields["rotation"] = rotation
        return Placement(**fields)

    def controller(self, table: Mapping[str, Any], joints: tuple[Joint, ...]) -> Controller:
        where, fields = "controller.", {}
        self.known(table, CONTROLLER_KEYS, where)
        if (chain := table.get("chain", "nominal")) not in ("nominal", "calibrated"):
            raise self.refuse(where + "chain", f'{_short(chain)}; expected "nominal" or "calibrated"')
        if "absolute_accuracy" in table:
            fields["absolute_accuracy"] = self.take(table, "absolute_accuracy", bool, where, "true or false")
        for key in ("base", "flange"):
            if key in table:
                fields[key] = self.placement(self.take(table, key, dict, where,
                                                       f"a table [controller.{key}]"), f"{where}{key}.")
        if table.get("frames"):
            fields["frames"] = tuple(
                self.frame(entry, f"{where}frames[{i}].", joint.type)
                for i, (entry, joint) in enumerate(zip(self.for_each_axis(table, "frames", joints), joints),
                                                   start=1)
            )
        if "coupling" in table:
            rows = self.array(table["coupling"], where + "coupling", (None, 3),
                              "rows [axis, other axis, factor]") \
                if table["coupling"] else ()
            if any(axis not in range(1, len(joints) + 1) for row in rows for axis in row[:2]):
                raise self.refuse(where + "coupling", f"expected axes from 1 to {len(joints)}")
            fields["coupling"] = tuple((int(i), int(j), float(factor)) for i, j, factor in rows)
        if "pulses_per_rad" in table:
            pulses = self.for_each_axis(table, "pulses_per_rad", joints)
            fields["pulses_per_rad"] = tuple(self.array(pulses, where + "pulses_per_rad", (None,),
                                                        "a number for each axis"))
        if "joint_names" in table:
            names = self.for_each_axis(table, "joint_names", joints)
            if len({name for name in names if isinstance(name, str)}) != len(joints):
                raise self.refuse(where + "joint_names", "expected a name of its own for each axis")
            fields["joint_names"] = tuple(names)
        return Controller(chain=chain, **fields)

    def for_each_axis(self, table: Mapping[str, Any], key: str, joints: tuple[Joint, ...]) -> list[Any]:
        entries: list[Any] = self.take(table, key, list, "controller.", "a list")
        if len(entries) != len(joints):
            raise self.refuse(f"controller.{key}",
                              f"{len(entries)} entries; expected {len(joints)}, one for each axis")
        return entries

    def frame(self, table: Any, where: str, kind: str) -> Joint:
        if not isinstance(table, dict):
            raise self.refuse(where.rstrip("."), "expected a table of sign, zero, d, a, alpha, beta")
        keys = {key.name(kind): key for key in JOINT_KEYS if key.field in FRAME_FIELDS}
        values = self.with_units(table, keys, where)
        self.known(values, tuple(keys), where)
        return self.joint(values | {"type": kind}, where)

    def links(self, tables: Mapping[str, Any], axes: int) -> tuple[Link, ...]:
        entries = self.take(tables, "links", list, "", "one [[links]] for each axis")
        if not all(isinstance(entry, dict) for entry in entries):
            raise self.refuse("links", "expected one [[links]] for each axis")
        if len(entries) != axes:
            raise self.refuse("links", f"{len(entries)} links; expected {axes}, one for each axis")
        return tuple(self.link(entry, f"links[{i}].") for i, entry in enumerate(entries, start=1))

    def masses(self, tables: Mapping[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if "mass_kg" in tables:
            (holds, expected), key = POSITIVE, "mass_kg"
            found["mass"] = self.number(tables[key], key, expected)
            if not holds(found["mass"]):
                raise self.refuse(key, f"{found['mass']:g}; expected {expected}")
        if "generic_masses" in tables:
            found["generic_masses"] = self.take(tables, "generic_masses", bool, "", "true or false")
            if found["generic_masses"] and "links" not in tables:
                raise self.refuse("generic_masses",
                                  "true without [[links]]; expected none, they are derived where needed")
        return found

    def link(self, table: Mapping[str, Any], where: str) -> Link:
        self.known(table, ("mass_kg", "centre_of_mass_m", "inertia_kg_m2"), where)
        holds, expected = NOT_NEGATIVE
        mass = self.number(table.get("mass_kg"), where + "mass_kg", expected)
        if not holds(mass):
            raise self.refuse(where + "mass_kg", f"{mass:g}; expected {expected}")
        centre = self.array(table.get("centre_of_mass_m"), where + "centre_of_mass_m", (3,), "three numbers")
        inertia = np.zeros((3, 3))
        if "inertia_kg_m2" in table:
            key = where + "inertia_kg_m2"
            inertia = self.array(table["inertia_kg_m2"], key, (3, 3), "three rows of three numbers")
            if not np.allclose(inertia, inertia.T, rtol=1e-9, atol=0.0):
                raise self.refuse(key, "is not symmetric; expected a symmetric matrix")
        return Link(mass, centre, inertia)

    def effect(self, table: Any, where: str, axes: int) -> Effect:
        if not isinstance(table, dict) or "effect" not in table:
            raise self.refuse(where + "effect", "is missing; expected the name of an effect")
        name = table["effect"]
        if not isinstance(name, str) or name not in library():
            close = difflib.get_close_matches(str(name), library(), n=1)
            hint = f"expected {close[0]}" if close else f"expected one of {', '.join(library())}"
            raise self.refuse(where + "effect", f"no effect named {_short(name)}; {hint}")
        joint, axis = table.get("joint"), f"an axis from 1 to {axes}"
        if joint is None and library()[name].per_joint:
            raise self.refuse(where + "joint", f"is missing; expected {axis}")
        if joint is not None and (not isinstance(joint, int) or isinstance(joint, bool)
                                  or not 1 <= joint <= axes):
            raise self.refuse(where + "joint", f"{_short(joint)}; expected {axis}")
        for key, value in table.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise self.refuse(where + key, f"{value}; expected a finite number")
        try:
            effect = effect_from_table(table).of_axes(axes)
        except KeyError as error:
            raise self.refuse(where + str(error.args[0]),
                              f"is missing; expected a parameter of {name}") from None
        except DoesNotFit as error:
            raise self.refuse(where + "effect", str(error)) from None
        except (TypeError, ValueError, AttributeError, StopIteration):
            raise self.refuse(where + "effect",
                              f"a value does not fit; expected the parameters of {name}") from None
        if (joint is not None) != type(effect).per_joint:  # forms of one effect may differ
            expected = f"expected {axis}" if joint is None else f"expected none, {name} is of no single axis"
            raise self.refuse(where + "joint",
                              f"is missing; {expected}" if joint is None else f"{_short(joint)}; {expected}")
        self.known(table, ("joint", *effect.to_table()), where)
        return effect

    def intervals(self, tables: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
        if "intervals" not in tables:
            return {}
        out = {}
        for name, pair in self.take(tables, "intervals", dict, "", "a table [intervals]").items():
            if not isinstance(pair, list) or len(pair) != 2:
                raise self.refuse(f"intervals.{name}", f"{_short(pair)}; expected [low, high]")
            low, high = (self.number(end, f"intervals.{name}", "[low, high]", finite=False) for end in pair)
            if low > high:
                raise self.refuse(f"intervals.{name}", f"{_short(pair)}; expected low before high")
            out[name] = (low, high)
        return out


def _short(value: Any) -> str:
    return text if len(text := repr(value)) <= 60 else text[:57] + "..."
