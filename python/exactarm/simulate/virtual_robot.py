"""The true robot of a simulation: the declared one, deviations of its parameters, and hidden effects.

`nominal` is what the controller and the user believe; `true` is what moves; both turn motor angles into joint
angles by the same motor, so commanded angles are those of the nominal robot. The truth is written apart from
the data.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.effects import DoesNotFit, Effect, library
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp
from exactarm.robot.controller_frames import with_target
from exactarm.robot.robot import Joint, Link, Placement, Robot

# Standard deviations of a new arm against its drawing: thesis Table 3.8 in kind; masses and friction as
# catalogues go.
LENGTH_M, ANGLE_RAD, SHARE = 5e-4, 1e-3, 0.1
_STAND_M, _TOOL_M = 1.5, 0.15  # where a tracker stands, how far a target is off the flange


@dataclass(frozen=True)
class VirtualRobot:
    """nominal: the declared robot; true: with its deviations, its own effects and the hidden ones."""

    nominal: Robot
    true: Robot

    @staticmethod
    def of(nominal: Robot, effects: Sequence[Effect] = (), true: Robot | None = None) -> VirtualRobot:
        """`true`: the robot with deviated tables, or None for the declared ones; `effects`: hidden ones."""
        true = nominal if true is None else true
        # what a past record told stays with it
        own = tuple(effect for effect in true.effects if not effect.record)
        return VirtualRobot(nominal, replace(true, effects=own + tuple(effects)))

    @property
    def layout(self) -> Layout:
        return Layout.of(self.true.effects, estimate=False)

    @property
    def baked(self) -> Robot:
        """The true robot with those effects in its tables that live there."""
        return self.layout.baked(self.true)

    def motor_angles(self, q: np.ndarray) -> np.ndarray:
        """theta (N, n) by which the controller reaches what it takes for the joint angles q (N, n)."""
        return (q - self.nominal.controller_offsets) * self.nominal.controller_ratios


def deviated(
    robot: Robot, scale: float, random: np.random.Generator, *, geometry: bool = True, frames: bool = True
) -> Robot:
    """The robot with random errors `scale` times as large as usual in masses, friction and geometry.

    The controller keeps its own constants. geometry: frames and zeros deviate too (a dynamic identification
    takes them as calibrated); frames: base and tool at unknown places, as in a real set-up.
    """
    near = lambda value: None if value is None else value * (1.0 + scale * random.normal(0.0, SHARE))
    joints = []
    for i, joint in enumerate(robot.joints):
        changes = {"coulomb": near(joint.coulomb), "viscous": near(joint.viscous)}
        if geometry and robot.has_geometry:
            offset = joint.q_offset + scale * random.normal(0.0, ANGLE_RAD)
            changes |= {"controller_offset": float(robot.controller_offsets[i]), "q_offset": offset}
            changes |= _geometry(joint, scale, random)
        joints.append(replace(joint, **changes))
    links = None if robot.links is None else tuple(_link(link, scale, random) for link in robot.links)
    result = replace(robot, joints=tuple(joints), links=links)
    return placed(result, random) if frames else result


def placed(robot: Robot, random: np.random.Generator) -> Robot:
    """Base and tool somewhere: a tracker does not know where it stands, nor where on the flange its target
    sits."""
    base = Placement(exp(random.normal(0.0, 1.0, 3)), random.normal(0.0, _STAND_M, 3))
    return with_target(replace(robot, base=base, tool=robot.controller.flange),
                       random.uniform(-_TOOL_M, _TOOL_M, 3))


def one_sided(robot: Robot, gear_direction: str) -> Robot:
    """The robot with the gear tables of one direction ("cw" or "ccw") in both; unchanged for "motion"."""
    if gear_direction == "motion":
        return robot
    return replace(robot, joints=tuple(
        replace(joint, cw=table, ccw=table)
        for joint in robot.joints for table in [getattr(joint, gear_direction) or joint.cw or joint.ccw]
    ))


def _geometry(joint: Joint, scale: float, random: np.random.Generator) -> dict[str, float]:
    length, angle = (lambda: scale * random.normal(0.0,
                                                   LENGTH_M)), (lambda: scale * random.normal(0.0, ANGLE_RAD))
    changes = {"a": joint.a + length(), "alpha": joint.alpha + angle()}
    return changes | ({"d": joint.d + length()} if joint.beta is None else {"beta": joint.beta + angle()})


def _link(link: Link, scale: float, random: np.random.Generator) -> Link:
    mass, inertia = (1.0 + scale * random.normal(0.0, SHARE) for _ in range(2))
    return Link(link.mass * mass, link.centre_of_mass + scale * random.normal(0.0, 0.01, 3),
                link.inertia * max(inertia, 0.3))


def parse_effect(text: str, axes: int) -> Effect:
    """An effect from words: `backlash joint=2 width_rad=4e-4`; numbers that are never estimated may be left
    out."""
    name, *words = text.split() or [""]
    known = library()
    if name not in known or known[name].declared:
        names = [key for key, cls in known.items() if not cls.declared]
        close = difflib.get_close_matches(name, names, n=1)
        meant = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(names)}"
        raise InputError(f"--effect: unknown effect {name!r}; {meant}")
    table: dict[str, float | int | str] = {"effect": name}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign:
            raise InputError(f"--effect {name}: {word!r}; expected words like width_rad=4e-4")
        if key in table:
            raise InputError(f"--effect {name}: {key} is given twice")
        table[key] = _number(value)
    if known[name].per_joint and not (isinstance(table.get("joint"), int) and 1 <= table["joint"] <= axes):
        raise InputError(f"--effect {name}: expected joint=1 to joint={axes}")
    try:
        return _built(known[name], table).of_axes(axes)
    except DoesNotFit as error:
        raise InputError(f"--effect {error}") from None


def _built(cls: type[Effect], table: dict) -> Effect:
    filled = []
    for _ in range(100):
        try:
            effect = cls.from_table(table)
            break
        except KeyError as error:
            filled.append(str(error.args[0]))
            table = table | {filled[-1]: 0.0}
        except (ValueError, TypeError, StopIteration):
            raise InputError(f"--effect {cls.name}: {filled[-1] if filled else 'a value'} is missing or "
                             "wrong") from None
    parameters = {parameter.name: parameter for parameter in effect.parameters()}
    missing = [name for name in filled if name not in parameters or not parameters[name].fixed]
    unknown = set(table) - set(parameters) - set(effect.to_table())
    if missing or unknown:
        wrong = f"unknown {min(unknown)}" if unknown else f"no {missing[0]}"
        close = difflib.get_close_matches(min(unknown), parameters, n=1) if unknown else []
        meant = f"did you mean {close[0]}?" if close else f"expected {', '.join(parameters)}"
        raise InputError(f"--effect {cls.name}: {wrong}; {meant}")
    for parameter, value in zip(effect.parameters(), effect.values):
        if not (np.isfinite(value) and parameter.lower <= value <= parameter.upper):
            bounds = f"from {parameter.lower:g} to {parameter.upper:g}"
            raise InputError(f"--effect {cls.name}: {parameter.name}={value:g}; expected a number {bounds}")
    return effect


def _number(text: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
