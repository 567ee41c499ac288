"""Certified error: an ellipsoid that holds 95 % of the target's errors, pose by pose.

    S(q) = J C J' + J_f C_f J_f' + sum_j sd_j(phi_j)^2 u_j u_j' + noise^2 I                  (3, 3), m^2

J (3, P): of the target by the parameters whose covariance C the robot file carries, with base and tool frames
moved along as the rows of the set-up fit them; J_f, C_f: of those frames; u_j: what a turn of axis j does,
sd_j of the curves of its gear (known_curve.py: the prior's where the curve was not measured); noise of the
fit.

Conformal (Vovk, Gammerman and Shafer 2005): with scores s_i = e_i' S_i^-1 e_i of m rows that chose nothing,
e_i = (1 - H_ii)^-1 r_i their residuals as they would be with frames of the other rows (H_ii: how far the
frames follow row i), the ellipsoid e' S^-1 e <= s_(k), k = ceil((m + 1) 0.95), holds a further error of the
same kind with a probability of 95 % or a little more, whatever S is. It holds for poses like the judged ones;
elsewhere S alone carries it. The error is measured minus predicted: the device's noise is in it.

Without any measured rows (`model_uncertainty`, for plans and programs) S is that of the identification alone,
in the frame of the measuring device of its first set-up: base and tool frame are among its parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.base import Station
from exactarm.effects.frames import Frames
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, geometry_layout
from exactarm.identify.planned import pose_data
from exactarm.numerics.factors import lstsq, pinv
from exactarm.robot.robot import Robot
from exactarm.view import View

LEVEL = 0.95
CHI_SQUARE = 7.814727903251179  # its quantile for three degrees of freedom: that of the scores if S is right
LEAST_ROWS = 19  # (m + 1) 0.95 <= m: with fewer rows no finite ellipsoid holds 95 %
_LEAST_NOISE_M = 1e-9  # keeps the covariance of a simulation without noise invertible
_MOST_FOLLOWED = 0.9  # of a row by its frames: one of a set-up of four rows says hardly anything of them
MOST_ROWS = 4000  # that the frames are moved along by: 1 kB a row at work


@dataclass(frozen=True)
class PoseUncertainty:
    """covariance (K, 3, 3) m^2, scaled: the ellipsoid is e' covariance^-1 e <= CHI_SQUARE; half_axes (K, 3)
    m, the longest last; position (K, 3) m of the target in the device's frame; rows: judged, that chose
    nothing; scale of the variance; coverage: share of the rows of one random half inside the ellipsoids
    scaled by the other half, both ways; own: they are validation rows of the data that the robot comes from;
    with_parameters: the robot file has a covariance."""

    covariance: np.ndarray
    half_axes: np.ndarray
    position: np.ndarray
    rows: int
    scale: float
    coverage: float
    own: bool
    with_parameters: bool

    @property
    def radius(self) -> np.ndarray:
        """(K,) m: of the smallest sphere around the ellipsoid."""
        return self.half_axes[:, -1]


def pose_uncertainty(robot: Robot, frames: Layout, data: Dataset, residual: np.ndarray, poses: Dataset,
                     seed: int, threads: int = 1) -> PoseUncertainty:
    """frames: as fitted to `data`; `residual` (N, 3): measured minus predicted; poses: to be judged."""
    judged, own = _judged(robot, data, seed)
    if len(judged) < LEAST_ROWS:
        raise InputError(f"{len(judged)} rows that were never fitted; expected at least {LEAST_ROWS} for an "
                         "ellipsoid that holds 95 %", file=data.first_file)
    if not set(poses.session.tolist()) <= set(data.session.tolist()):
        poses = replace(poses, session=np.full(len(poses), data.session.min()))
    moved = _Moved.by(robot, frames, data.select(_evenly(len(data))), threads)
    of_rows, _ = moved.covariance(data.select(judged))
    error = moved.left_out(data.select(judged), residual[judged])
    scores = np.einsum("ni,ni->n", error, np.linalg.solve(of_rows, error[:, :, None])[:, :, 0])
    quantile = conformal_quantile(scores)
    covariance, position = moved.covariance(poses)
    values = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    return PoseUncertainty(
        covariance * quantile / CHI_SQUARE, np.sqrt(values * quantile), position, len(judged),
        quantile / CHI_SQUARE, half_coverage(scores, seed), own, robot.covariance is not None)


def model_uncertainty(robot: Robot, q: np.ndarray, threads: int = 1) -> np.ndarray | None:
    """(K,) m: radius that holds 95 % of the target's errors at joint angles q (K, n), by the covariance, the
    curves and the remaining noise that the robot file carries. None where it carries no covariance of its
    frames. Rows with NaN stay NaN."""
    known = robot.covariance
    placed = [name for name in (known.names if known else ()) if name.startswith("session_")]
    if known is None or not placed:
        return None
    session = int(placed[0].partition(".")[0].removeprefix("session_"))
    frames = Layout.of((Frames.of(session, robot.base, robot.tool, False),))  # a turned tool moves no target
    radius = np.full(len(q), np.nan)
    good = np.flatnonzero(np.isfinite(q).all(axis=1))
    for rows in np.array_split(good, max(1, -(-len(good) // MOST_ROWS))):
        if rows.size:
            data = replace(pose_data(q[rows]), session=np.full(len(rows), session))
            layout = _open(frames.joined(geometry_layout(robot)).joined(carried_layout(robot, data)),
                           set(known.names))
            prediction = predict_poses(robot, layout, data, threads=threads)
            factor = known.matrix()[[known.names.index(name) for name in layout.names]]
            parts = [prediction.jacobian[:, :3] @ factor, *_curves(layout, prediction.view)]
            covariance = sum(part @ part.transpose(0, 2, 1) for part in parts) + known.noise_m**2 * np.eye(3)
            radius[rows] = np.sqrt(CHI_SQUARE * np.linalg.eigvalsh(covariance)[:, -1])
    return radius


def conformal_quantile(scores: np.ndarray) -> float:
    """The ceil((m + 1) 0.95)-th of m scores; inf where m is too small."""
    place = int(np.ceil((len(scores) + 1) * LEVEL))
    return float(np.sort(scores)[place - 1]) if place <= len(scores) else np.inf


def half_coverage(scores: np.ndarray, seed: int) -> float:
    """Share of the scores of each random half below the quantile of the other half."""
    halves = np.array_split(np.random.default_rng(seed).permutation(len(scores)), 2)
    inside = [scores[a] <= conformal_quantile(scores[b]) for a, b in (halves, halves[::-1])]
    return float(np.mean(np.concatenate(inside)))


def _judged(robot: Robot, data: Dataset, seed: int) -> tuple[np.ndarray, bool]:
    """Rows that chose nothing: all of data that the robot has not seen, the validation rows of its own."""
    known = [entry for entry in robot.record.get("data", []) if isinstance(entry, dict)]
    if data.is_of(known):
        return np.flatnonzero(~data.split(int(robot.record.get("seed", seed)))), True
    shared = data.shared_files(known)
    fitted = shared[data.file_index] if shared.any() else np.zeros(len(data), bool)
    return np.flatnonzero(~fitted), False  # another selection of rows: how they were split is not known


def _evenly(count: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(int))


@dataclass(frozen=True)
class _Moved:
    """Parameters with a known covariance, and how far the frames move along with each of them."""

    robot: Robot
    layout: Layout
    of_frames: np.ndarray  # (P,) bool
    along: np.ndarray  # (F, B) frames by parameters
    factor: np.ndarray  # (B, r)
    frame_factor: np.ndarray  # (F, F)
    noise: float
    threads: int

    @staticmethod
    def by(robot: Robot, frames: Layout, data: Dataset, threads: int) -> _Moved:
        known = robot.covariance
        names = {} if known is None else {name: place for place, name in enumerate(known.names)}
        layout = frames.joined(_open(geometry_layout(robot).joined(carried_layout(robot, data)), set(names)))
        of_frames = np.concatenate([np.full(int(free.sum()), effect.frames_of is not None)
                                    for effect, free in zip(layout.effects, layout.free)])
        prediction = predict_poses(robot, layout, data, threads=threads)
        jacobian = prediction.jacobian[:, :3].reshape(-1, layout.size)
        f, b = jacobian[:, of_frames], jacobian[:, ~of_frames]
        norm = np.maximum(np.linalg.norm(f, axis=0), 1e-300)
        along = -lstsq(f / norm, b, rcond=1e-10)[0] / norm[:, None]
        noise = float(np.sqrt(np.mean(prediction.residual()[:, :3] ** 2))) if known is None else known.noise_m
        inverse = pinv(f / norm, rcond=1e-10) / norm[:, None]
        rows = [names[name] for name, mine in zip(layout.names, of_frames) if not mine]
        factor = known.matrix()[rows] if known is not None else np.zeros((0, 0))
        of_frame = noise * _root(inverse @ inverse.T)
        return _Moved(robot, layout, of_frames, along, factor, of_frame, max(noise, _LEAST_NOISE_M), threads)

    def covariance(self, data: Dataset) -> tuple[np.ndarray, np.ndarray]:
        """S (N, 3, 3) and the target's position (N, 3)."""
        prediction = predict_poses(self.robot, self.layout, data, threads=self.threads)
        jacobian = prediction.jacobian[:, :3]
        f, b = jacobian[:, :, self.of_frames], jacobian[:, :, ~self.of_frames]
        parts = [f @ self.frame_factor, *_curves(self.layout, prediction.view)]
        if self.factor.size:
            parts.append((b + f @ self.along) @ self.factor)
        covariance = sum((part @ part.transpose(0, 2, 1) for part in parts), np.zeros((len(data), 3, 3)))
        return covariance + self.noise**2 * np.eye(3), prediction.position

    def left_out(self, data: Dataset, residual: np.ndarray) -> np.ndarray:
        """(N, 3) m: what residuals (N, 3) of rows that the frames are fitted to would be without them."""
        f = predict_poses(self.robot, self.layout, data, threads=self.threads).jacobian[:, :3, self.of_frames]
        rows = f @ self.frame_factor / self.noise
        follows, axes = np.linalg.eigh(rows @ rows.transpose(0, 2, 1))
        along = (axes.transpose(0, 2, 1) @ residual[:, :, None])[:, :, 0]
        along /= 1.0 - np.minimum(follows, _MOST_FOLLOWED)
        return (axes @ along[:, :, None])[:, :, 0]


def _root(matrix: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _open(layout: Layout, names: set[str]) -> Layout:
    """The layout with the named parameters free, and no others."""
    masks = [np.array([effect.parameter_label(p) in names for p in effect.parameters()], bool)
             for effect in layout.effects]
    return Layout(layout.effects, tuple(masks))


def _curves(layout: Layout, view: View) -> list[np.ndarray]:
    """(N, 3, 1) of every curve: its standard deviation times what a turn of its axis does."""
    found, unit = [], np.ones((view.rows, 1, 1))
    for effect in layout.effects:
        deviation = effect.deviation(view.phi)
        if deviation is not None:
            turn = view.transfers[Station.GEAR]((effect.index,), unit)[:, :3]
            found.append(deviation[:, None, None] * turn)
    return found
