"""Is a known length of a fixture wrong, or too short? All lengths of the arm then leave their drawing by one
factor, or have one in common that hardly anything tells.

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
_UNCALIBRATED_M = 1e-3  # what an arm errs by that nobody has calibrated


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


def scale_doubt(layout: Layout, fit: Fit, drawing: Mapping[str, tuple[float, float]],
                reach_m: float) -> tuple[str, ...]:
    """One line where the common factor of all lengths is known so little that at its reach the arm may err as
    if it had not been calibrated: short known lengths hardly fix it, whatever the touches leave."""
    mine = [i for i, name in enumerate(layout.names) if name in drawing and name.unit == "m"]
    lengths = layout.values[mine]
    square = float(lengths @ lengths)
    if square == 0.0:
        return ()
    deviation = np.sqrt(float(lengths @ fit.covariance[np.ix_(mine, mine)] @ lengths)) / square
    half = float(fit.half_width(deviation))
    if half * reach_m <= _UNCALIBRATED_M:
        return ()
    return (f"the known lengths tell the common factor of all lengths to {1e3 * half:.2g} mm per m, "
            f"{1e3 * half * reach_m:.2g} mm at the arm's reach, whatever the touches leave: a longer known "
            "distance narrows it",)
