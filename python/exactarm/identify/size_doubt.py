"""Is a known length of a fixture wrong? All lengths of the arm then leave their drawing by one factor.

    x_i - x0_i = s x0_i + e_i,    e_i: what this arm's lengths miss their drawing by in any case

s by least squares over the arm's lengths that the data tell, with Student's t of so many less one: the e_i
themselves, and no tolerance, say how sure that is.
"""

from collections.abc import Mapping

import numpy as np
from scipy import special

from exactarm.chain import Layout
from exactarm.numerics.regression import Fit

_BY_CHANCE = 1e-4  # of arms that are right, of which the line is said
_TOLD = 0.9  # of its deviation from the drawing, which is the standard error of a length that no row shows
_LEAST = 4  # lengths


def size_doubts(layout: Layout, fit: Fit, drawing: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
    """One line where all lengths of the arm grew or shrank alike; `drawing` by the names of `layout`."""
    error = np.sqrt(np.diag(fit.covariance))
    told = [(drawing[name][0], value) for name, value, sd in zip(layout.names, layout.values, error)
            if name in drawing and name.unit == "m" and sd < _TOLD * drawing[name][1]]
    if len(told) < _LEAST:
        return ()
    drawn, found = np.array(told).T
    square = float(drawn @ drawn)
    growth = float(drawn @ (found - drawn)) / max(square, np.finfo(float).tiny)
    left = float(np.sum((found - drawn - growth * drawn) ** 2)) / (len(told) - 1)
    sure = abs(growth) * np.sqrt(square / max(left, np.finfo(float).tiny))
    if 2.0 * special.stdtr(len(told) - 1, -sure) > _BY_CHANCE:
        return ()
    more = "longer" if growth > 0.0 else "shorter"
    return (f"the lengths of the arm come out {abs(growth):.2%} {more} than its drawing, all alike: is a "
            "known length (of the fixture, a bar, the board's squares, a tracker) wrong by the factor "
            f"{1.0 + growth:.4g}?",)
