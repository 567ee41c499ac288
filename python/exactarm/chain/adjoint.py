"""Derivatives of the measured pose by all parameters, backwards through the stations: six numbers of a row
are measured, and hundreds of parameters may be free.

A_S (N, 6, s): derivative of the measurement by the signal S behind a change of it. Before the change, and for
the change's own parameters p,

    J_p = A_S[columns] by_parameters,    A_s += A_S[columns] by_signal[s]    for every signal s, S too.

What a parameter that carries the whole arm from a joint on does besides (`Change.carried`) is a further A of
the displacement, for such parameters alone.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field

import numpy as np

from exactarm.chain.layout import Layout
from exactarm.chain.propagate import Passed, rows_of


@dataclass
class Adjoint:
    """Workspace: jacobian (N, 6, P) so far; by: signal -> A; carried: (parameters (P,) bool, further A)."""

    layout: Layout
    jacobian: np.ndarray
    by: dict[str, np.ndarray]
    carried: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)

    def add(self, signal: str, part: np.ndarray) -> None:
        """part (N, 6, s): by the first s columns of the signal."""
        if signal in self.by and part.shape[2] < self.by[signal].shape[2]:
            part = np.pad(part, ((0, 0), (0, 0), (0, self.by[signal].shape[2] - part.shape[2])))
        self.by[signal] = self.by[signal] + part if signal in self.by else part

    def back(self, signal: str, passed: Passed, upstream: Container[str] | None = None) -> None:
        """From behind the changes of a signal to before them; upstream: no other signals are; None = all."""
        for index, change in reversed(passed):
            rows, where, free = rows_of(change), self.layout.slices[index], self.layout.free[index]
            by_parameters, at = change.by_parameters[:, :, free], self.by[signal][:, :, rows]
            self.jacobian[:, :, where] = at @ by_parameters
            for name, factor in change.by_signal.items():
                if upstream is None or name in upstream:
                    self.add(name, at @ factor)
            if signal == "displacement":
                self._carried(change, rows, where, by_parameters, at)

    def _carried(self, change, rows, where: slice, by_parameters: np.ndarray, at: np.ndarray) -> None:
        behind, self.carried = [(of, by, by[:, :, rows]) for of, by in self.carried], []
        for of, by, further in behind:
            self.jacobian[:, :, where] += further @ by_parameters * of[where]
            own = change.by_signal.get("displacement")
            self.carried.append((of, by if own is None else by + further @ own))
        if change.carried is not None:
            joint, factor = change.carried
            mine = self.layout.carries_from(joint)
            self.carried += [(mine, at @ factor)]
            self.carried += [(mine & of, further @ factor) for of, _, further in behind]
