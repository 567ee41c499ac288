"""A URDF patched in place: the origins of its joints become those of the identified arm, every other byte
stays.

Names, meshes, collision shapes, transmissions and comments are kept. Each moving link is put onto its
identified axis with the least turn and shift from where it was; the first fixed joint behind the last axis
takes what is left, so that the tip is exact. Of a xacro the elements of the joints are patched
(xacro_source.py).
"""

from __future__ import annotations

import re

import numpy as np

from exactarm.errors import InputError
from exactarm.export.chain import ReportedChain, reported_chain
from exactarm.export.xacro_source import (
    elements,
    expanded,
    is_xacro,
    require_own_element,
    require_patched,
    stands_for_several,
    without_comments,
)
from exactarm.files.file_bytes import file_bytes
from exactarm.numerics.rotation import exp
from exactarm.robot.mdh_frames import compose, relative
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import roll_pitch_yaw
from exactarm.robot.urdf_tree import MOVING, UrdfJoint, read_tree

OTHER_ARM_RAD, OTHER_ARM_M = (
    0.1,
    0.05,
)  # an identified axis that is further from the file's belongs to another arm or base


def patched_urdf(robot: Robot, source: str) -> bytes:
    """The bytes of `source` (FILE, FILE#TIP or FILE#BASE:TIP; a URDF or a xacro) with new origins."""
    path, _, ends = source.partition("#")
    base, tip = ends.split(":", 1) if ":" in ends else (None, ends or None)
    try:
        content = file_bytes(path)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); expected a URDF or xacro", file=path) from None
    macros = is_xacro(content)
    tree = read_tree(path, expanded(path, content) if macros else content)
    origins = new_origins(reported_chain(robot), tree.chain(base, tip), path)
    patched = _rewritten(path, content, origins)
    if macros:
        text = without_comments(content.decode("latin-1"))
        require_patched(path, text, tree, read_tree(path, expanded(path, patched)), origins)
    return patched


def new_origins(chain: ReportedChain, way: tuple[UrdfJoint, ...], path: str) -> dict[str, Placement]:
    """Name of a joint -> its origin."""
    moving = [joint for joint in way if joint.type in MOVING]
    if len(moving) != len(chain.starts):
        raise InputError(f"{len(moving)} axes between base and tip; expected {len(chain.starts)}", file=path)
    nominal, now, origins = Placement(), Placement(), {}
    axes = iter(zip(chain.starts, chain.directions()))
    last = max(i for i, joint in enumerate(way) if joint.type in MOVING)
    for i, joint in enumerate(way):
        nominal = compose(nominal, joint.origin)
        if joint.type in MOVING:
            start, direction = next(axes)
            there = _on_axis(nominal, joint, start, direction, path)
            origins[joint.name] = relative(now, there)
            now = there
        elif i == last + 1:
            rest = Placement()
            for behind in way[i + 1 :]:
                rest = compose(rest, behind.origin)
            there = compose(chain.end, relative(rest, Placement()))
            origins[joint.name] = relative(now, there)
            now = there
        else:
            now = compose(now, joint.origin)
    return origins


def _on_axis(
    nominal: Placement, joint: UrdfJoint, start: Placement, direction: np.ndarray, path: str
) -> Placement:
    """The nominal frame with the least turn and shift that put its axis onto the identified one."""
    axis = nominal.rotation @ (joint.axis / np.linalg.norm(joint.axis))
    cross = np.cross(axis, direction)
    turn = np.arctan2(np.linalg.norm(cross), axis @ direction)
    rotation = exp(cross / max(np.linalg.norm(cross), 1e-300) * turn) @ nominal.rotation
    away = nominal.position - start.position
    shift = np.zeros(3) if joint.type == "prismatic" else direction * (direction @ away) - away
    if turn > OTHER_ARM_RAD or np.linalg.norm(shift) > OTHER_ARM_M:
        raise InputError(
            f"joint {joint.name}: the identified axis is {1e3 * np.linalg.norm(shift):.0f} mm and "
            f"{np.degrees(turn):.1f} deg away; "
            "expected the URDF of this arm; another base or tip is chosen by FILE#BASE:TIP",
            file=path,
        )
    return Placement(rotation, nominal.position + shift)


def _rewritten(path: str, content: bytes, origins: dict[str, Placement]) -> bytes:
    text = content.decode("latin-1")
    plain = without_comments(text)
    edits, owners = [], {}
    for name, origin in origins.items():
        element = require_own_element(path, plain, name, elements(plain, name))
        other = owners.setdefault(element.start(), name)
        if other != name:
            raise stands_for_several(path, plain, element, f"{other} and {name}")
        edits += _origin_edits(element, origin)
    for start, end, new in sorted(edits, reverse=True):
        text = text[:start] + new + text[end:]
    return text.encode("latin-1")


def _origin_edits(joint: re.Match, origin: Placement) -> list[tuple[int, int, str]]:
    """(start, end, text) of the numbers of a joint's origin."""
    triple = lambda values: " ".join(repr(float(value) + 0.0) for value in values)
    values = {"xyz": triple(origin.position), "rpy": triple(roll_pitch_yaw(origin.rotation))}
    tag = re.search(r"<origin\b([^>]*?)(/?)>", joint[2])
    if tag is None:
        return [
            (
                joint.start(2),
                joint.start(2),
                "<origin " + " ".join(f'{k}="{v}"' for k, v in values.items()) + "/>",
            )
        ]
    edits, at = [], joint.start(2) + tag.start(1)
    for key, value in values.items():
        attribute = re.search(rf"\b{key}\s*=\s*([\"'])(.*?)\1", tag[1])
        if attribute is None:
            edits.append((at, at, f' {key}="{value}"'))
        else:
            edits.append((at + attribute.start(2), at + attribute.end(2), value))
    return edits
