"""Outliers: rows of the record that are wrong by themselves (a broken beam, a wrong row), not by any cause in
the arm.

A row is left out when its Euclidean residual exceeds `threshold_m`, set from the robust spread of all rows:
median / sqrt(median of chi2_3) times sqrt of the chi2_3 quantile that one good row in a hundred sets of
this size would reach (Rousseeuw and Hubert 2011). It moves no prediction; it decides which rows count.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.numerics.together import lie_together

_LARGEST_SHARE = 0.2  # more than that is no longer a few wrong rows
_FALSE_ALARM = 0.01  # of a whole data set
_CLEAR_GAP = 4.0
# times a good row, what the next larger good one hardly exceeds: one in eight, where tails fall with the
# third power
_BEYOND_GOOD = 2.0


@dataclass(frozen=True)
class Outliers(Effect):
    """Threshold of the residual above which a row is left out; known: from which rows are wrong."""

    known: bool = False

    name = "outliers"
    plain = "single wrong measurements"
    station = Station.DEVICE
    of_record = True
    kinds = (POSES.name,)
    per_joint = False
    sentence = "single rows are wrong by themselves: those with more than {threshold_m:.3g} m are left out"
    source = "Rousseeuw and Hubert 2011"
    parameter_table = (Parameter("threshold_m", 1e-3, 0.0, fixed=True),)

    def change(self, view) -> Change:
        return Change((), np.zeros((view.rows, 0)), np.zeros((view.rows, 0, 1)))

    def keep(self, view) -> np.ndarray:
        return np.linalg.norm(view.data.position - view.measured[:, :3], axis=1) <= self.values[0]

    def leaving_out(self, view, rows):
        """These rows, and no others but for those that are as far from the good ones."""
        residual = view.data.position - view.measured[:, :3]
        norm = np.linalg.norm(residual, axis=1)
        good, wrong = self.threshold(residual), norm[rows].min()
        while (further := norm[~rows & (norm > good) & (norm <= _BEYOND_GOOD * good)]).size:
            good = float(further.max())
        limit = float(min(np.sqrt(good * wrong), _BEYOND_GOOD * good))
        return replace(self, values=(limit,), known=True) if wrong > good else self

    def renewed(self, view, again=False) -> Effect:
        if self.known:
            out = ~self.keep(view)
            return self.leaving_out(view, out) if out.any() else self
        residual = view.data.position - view.measured[:, :3]
        limit = _limit(residual, view.measured[:, :3]) or self.threshold(residual)
        return self.with_values((max(limit, self.values[0]) if again else limit,))

    @staticmethod
    def threshold(residual: np.ndarray) -> float:
        """From residuals (N, 3): what a good row hardly ever exceeds."""
        norm = np.linalg.norm(residual, axis=1)
        # quantiles of chi-squared with 3 degrees of freedom
        sigma = np.median(norm) / np.sqrt(2.0 * special.gammaincinv(1.5, 0.5))
        return float(sigma * np.sqrt(2.0 * special.gammainccinv(1.5, _FALSE_ALARM / max(len(norm), 1))))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """None where the wrong rows lie together, in measuring order or in space: that is a structure."""
        if view.data.position is None or "measured" not in view.signals:
            return ()
        limit = _limit(view.data.position - view.measured[:, :3], view.measured[:, :3])
        return () if limit is None else (cls(None, (limit,)),)


def _limit(residual: np.ndarray, position: np.ndarray) -> float | None:
    """m, beyond which rows of residuals (N, 3) at positions (N, 3) are wrong by themselves; None: no row
    is."""
    norm, rows = np.linalg.norm(residual, axis=1), np.arange(len(residual))
    usual = Outliers.threshold(residual)
    for limit in (usual, _gap(norm, usual)):
        wrong = norm > limit
        few = 0 < wrong.sum() <= _LARGEST_SHARE * len(wrong)
        if few and not any(lie_together(residual, wrong, place) for place in (rows, position)):
            return limit
    return None


def _gap(norm: np.ndarray, limit: float) -> float:
    """A limit between the gross rows and those that they have pulled the fit away from; infinite without a
    clear gap.

    Rows pulled out of place lie together around a gross one, but stay far smaller; a structure has no such
    gap.
    """
    above = np.sort(np.append(norm[norm > limit], limit))
    ratio = above[1:] / above[:-1]
    widest = int(np.argmax(ratio)) if len(ratio) else -1
    return (float(np.sqrt(above[widest] * above[widest + 1])) if widest >= 0 and ratio[widest] > _CLEAR_GAP
            else np.inf)
