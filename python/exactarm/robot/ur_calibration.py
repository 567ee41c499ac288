"""The factory calibration of an arm of Universal Robots (`calibration.conf`) on top of its nominal robot
file.

    theta_i = q_i + offset_i + delta_theta_i,  d_i + delta_d_i,  a_i + delta_a_i,  alpha_i + delta_alpha_i

in the frames of Denavit and Hartenberg. Their d of nearly parallel axes are hundreds of metres that cancel;
the axes in space are not, so that they are taken from the sum and get Hayati's frames (mdh_frames.py). The
controller's Cartesian targets run through this chain: it is also kept as the controller's own, "calibrated".
Source of the format: files in public use; the maker does not document it. Limits: masses stay where they
were.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from exactarm.errors import InputError
from exactarm.files.file_bytes import file_text
from exactarm.robot.mdh_frames import Axis, compose, frame_at_zero, mdh_chain, relative, rotation_z
from exactarm.robot.robot import Controller, Placement, Robot, frame_of
from exactarm.robot.urdf import merged_link

KEYS = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
FARTHEST_M = 0.05  # of an axis or the flange from the nominal one: beyond, it is another arm's file
NEAR = 0.05  # of a cosine of right or parallel axes: calibrations tilt axes by some 0.01 rad
_LINE = re.compile(r"\s*(\w+)\s*=\s*\[(.*)\]\s*")


def read_ur_calibration(path: str | Path, nominal: Robot) -> Robot:
    """The nominal robot with the frames of the file."""
    deltas = _deltas(path, nominal.axes)
    if any(joint.type != "revolute" or joint.sign != 1.0 for joint in nominal.joints):
        raise InputError(f"robot {nominal.name} has other axes than an arm of Universal Robots; expected a "
                         "nominal file of one, as calibration.conf#ur10",
                         file=path)
    if not like_universal_robots(np.array([frame.rotation[:, 2] for frame in
                                           _frames(nominal, np.zeros((4, nominal.axes)))[:-1]])):
        raise InputError(
            f"robot {nominal.name} is not built as an arm of Universal Robots (axes 2, 3, 4 parallel, right "
            "angles between the others); expected the nominal file of one, as calibration.conf#ur10",
            file=path)
    drawn, calibrated = _frames(nominal, np.zeros((4, nominal.axes))), _frames(nominal, deltas)
    axes = [Axis(frame.position, frame.rotation[:, 2]) for frame in calibrated[:-1]]
    chain = mdh_chain(axes, calibrated[-1])
    away = float(np.linalg.norm(calibrated[-1].position - drawn[-1].position))
    if away > FARTHEST_M:
        raise InputError(
            f"puts the flange {1e3 * away:.0f} mm from that of {nominal.name} at zero; expected less than "
            f"{1e3 * FARTHEST_M:g} mm: is it another arm's, or are its delta_d not complete?",
            file=path)
    joints = tuple(
        replace(joint, **{name: getattr(frame, name) for name in ("sign", "zero", "d", "a", "alpha", "beta")},
                q_offset=0.0, controller_offset=None)
        for joint, frame in zip(nominal.joints, chain.joints, strict=True))
    links = None
    if nominal.links is not None:
        links = tuple(merged_link([(link, relative(new, old))])
                      for link, new, old in zip(nominal.links, chain.frames, drawn[1:], strict=True))
    controller = Controller(frames=tuple(map(frame_of, joints)), base=chain.base, flange=chain.tool,
                            chain="calibrated", joint_names=nominal.controller.joint_names,
                            coupling=nominal.controller.coupling)
    return replace(nominal, joints=joints, links=links, controller=controller,
                   gravity=chain.base.rotation.T @ nominal.gravity, base=compose(nominal.base, chain.base),
                   tool=compose(chain.tool, nominal.tool), file=str(path))


def like_universal_robots(axes: np.ndarray) -> bool:
    """Whether directions of axes (n, 3) are those of such an arm."""
    if axes.shape != (6, 3):
        return False
    cosines = np.abs(np.sum(axes[1:] * axes[:-1], axis=1))
    return bool(np.abs(cosines - [0.0, 1.0, 1.0, 0.0, 0.0]).max() < NEAR)


def _frames(robot: Robot, deltas: np.ndarray) -> list[Placement]:
    """Frames 0 to n at q = 0, in frame 0."""
    place, out = Placement(), [Placement()]
    for joint, offset, (theta, a, d, alpha) in zip(robot.joints, robot.offsets, deltas.T, strict=True):
        place = compose(place, Placement(rotation_z(offset + theta)))
        place = compose(
            place, frame_at_zero(replace(joint, d=joint.d + d, a=joint.a + a, alpha=joint.alpha + alpha)))
        out.append(place)
    return out


def _deltas(path: str | Path, axes: int) -> np.ndarray:
    """(4, n) in the order of KEYS."""
    try:
        lines = file_text(path).splitlines()
    except FileNotFoundError:
        raise InputError("no such file; expected a calibration.conf", file=path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read as text ({type(error).__name__})", file=path) from None
    found: dict[str, list[float]] = {}
    for number, line in enumerate(lines, start=1):
        match = _LINE.fullmatch(line)
        if match is None or match[1] not in KEYS:
            continue
        if match[1] in found:
            raise InputError(f"{match[1]} is given twice; expected it once", file=path, line=number)
        try:
            found[match[1]] = [float(cell) for cell in match[2].split(",")]
        except ValueError:
            raise InputError(f"{match[1]}: expected {axes} numbers in [ ]", file=path, line=number) from None
        if len(found[match[1]]) != axes or not np.all(np.isfinite(found[match[1]])):
            raise InputError(f"{match[1]} has {len(found[match[1]])} numbers; expected {axes}, finite",
                             file=path, line=number)
    missing = [key for key in KEYS if key not in found]
    if missing:
        raise InputError(
            f"{missing[0]} is missing; expected {', '.join(KEYS)}, each = [{axes} numbers]", file=path)
    return np.array([found[key] for key in KEYS])
