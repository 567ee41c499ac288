"""How sharply dry friction turns over at a reversal, axis by axis: the width w of tanh(rate / w).

No robot file declares it, and a wrong one leaves a peak at every reversal that looks like breakaway torque.
Each axis takes the width at which its own torque leaves least, with friction, all free parameters and smooth
curves of angle, rate, acceleration and load fitted (a cause that is not declared must not hide the peaks);
the one of the record unless another is clearly better.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import Layout, MotionRecord, predict_motion
from exactarm.effects.drive import smooth_sign
from exactarm.robot.robot import Robot
from exactarm.view import SIGN_WIDTH_RAD_S

_WIDTHS_RAD_S = (1e-3, 2.5e-3, 5e-3, 1e-2, SIGN_WIDTH_RAD_S, 4e-2, 8e-2, 0.16)
_CLEARLY = 0.99  # of the square sum
_DEPENDENT = 1e-9  # of a column: what is left of it is rounding


def friction_widths(robot: Robot, layout: Layout, record: MotionRecord, threads: int = 1) -> np.ndarray:
    """(n,) rad/s on the output side; `layout`: what is identified."""
    widths = record.sign_width.copy()
    rubbed = [e.index for e in layout.effects if e.reverses]
    if not rubbed:
        return widths
    prediction = predict_motion(robot, layout, record, threads=threads)
    view, keep = prediction.view, record.keep
    rate = view.signals["theta_dot"] / robot.controller_ratios
    signs = [record.smooth(smooth_sign(rate, width, view.swing)[0]) for width in _WIDTHS_RAD_S]
    near = record.smooth(smooth_sign(rate, record.sign_width, view.swing)[0])
    residual = prediction.residual()
    for axis in rubbed:
        columns = np.column_stack([prediction.jacobian[keep, axis],
                                   record.smooth(_smooth_curves(view, rate, axis))[keep]])
        columns = columns[:, np.any(columns, axis=0)]
        # What the usual width has explained lies in the span of the columns: only the peaks at reversals are
        # at stake.
        coulomb = view.robot.joints[axis].coulomb
        left = _squares(columns, near[keep, axis], [sign[keep, axis] for sign in (near, *signs)],
                        residual[keep, axis], coulomb)
        best = int(np.argmin(left))
        if left[best] < _CLEARLY * left[0]:
            widths[axis] = _WIDTHS_RAD_S[best - 1]
    return widths


def _smooth_curves(view, rate: np.ndarray, axis: int) -> np.ndarray:
    """(N, c) what a torque may follow without jumping at a reversal."""
    v, q, load = np.abs(rate[:, axis]), view.q[:, axis], view.torque[:, axis]
    return np.column_stack([np.ones_like(v), v, v * rate[:, axis], view.signals["q_ddot"][:, axis], np.cos(q),
                            np.sin(q), load])


def _squares(columns, near, signs, residual, coulomb) -> list[float]:
    """Square sums left by the free parameters where dry friction follows each of `signs` in place of
    `near`."""
    size = np.linalg.norm(columns, axis=0)
    dry = columns.T @ near / (size * np.linalg.norm(near)) > 1.0 - 1e-9
    basis, weights = np.linalg.svd(columns[:, ~dry] / size[~dry], full_matrices=False)[:2]
    basis = basis[:, weights > _DEPENDENT * weights.max(initial=0.0)]
    clear = lambda values: values - basis @ (basis.T @ values)
    target, found = clear(residual + (coulomb or 0.0) * near), []
    for sign in signs:
        way = clear(sign)
        way = way / max(np.linalg.norm(way), _DEPENDENT * np.linalg.norm(sign), np.finfo(float).tiny)
        found.append(float(target @ target - (target @ way) ** 2))
    return found
