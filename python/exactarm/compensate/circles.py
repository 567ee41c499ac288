"""Circular motions: what a program says of their middle points and the controller does not do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.program import Program
from exactarm.compensate.ways import listed
from exactarm.numerics.rotation import turn

OFF_THE_WAY_RAD = 0.1  # by which an error of 1 mm, or 1 mrad at 1 m, changes by 0.1 mm


def odd_middles(program: Program, q: np.ndarray, poses: Poses) -> list[str]:
    """What is told of middle points that have another orientation than the arm on the way between both ends.

    q (T, n), poses: of the flange at the targets; NaN where they are not known.
    """
    known = ~np.isnan(q).any(axis=1)
    rows = [
        (before.target, motion.via, motion.target, motion.line)
        for before, motion in pairwise(program.motions)
        if motion.via is not None
        and all(i is not None and known[i] for i in (before.target, motion.via, motion.target))
    ]
    if not rows:
        return []
    start, via, end, lines = np.array(rows).T
    part, whole = (turn(np.swapaxes(poses.rotation[start], 1, 2) @ poses.rotation[i])
                   for i in (via, end))
    along = np.sum(part * whole, axis=1) / np.maximum(np.sum(whole**2, axis=1), np.finfo(float).tiny)
    off = np.linalg.norm(part - np.clip(along, 0.0, 1.0)[:, None] * whole, axis=1)
    odd = [f"{program.targets[via[k]].name} (line {lines[k]}, {np.degrees(off[k]):.0f} deg)"
           for k in np.flatnonzero(off > OFF_THE_WAY_RAD)]
    return [
        "middle points of circles whose orientation is not on the way between both ends (most controllers "
        f"take their place alone); they are corrected as they are written: {listed(odd)}"
    ] if odd else []
