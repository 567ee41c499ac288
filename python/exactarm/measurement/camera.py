"""Camera: corners of a flat board in pictures; on the flange before a board at rest, or at rest before a
board on the flange.

    on the flange    y = M^-1 T^-1 W c          T: the target's frame in the base frame, from the chain
    at rest          y = W^-1 T M c             M: what the flange carries, W: what stands still
    numbers          pi(y) / f = (u, v) / f     c: the corner on the board, (column, row, 0) times the square

Numbers are pixels over the declared (or first) focal length f: an error of 1e-3 is 1 mm at a distance of 1 m.
Unknown of each session: M and W (6 each, as a rotation vector beside a reference, and a position), the size
of the square (known to what the fixture file says) and the lens (exactarm.measurement.lens) unless it is
given. The board's square is what gives the scale. Limits: the board is flat; one camera a session.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.data.fixture import CameraSetup
from exactarm.effects.base import Parameter
from exactarm.errors import InputError
from exactarm.measurement.board_pictures import (
    LEAST_CORNERS,
    Pose,
    focal_length,
    homography,
    inverse,
    pose_of,
    two_frames,
)
from exactarm.measurement.contact import Contact
from exactarm.measurement.lens import LENS, project, undistorted
from exactarm.numerics.rotation import exp, left_jacobian, skew

EDGE_PX = 1.0  # by which noise may put a corner beyond the edge
LEAST_PICTURES = 3  # two unknown frames: two turns about different axes
_BEND = {"k1": 0.5, "k2": 0.5, "p1": 0.01, "p2": 0.01}  # standard deviations before any data: any lens
_Rows = tuple[tuple[float, ...], ...]
_UNIT: _Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_MOUNT, _WORLD, SQUARE, _LENS = slice(0, 6), slice(6, 12), 12, slice(13, 22)


@dataclass(frozen=True)
class Camera(Contact):
    """One camera of one session; mount, world (3, 3): what the rotation vectors of M and W count from."""

    setup: CameraSetup = CameraSetup()
    mount: _Rows = _UNIT
    world: _Rows = _UNIT
    focal: float = 1.0

    contact: ClassVar[str] = "camera"
    numbers: ClassVar[int] = 2

    @property
    def title(self) -> str:
        return f"camera of session {self.session}"

    def parameter_label(self, parameter: Parameter) -> str:
        return f"session_{self.session}.{self.contact}_{parameter.name}"

    def parameters(self) -> tuple[Parameter, ...]:
        frames = [Parameter(f"{frame}_{axis}_{unit}", size) for frame in ("mount", "world")
                  for unit, size in (("rad", np.pi), ("m", 10.0)) for axis in "xyz"]
        given = self.setup.lens_given
        lens = [Parameter(name, 1e4 if name.endswith("px") else 10.0, fixed=given or name == "k3",
                          prior=_BEND.get(name, np.inf)) for name in LENS]
        return (*frames, Parameter("square_m", 1.0, lower=1e-6), *lens)

    # -- the rows ---------------------------------------------------------------------------------
    def reading(self, data, at):
        return data.pixel[at] / self.focal

    def depth(self, view, at: np.ndarray) -> np.ndarray:
        """(K,) m: how far before the camera each corner is."""
        return self._seen(view, at)[0][:, 2]

    def frames(self) -> tuple[Pose, Pose]:
        """M and W."""
        values = np.asarray(self.values)
        return tuple((exp(values[where][:3]) @ np.asarray(reference), values[where][3:])
                     for where, reference in ((_MOUNT, self.mount), (_WORLD, self.world)))

    def placements(self) -> dict[str, Pose]:
        mount, world = self.frames()
        names = ("camera", "board") if self.setup.on_flange else ("board", "camera")
        return {f"{names[0]} on the flange": mount, f"{names[1]} in the base": world}

    def _seen(self, view, at: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        """The corner in the camera's axes (K, 3), and on the way there: on the board in squares; the target's
        rotation; the corner from what stands still, from the target and from what the flange carries."""
        unit = self.setup.corner(view.data.corner[at])
        corner = self.values[SQUARE] * unit
        turned, place = _targets(view, at)
        (mount, m), (world, w) = self.frames()
        if self.setup.on_flange:
            at_rest = corner @ world.T
            arm = at_rest + w - place
            held = np.einsum("kji,kj->ki", turned, arm) - m
            return held @ mount, (unit, turned, at_rest, arm, held)
        held = corner @ mount.T
        arm = np.einsum("kij,kj->ki", turned, held + m)
        at_rest = arm + place - w
        return at_rest @ world, (unit, turned, at_rest, arm, held)

    def _seen_with_slopes(self, view, at: np.ndarray) -> tuple[np.ndarray, ...]:
        """The corner in the camera's axes (K, 3), by a displacement of the target, by M and W (K, 3, 6) each,
        by the square (K, 3)."""
        seen, (unit, turned, at_rest, arm, held) = self._seen(view, at)
        (mount, _), (world, _) = self.frames()
        values = np.asarray(self.values)
        turns = [left_jacobian(values[where][:3]) for where in (_MOUNT, _WORLD)]
        if self.setup.on_flange:
            to_camera = mount.T @ np.swapaxes(turned, -1, -2)
            by_target = np.concatenate([-to_camera, to_camera @ skew(arm)], axis=2)
            by_mount = np.concatenate([mount.T @ skew(held) @ turns[0],
                                       np.tile(-mount.T, (len(at), 1, 1))], axis=2)
            by_world = np.concatenate([-to_camera @ skew(at_rest) @ turns[1], to_camera], axis=2)
            by_square = np.einsum("kij,kj->ki", to_camera @ world, unit)
        else:
            to_camera = np.tile(world.T, (len(at), 1, 1))
            by_target = np.concatenate([to_camera, -to_camera @ skew(arm)], axis=2)
            by_mount = np.concatenate([-to_camera @ turned @ skew(held) @ turns[0], to_camera @ turned],
                                      axis=2)
            by_world = np.concatenate([world.T @ skew(at_rest) @ turns[1], -to_camera], axis=2)
            by_square = np.einsum("kij,kj->ki", to_camera @ turned @ mount, unit)
        return seen, by_target, by_mount, by_world, by_square

    def numbers_at(self, view, at):
        seen, by_target, by_mount, by_world, by_square = self._seen_with_slopes(view, at)
        pixels, by_seen, by_lens = project(seen, np.asarray(self.values[_LENS]))
        by_values = np.concatenate([by_seen @ by_mount, by_seen @ by_world, by_seen @ by_square[:, :, None],
                                    by_lens], axis=2)
        return pixels / self.focal, by_seen @ by_target / self.focal, by_values / self.focal

    def own_motion(self, view, at: np.ndarray) -> np.ndarray:
        """(K, 2, 6): the numbers by a motion of the camera in its own axes: across, down, about the view,
        along it, about the other two axes."""
        seen = self._seen(view, at)[0]
        by_seen = project(seen, np.asarray(self.values[_LENS]))[1] / self.focal
        by_motion = np.concatenate([np.tile(np.eye(3), (len(at), 1, 1)), -skew(seen)], axis=2)
        return by_seen @ by_motion[:, :, [0, 1, 5, 2, 3, 4]]

    # -- the start --------------------------------------------------------------------------------
    def started(self, view, at):
        setup, data = view.data.fixture.camera, view.data
        if setup is None:
            raise InputError("pictures of a board, and no [board] in the fixture file; expected --fixture "
                             "with its squares and square_mm", file=data.first_file, column="corner")
        lens, shown, first = board_poses(setup, data, at)
        targets = tuple(part[first] for part in _targets(view, at))
        mount, world, _ = two_frames(targets, inverse(shown) if setup.on_flange else shown)
        rows = lambda matrix: tuple(tuple(map(float, row)) for row in matrix)
        camera = replace(self, setup=setup, mount=rows(mount[0]), world=rows(world[0]), focal=float(lens[0]))
        zero = np.zeros(3)
        return camera.with_values([*zero, *mount[1], *zero, *world[1], setup.square, *lens])


def board_poses(setup: CameraSetup, data, at: np.ndarray) -> tuple[np.ndarray, Pose, np.ndarray]:
    """The lens as declared or first guessed (9,), the board in the camera's axes in every picture that shows
    enough, and the first of `at` (an index into it) of each of these pictures. Raises InputError where too
    few do."""
    beyond = at[data.corner[at] >= setup.corners]
    if beyond.size:
        row = beyond[0]
        raise InputError(f"corner {data.corner[row]} of a board of {setup.columns} by {setup.rows} squares; "
                         f"expected 0 to {setup.corners - 1}, row by row", row=int(data.row[row]),
                         file=data.first_file, column="corner")
    _require_inside(setup, data, at)
    _, first, number = np.unique(data.picture[at], return_index=True, return_inverse=True)
    parts = [np.flatnonzero(number == k) for k in range(len(first))]
    kept = [k for k, part in enumerate(parts) if _spread(setup.corner(data.corner[at[part]]))]
    if len(kept) < LEAST_PICTURES:
        raise InputError(f"{len(kept)} pictures show {LEAST_CORNERS} corners or more that are not in one "
                         f"line; expected at least {LEAST_PICTURES}", file=data.first_file, column="picture")
    corners = [setup.square * setup.corner(data.corner[at[parts[k]]])[:, :2] for k in kept]
    pixels = [data.pixel[at[parts[k]]] for k in kept]
    lens = np.array(setup.lens or _first_lens(setup, corners, pixels, data), float)
    rays = [undistorted(seen, lens) for seen in pixels]
    unseen = np.concatenate([at[parts[k]][np.isnan(ray[:, 0])] for k, ray in zip(kept, rays)])
    if len(unseen):
        raise InputError("no ray through the lens of the fixture file ends at this pixel; expected focal_px "
                         "and distortion of this camera", row=int(data.row[unseen[0]]), file=data.first_file,
                         column="u_px")
    found = [pose_of(homography(flat, ray)) for flat, ray in zip(corners, rays)]
    return lens, tuple(np.array(part) for part in zip(*found)), first[kept]


def _require_inside(setup: CameraSetup, data, at: np.ndarray) -> None:
    """Pixels lie inside of the picture, where its size is known."""
    if setup.size is None:
        return
    pixels = data.pixel[at]
    outside = at[((pixels < -EDGE_PX) | (pixels > np.array(setup.size) - 1.0 + EDGE_PX)).any(axis=1)]
    if outside.size:
        u, v = data.pixel[outside[0]]
        raise InputError(f"({u:g}, {v:g}) lies outside of a picture of {setup.size[0]} by {setup.size[1]} "
                         "pixels; expected size_px = [width, height] in the fixture file, and u, v from the "
                         "left and from the top", row=int(data.row[outside[0]]), file=data.first_file,
                         column="u_px")


def _first_lens(
    setup: CameraSetup, corners: list[np.ndarray], pixels: list[np.ndarray], data
) -> tuple[float, ...]:
    every = np.concatenate(pixels)
    middle = 0.5 * (every.min(axis=0) + every.max(axis=0))
    if setup.size is not None:
        middle = 0.5 * np.asarray(setup.size, float)
    focal = focal_length([homography(flat, seen - middle) for flat, seen in zip(corners, pixels)])
    if focal is None:
        raise InputError("no picture shows the board tilted, so that nothing tells the focal length; "
                         "expected pictures from several sides, or [camera] focal_px in the fixture file",
                         file=data.first_file, column="u_px")
    return (focal, focal, *map(float, middle), 0.0, 0.0, 0.0, 0.0, 0.0)


def _spread(corners: np.ndarray) -> bool:
    flat = corners[:, :2] - corners[:, :2].mean(axis=0)
    return len(corners) >= LEAST_CORNERS and np.linalg.matrix_rank(flat, tol=0.1) == 2


def _targets(view, at: np.ndarray) -> Pose:
    """(K, 3, 3), (K, 3): the target of the rows `at`."""
    moved = view.signals["displacement"][at]
    rotation = view.signals["target_rotation"][at].reshape(-1, 3, 3)
    return exp(moved[:, 3:]) @ rotation, view.signals["target"][at] + moved[:, :3]
