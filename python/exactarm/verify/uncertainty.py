"""Uncertainty of the position that a model predicts, after the Guide to the Expression of Uncertainty in
Measurement (GUM).

Measurand: one coordinate of the target's position at any pose of the judged work space, as the model with
fitted frames says.

    u^2 = u_instrument^2 + u_repeatability^2 + u_frames^2 + u_model^2,   U = k u

instrument     type B, as its certificate says; left out where nobody gave it
repeatability  type A: pooled standard deviation of a coordinate over visits of one pose
frames         type A: of base and tool frame by the rows that found them, propagated to the judged poses
model          type A: what the held-out residual has beyond those before it. Without repeated visits it holds
repeatability too

k for 95 % from Student's t with the effective degrees of freedom of Welch and Satterthwaite. The radius that
holds 95 % of the positions in space: u sqrt(3 F) with F the 95 % point of Fisher's distribution;
`share_within` is how many held-out rows lie inside, the check of the whole. Limits: coordinates alike and
independent; errors of the model are not Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.data.dataset import Dataset
from exactarm.data.split import pose_groups
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.verify.held_out import Judged

LEVEL = 0.95
MANY = 1e9  # degrees of freedom of what is taken as known


@dataclass(frozen=True)
class Entry:
    """One source: standard uncertainty u of a coordinate (m), how it was evaluated (A, B), degrees of
    freedom."""

    source: str
    kind: str
    u: float
    freedom: float
    how: str


@dataclass(frozen=True)
class Budget:
    """entries; u (m), effective degrees of freedom, k, U = k u (m), radius in space (m), share of held-out
    rows within it."""

    entries: tuple[Entry, ...]
    u: float
    freedom: float
    coverage_factor: float
    expanded: float
    radius: float
    share_within: float


def budget(data: Dataset, judged: Judged, instrument: float | None) -> Budget:
    """data: the judged rows; instrument: standard uncertainty of one coordinate (m), None where it is not
    known."""
    repeat, repeat_freedom = _repeatability(data)
    frames = float(np.mean(judged.frames))
    rest = float(np.mean(judged.residual**2))
    poses = len(np.unique(pose_groups(data)))
    entries = []
    if instrument is not None:
        entries.append(
            Entry("instrument", "B", instrument, MANY, "as given, standard uncertainty of one coordinate")
        )
    if repeat_freedom:
        entries.append(
            Entry("repeatability", "A", np.sqrt(repeat), repeat_freedom, "visits of one pose, pooled")
        )
    entries.append(
        Entry(
            "frames",
            "A",
            np.sqrt(frames),
            judged.freedom,
            "fit of base and tool, propagated to the judged poses",
        )
    )
    name = "model" if repeat_freedom else "model and repeatability"
    entries.append(
        Entry(
            name,
            "A",
            np.sqrt(max(rest - repeat - frames - (instrument or 0.0)**2, 0.0)),
            max(poses - 1, 1),
            "held-out residual without the above",
        )
    )
    variance = sum(entry.u**2 for entry in entries)
    u = float(np.sqrt(variance))
    freedom = (
        float(variance**2 / max(sum(entry.u**4 / entry.freedom for entry in entries), 1e-300))
        if u > 0.0
        else MANY
    )
    freedom = min(freedom, MANY)
    k = float(special.stdtrit(freedom, 0.5 + 0.5 * LEVEL))
    radius = u * float(np.sqrt(3.0 * special.fdtri(3.0, freedom, LEVEL)))
    return Budget(tuple(entries), u, freedom, k, k * u, radius, float(np.mean(judged.error <= radius)))


def _repeatability(data: Dataset) -> tuple[float, int]:
    """Variance of one coordinate (m^2) over visits of one pose in one session, and its degrees of freedom; 0,
    0 without any."""
    groups = np.unique(np.stack([data.session, pose_groups(data)], axis=1), axis=0, return_inverse=True)[
        1
    ].ravel()
    counts = np.bincount(groups)
    mean = np.stack([np.bincount(groups, data.position[:, i]) / counts for i in range(3)], axis=1)[groups]
    freedom = 3 * int(np.sum(counts - 1))
    return (float(np.sum((data.position - mean) ** 2)) / freedom, freedom) if freedom else (0.0, 0)


def mean_with_interval(data: Dataset, error: np.ndarray) -> tuple[float, float, float]:
    """Mean of errors (M,) with its 95 % interval; rows of one pose count as one observation."""
    groups = pose_groups(data)
    sums, counts = np.bincount(groups, error), np.bincount(groups)
    mean, poses = float(np.mean(error)), len(counts)
    if poses < 2:
        return mean, float("nan"), float("nan")
    spread = float(np.sqrt(poses / (poses - 1) * np.sum((sums - counts * mean) ** 2))) / len(error)
    half = float(special.stdtrit(poses - 1, 0.5 + 0.5 * LEVEL)) * spread
    return mean, mean - half, mean + half


def by_region(
    points: np.ndarray, in_base: np.ndarray, before: np.ndarray, after: np.ndarray
) -> list[tuple[str, ErrorSummary, ErrorSummary]]:
    """Errors by where the target is (M, 3), in DH frame 0 and in the controller's base frame: three equal
    ranges of the distance from the first axis, and of the height over the base."""
    out = []
    for name, value in (("reach", np.hypot(points[:, 0], points[:, 1])), ("height", in_base[:, 2])):
        edges = np.linspace(value.min(), value.max(), 4)
        told = np.round(edges, 2) + 0.0  # no minus before a zero
        for k, (low, high) in enumerate(zip(edges[:-1], edges[1:])):
            inside = (value >= low) & ((value < high) | (high == edges[-1]))
            if inside.any():
                label = f"{name} {told[k]:.2f} to {told[k + 1]:.2f} m"
                out.append((label, summarise(before[inside]), summarise(after[inside])))
    return out
