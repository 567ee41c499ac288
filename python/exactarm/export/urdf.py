"""A URDF patched in place: the origins of its joints become those of the identified arm, every other byte
stays.

Names, meshes, collision shapes, transmissions and comments are kept. Each moving link is put onto its
identified axis with the least turn and shift from where it was; the first fixed joint behind the last axis
takes what is left, so that the tip is exact. A xacro file can be patched where its joints stand at its root
with plain numbers; else it has to be expanded first.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from exactarm.errors import InputError
from exactarm.export.chain import ReportedChain, reported_chain
from exactarm.mdh_frames import compose, relative
from exactarm.robot import Placement, Robot
from exactarm.rotation import exp
from exactarm.urdf import roll_pitch_yaw
from exactarm.urdf_tree import MOVING, UrdfJoint, read_tree

OTHER_ARM_RAD, OTHER_ARM_M = (
    0.1,
    0.05,
)  # an identified axis that is further from the file's belongs to another arm or base


def patched_urdf(robot: Robot, source: str) -> bytes:
    """The bytes of `source` (FILE, FILE#TIP or FILE#BASE:TIP) with new origins."""
    path, _, ends = source.partition("#")
    _refuse_macros(path)
    base, tip = ends.split(":", 1) if ":" in ends else (None, ends or None)
    way = read_tree(path).chain(base, tip)
    origins = new_origins(reported_chain(robot), way, path)
    return _rewritten(Path(path), origins)


def _refuse_macros(path: str) -> None:
    """A macro's joints are not in the text: there is nothing to patch in place."""
    try:
        text = Path(path).read_text(encoding="latin-1")
    except OSError:
        return  # the reader says it
    plain = re.sub(r"<!--.*?-->", lambda match: re.sub(r"[^\n]", " ", match[0]), text, flags=re.S)
    found = re.search(r"<xacro:(?!property\b|arg\b)(\w+)", plain)
    if found:
        raise InputError(
            f"<xacro:{found[1]}> is not expanded here; expected a URDF, as by: xacro FILE > robot.urdf",
            file=path, line=plain.count("\n", 0, found.start()) + 1,
        )


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


def _rewritten(path: Path, origins: dict[str, Placement]) -> bytes:
    content = path.read_bytes()
    text = content.decode("latin-1")
    plain = re.sub(r"<!--.*?-->", lambda match: " " * len(match[0]), text, flags=re.S)
    edits = []
    for name, origin in origins.items():
        found = [
            match
            for match in re.finditer(r"<joint\b([^>]*)(?<!/)>(.*?)</joint\s*>", plain, re.S)
            if re.search(rf"\bname\s*=\s*[\"']{re.escape(name)}[\"']", match[1])
            and re.search(r"\btype\s*=", match[1])
        ]
        if len(found) != 1:
            raise InputError(
                f"joint {name} is {len(found)} times in the text; expected once (a xacro has to be expanded "
                "first)",
                file=path,
            )
        edits += _origin_edits(found[0], origin)
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
