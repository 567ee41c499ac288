"""How far a robot file is off on data that it has not seen: of every row, of every session and overall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.identify.statistics import ErrorSummary, summarise


@dataclass(frozen=True)
class Evaluation:
    """error (N,) of every row in `unit`; residual (N, m) with its column names; summaries overall and by
    session.

    warnings: effects that are used where they were never measured. data: the rows, where they are not those
    of the file (closures); distances: of closures, known distance -> |error| in m;
    tilt: mean angle in rad by which gravity's direction is missed;
    pixels: RMS that corners in pictures are missed by.
    """

    unit: str
    error: np.ndarray
    residual: np.ndarray
    columns: tuple[str, ...]
    overall: ErrorSummary
    sessions: tuple[tuple[int, ErrorSummary], ...]
    warnings: tuple[str, ...] = ()
    data: Dataset | None = None
    distances: dict[str, float] | None = None
    frames: Layout | None = None  # as fitted, of poses
    tilt: float | None = None
    pixels: float | None = None

    @staticmethod
    def of(unit: str, error: np.ndarray, residual: np.ndarray, columns: tuple[str, ...], session: np.ndarray,
           judged: np.ndarray, **more: Any) -> Evaluation:
        """session (N,) of the rows; judged (N,) bool: those that are summarised."""
        sessions = tuple((int(s), summarise(error[judged & (session == s)])) for s in np.unique(session))
        return Evaluation(unit, error, residual, columns, summarise(error[judged]), sessions, **more)
