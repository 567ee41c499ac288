"""Missing tilts: parallel axes whose frame has no beta, where what is left of a fit asks for one.

    F = gain of one more column b / what is left per degree of freedom,   b: d target / d beta, cleared of the
    fitted columns

Between parallel axes d, a and alpha of a frame leave one direction out, the tilt about its y axis (Hayati
1983). A SCARA's slide or a maker's table of four parameters lacks it, and nothing else can stand for it; so
the line says which frame, how much, and what to write. Source: Rao's score test, to first order.
"""

import numpy as np
from scipy import special

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.split import pose_groups
from exactarm.effects.geometry import Geometry
from exactarm.identify.collision import NEARLY_PARALLEL_RAD, deviation_from_parallel
from exactarm.identify.repeats import worth_of_rows
from exactarm.robot.robot import Robot

CHANCE = 1e-4  # of one such line in ten thousand calibrations of an arm that lacks nothing


def missing_tilts(robot: Robot, layout: Layout, data: Dataset, threads: int = 1) -> tuple[str, ...]:
    """One line for all frames that should have a beta; empty where the rows ask for none."""
    frames = [i for i, joint in enumerate(robot.joints[:-1]) if joint.beta is None
              and deviation_from_parallel(robot, i + 1, i + 2) < NEARLY_PARALLEL_RAD]
    if not frames:
        return ()
    tilts = Layout.of(tuple(Geometry(i + 1, (0.0,), ("beta_rad",)) for i in frames))
    found = predict_poses(robot, layout.joined(tilts), data, threads=threads)
    left = found.residual()
    worth = worth_of_rows(left, pose_groups(data), layout.size)
    root = np.sqrt(worth)[:, None]
    columns = (root[:, :, None] * found.jacobian[:, :3]).reshape(-1, layout.size + len(frames))
    fitted, added = columns[:, : layout.size], columns[:, layout.size :]
    basis = np.linalg.svd(fitted / np.maximum(np.linalg.norm(fitted, axis=0), 1e-300), full_matrices=False)
    basis = basis[0][:, basis[1] > 1e-9 * basis[1][0]]
    cleared = lambda values: values - basis @ (basis.T @ values)
    rest, added = cleared((root * left).ravel()), cleared(added)
    freedom = 3.0 * float(worth.sum()) - basis.shape[1] - len(frames)
    if freedom < 1:
        return ()
    sizes = np.linalg.lstsq(added, rest, rcond=1e-9)[0]
    still = float(np.sum((rest - added @ sizes) ** 2))
    share = 1.0 - still / max(float(rest @ rest), 1e-300)
    chance = special.fdtrc(len(frames), freedom, share / max(1.0 - share, 1e-12) * freedom / len(frames))
    if chance > CHANCE:
        return ()
    listed = lambda words: ", ".join(map(str, words))
    return (
        f"the robot file has no beta in frame {listed(i + 1 for i in frames)}, whose axis is parallel to the "
        f"next one; a tilt of {listed(f'{1e3 * size:.2g}' for size in sizes)} mrad there explains "
        f"{100.0 * share:.0f} % of what is left (square sum): write beta_rad = 0.0 in place of d there",)
