"""Tool sag: a tool or the adapter of a reflector bends under its own weight.

    x += R S R' g,   R -> exp(R (turn x R' g)) R      g: gravity's direction; R: rotation of DH frame n

S (3, 3) symmetric, m: what the target moves by, in DH frame n, under a weight along each axis; only what
differs between the axes shows, S = (xx, xy, xz; xy, yy, yz; xz, yz, -xx - yy), for a tool that gives way
alike to all sides hangs lower by one length, as its base does. turn (3,), rad: where the orientation is
measured, too; a bar that bends turns its end.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.axis_wobble import FEW_AXES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.moving_frames import MovingFrames

_SHAPES = np.zeros((5, 3, 3))  # of S: xx, yy, xy, xz, yz
for _k, (_i, _j) in enumerate(((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))):
    _SHAPES[_k, _i, _j] = _SHAPES[_k, _j, _i] = 1.0
    _SHAPES[_k, 2, 2] -= _i == _j


@dataclass(frozen=True)
class ToolSag(Effect):
    """values: xx, yy, xy, xz, yz of S, and with `turn` the three of the rotation."""

    turn: bool = False

    name = "tool_sag"
    plain = "a tool that bends under its own weight"
    station = Station.GEOMETRY
    kinds = (POSES.name,)
    per_joint = False
    compensable = True
    # As probable as that of one axis of six: soft wrists look much like it, and every arm has them.
    log_odds = -float(np.log(6.0))
    source = "ISO 9283 (fixing of the target); linear elasticity of a body under its weight"

    def parameters(self) -> tuple[Parameter, ...]:
        moved = tuple(Parameter(f"sag_{axes}_m", 1e-4) for axes in ("xx", "yy", "xy", "xz", "yz"))
        return moved + tuple(Parameter(f"turn_{axis}_rad", 2e-4) for axis in "xyz" if self.turn)

    def describe(self) -> str:
        size = 1e6 * np.ptp(np.linalg.eigvalsh(np.tensordot(self.values[:5], _SHAPES, axes=1)))
        return (f"the tool or the adapter of the target bends under its own weight, by up to {size:.0f} "
                "micrometres more along one direction than along another")

    def change(self, view) -> Change:
        frames, last = MovingFrames.of(view), view.axes - 1
        rotation, down = frames.rotations[:, -1], frames.base @ _direction(view.robot.gravity)
        inside = np.einsum("nji,nj->ni", rotation, down)
        by_parameters = np.zeros((view.rows, 6, len(self.values)))
        by_parameters[:, :3, :5] = rotation @ np.einsum("kij,nj->nik", _SHAPES, inside)
        sag = np.tensordot(self.values[:5], _SHAPES, axes=1)
        value, by_q = np.zeros((view.rows, 6)), np.zeros((view.rows, 6, view.axes))
        value[:, :3] = (rotation @ (inside @ sag)[:, :, None])[:, :, 0]
        fixed = frames.direction_by_q(down, last)  # what a direction would do that turned with the flange
        by_q[:, :3] = (frames.direction_by_q(value[:, :3], last)
                       - rotation @ sag @ np.swapaxes(rotation, 1, 2) @ fixed)
        if self.turn:
            about = rotation @ np.array(self.values[5:])
            value[:, 3:] = np.cross(about, down)
            by_parameters[:, 3:, 5:] = np.cross(rotation, down[:, :, None], axis=1)
            by_q[:, 3:] = np.cross(frames.direction_by_q(about, last), down[:, :, None], axis=1)
        return Change(tuple(range(6)), value, by_parameters, {"q": by_q})

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(None, (), turn="turn_x_rad" in table)
        return raw.with_values(table[parameter.name] for parameter in raw.parameters())

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if not np.any(robot.gravity) or robot.axes <= FEW_AXES:
            return ()
        turn = view.data.rotation is not None
        return (cls(None, (0.0,) * (8 if turn else 5), turn),)


def _direction(gravity) -> np.ndarray:
    """(3,) of length 1, or zero."""
    gravity = np.asarray(gravity, float)
    return gravity / max(float(np.linalg.norm(gravity)), np.finfo(float).tiny)
