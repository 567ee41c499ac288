"""Observability indices of a set of poses (thesis (3.10), (3.11); Sun and Hollerbach 2008).

With the singular values s_1 >= ... >= s_m > 0 of the stacked identification Jacobian of K poses:

    O1 = (s_1 ... s_m)^(1/m) / sqrt(K)    O2 = s_m / s_1    O3 = s_m
    O4 = s_m^2 / s_1                      O5 = 1 / (1/s_1 + ... + 1/s_m)

Scaling, the same everywhere: one column = metres of measured displacement per 1 m or 1 rad (as the source has
it), and for a parameter of any other unit per 1000 times its plausible magnitude: then a thousandth of each
scaled parameter (1 mm, 1 mrad, the plausible magnitude) counts alike.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from exactarm.effects.parameter_id import ParameterId

_PLAUSIBLE_COUNTS_AS = 1e-3


@dataclass(frozen=True)
class Observability:
    """The five indices; larger is better for every one of them. All 0 where a singular value vanishes."""

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float

    def as_dict(self) -> dict[str, float]:
        return asdict(self)


def observability(singular_values: np.ndarray, poses: int) -> Observability:
    """Indices of m singular values (scaled columns) of a Jacobian stacked from K = `poses` poses."""
    values = np.asarray(singular_values, float)
    if values.size == 0 or values.min() <= 0.0 or poses < 1:
        return Observability(0.0, 0.0, 0.0, 0.0, 0.0)
    largest, smallest = values.max(), values.min()
    return Observability(O1=float(np.exp(np.mean(np.log(values))) / np.sqrt(poses)),
                         O2=float(smallest / largest), O3=float(smallest), O4=float(smallest**2 / largest),
                         O5=float(1.0 / np.sum(1.0 / values)))


def column_scale(names: Sequence[ParameterId], plausible: Sequence[float] | None = None) -> np.ndarray:
    """(P,) factor of every column: 1 for lengths and angles, else 1000 times the plausible magnitude."""
    if plausible is None:
        return np.ones(len(names))
    pairs = zip(names, plausible)
    return np.array([1.0 if name.unit else float(size) / _PLAUSIBLE_COUNTS_AS for name, size in pairs])
