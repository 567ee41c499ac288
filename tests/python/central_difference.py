"""The one check that every analytic derivative in Python passes: central differences with Richardson
extrapolation.

    D(h) = (f(x + h) - f(x - h)) / 2h,   derivative ~ (4 D(h/2) - D(h)) / 3
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def central_difference(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step) -> np.ndarray:
    """df/dx (..., P) of `function` at `x` (P,); `step`: one number or (P,), the larger of the two steps."""
    x = np.asarray(x, float)
    steps = np.broadcast_to(np.asarray(step, float), x.shape)
    columns = []
    for k, h in enumerate(steps):
        slopes = []
        for size in (h, 0.5 * h):
            ahead, behind = x.copy(), x.copy()
            ahead[k] += size
            behind[k] -= size
            slopes.append(
                (np.asarray(function(ahead)) - np.asarray(function(behind))) / (ahead[k] - behind[k])
            )
        columns.append((4.0 * slopes[1] - slopes[0]) / 3.0)
    return np.stack(columns, axis=-1) if columns else np.zeros(0)


def assert_derivative(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, analytic: np.ndarray, step, *,
    relative: float | np.ndarray = 1e-6
) -> None:
    """Fails, naming the column, unless each column of `analytic` (..., P) agrees to `relative`, one number or
    (P,), of its largest entry."""
    numeric = central_difference(function, x, step)
    assert numeric.shape == np.shape(analytic), f"shape {np.shape(analytic)}, expected {numeric.shape}"
    values = np.abs(np.asarray(function(np.asarray(x, float))))
    steps, shares = (np.broadcast_to(np.asarray(each, float), np.shape(x)) for each in (step, relative))
    for k in range(numeric.shape[-1]):
        difference = np.max(np.abs(numeric[..., k] - analytic[..., k]), initial=0.0)
        size = np.max(np.abs(numeric[..., k]), initial=0.0)
        rounding = 30.0 * np.finfo(float).eps * np.max(values, initial=0.0) / steps[k]
        assert difference <= shares[k] * size + rounding, (
            f"column {k}: largest difference {difference:.3g}, largest entry {size:.3g}, rounding "
            f"{rounding:.3g}"
        )
