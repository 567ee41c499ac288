"""The linear picture of static poses, where every row stands for itself: what moves a row passes through few
signals of a station, most often one angle of an axis.

A change D (N, c, k) of c signals moves the whitened measurement by C = T D, T (N, m, c) its response to each
signal. The products that a scan asks of C,

    C'C = D'(T'T) D,    Q'C = (T'Q)' D,    C'r = (T'r)' D,

take c numbers a row in place of m once T'T (N, c, c), T'Q (N, c, b) and T'r (N, c) are there.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from exactarm.diagnose.fitted import Fitted, Products
from exactarm.effects.base import Effect


class PoseFitted(Fitted):
    def along(self, pattern: np.ndarray) -> Callable[[np.ndarray], Products]:
        passage = _Passage.of(self, pattern[:, :, None])
        return lambda values: passage.products([values[:, None]])[0]

    def _scanned(self, effects: list[Effect], masks: list[np.ndarray]) -> list[Products]:
        changes, found = defaultdict(dict), {}
        for place, (effect, mask) in enumerate(zip(effects, masks)):
            change, station = effect.change(self.view), effect.station_in(self.view)
            changes[station, tuple(change.columns)][place] = change.by_parameters[:, :, mask]
        for (station, columns), parts in changes.items():
            each = np.tile(np.eye(len(columns)), (self.view.rows, 1, 1))
            response = self.view.transfers[station](columns, each)[:, : self.residual.shape[1]]
            found |= zip(parts, _Passage.of(self, response).products(list(parts.values())))
        return [found[place] for place in range(len(effects))]


@dataclass(frozen=True)
class _Passage:
    """gram (N, c, c) = T'T, absorbed (N c, b) = T'Q, onto (N c,) = T'r."""

    gram: np.ndarray
    absorbed: np.ndarray
    onto: np.ndarray

    @staticmethod
    def of(fitted: PoseFitted, response: np.ndarray) -> _Passage:
        """Of the response (N, m, c) of the measurement to c signals."""
        turned = np.swapaxes(response * fitted.scale[:, :, None], 1, 2)
        rows, c, m = turned.shape
        basis, residual = (each[: rows * m].reshape(rows, m, -1)
                           for each in (fitted.basis, fitted.free_residual))
        return _Passage(turned @ np.swapaxes(turned, 1, 2), (turned @ basis).reshape(rows * c, -1),
                        (turned @ residual).ravel())

    def products(self, parts: list[np.ndarray]) -> list[Products]:
        """Of changes (N, c, k)."""
        changes = np.concatenate(parts, axis=2)
        gram = self.gram
        moved = gram * changes if gram.shape[1] == 1 else gram @ changes
        flat, moved = (each.reshape(len(self.onto), -1) for each in (changes, moved))
        absorbed, onto = self.absorbed.T @ flat, self.onto @ flat
        ends = np.cumsum([part.shape[2] for part in parts])
        where = [slice(end - part.shape[2], end) for part, end in zip(parts, ends)]
        return [Products.of(flat[:, at].T @ moved[:, at], absorbed[:, at], onto[at]) for at in where]
