"""How far an arm is from its drawing: one scale for all deviations, estimated with them.

    d_p = (x_p - c_p) / tau_p,      d_p ~ Student's t with 4 degrees of freedom and scale s

c_p: declared value, tau_p: plausible deviation of its kind (`Parameter.plausible`). With few poses, or a
coarse device, estimates scatter more than the arm deviates; drawn to the drawing as much as the data
themselves say (empirical Bayes), they predict poses better that were not measured. Where the data know more
than the drawing, nothing changes.

The scale maximises the evidence of the linear picture around a fit without a drawing (MacKay 1992; REML,
Harville 1977):

    s^2 = (sum w d^2 + 1) / (sum gamma + 1),     gamma_p = 1 - w_p V_pp / (s tau_p)^2

V: posterior covariance; gamma: share of a parameter that the data tell; the ones: one parameter as plausible
as it was declared, which decides where the data tell nothing. w_p = 5 / (4 + d_p^2 / s^2) (Lange, Little and
Taylor 1989) lets alone what is far off by itself: a zero that was set anew, an exchanged link.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import linalg

from exactarm.chain import Layout
from exactarm.identify.layout_fit import Drawing
from exactarm.numerics.regression import Fit

_TAILS = 4.0
_SETTLED, _ROUNDS = 1e-3, 200  # relative change of the scale


@dataclass(frozen=True)
class Drawn:
    """to: what each declared parameter is drawn to; scale: s; told: sum of gamma over those that are free."""

    to: Drawing = field(default_factory=dict)
    scale: float = 1.0
    told: float = 0.0

    @staticmethod
    def around(declared: Layout, layout: Layout, fit: Fit, drawing: Drawing | None = None) -> Drawn:
        """All parameters of `declared`, by the `fit` of those that `layout` has free; drawing: what that fit
        was drawn to, None = to nothing."""
        centre = dict(zip(declared.names, declared.values))
        plausible = {name: p.plausible for name, p in zip(declared.names, declared.parameters)}
        seen = ~fit.at_bound & (np.diag(fit.covariance) > 0.0)
        names = [name for name, free in zip(layout.names, seen) if free]
        drawn = np.array([name in centre for name in names], bool)
        scale, weight, told = 1.0, np.ones(0), 0.0
        if drawn.any():
            own = np.sqrt(np.diag(fit.covariance)[seen])
            unit = np.array([plausible.get(name, one) for name, one in zip(names, own)])
            x = fit.x[seen]
            deviation = (x - [centre.get(name, value) for name, value in zip(names, x)]) / unit
            known = linalg.pinvh(fit.covariance[np.ix_(seen, seen)] / np.outer(unit, unit))
            right = known @ deviation
            pulled = [drawing[name][1] if drawing and name in drawing else np.inf for name in names]
            scale, weight, told = _scale(known - np.diag((unit / pulled) ** 2), right, drawn)
        loose = dict(zip([name for name, one in zip(names, drawn) if one], 1.0 / np.sqrt(weight)))
        return Drawn({name: (value, float(scale * loose.get(name, 1.0) * plausible[name]))
                      for name, value in centre.items()}, scale, told)


FREE = Drawn()  # drawn to nothing


def _scale(known: np.ndarray, right: np.ndarray, drawn: np.ndarray) -> tuple[float, np.ndarray, float]:
    """s, w (d,) and the sum of gamma; known (P, P): information without a drawing, right (P,): it times its
    estimate, in units of tau; drawn (P,) bool."""
    scale, weight, told = 1.0, np.ones(int(drawn.sum())), 0.0
    for _ in range(_ROUNDS):
        pull = np.zeros(len(right))
        pull[drawn] = weight / scale**2
        covariance = np.linalg.inv(known + np.diag(pull))
        deviation = (covariance @ right)[drawn]
        told = float(np.sum(1.0 - np.clip(pull[drawn] * np.diag(covariance)[drawn], 0.0, 1.0)))
        new = float(np.sqrt((weight @ deviation**2 + 1.0) / (told + 1.0)))
        settled = abs(new / scale - 1.0) < _SETTLED
        scale, weight = new, (_TAILS + 1.0) / (_TAILS + (deviation / new) ** 2)
        if settled:
            break
    return scale, weight, told
