"""Copied rows of a check: measured positions of one day that stand in an earlier one too, to the last digit
(data/copied_rows.py: more of them than by chance). They are no news, and the check takes them for a day on
which somebody measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.data.copied_rows import BY_CHANCE, chance_of_copies, step_of
from exactarm.data.dataset import Dataset


@dataclass(frozen=True)
class CopiedRows:
    """`count` of the `rows` of the day `label` stand in the day `of` too, which has `others`; step: in which
    coordinates are written, m."""

    label: str
    of: str
    count: int
    rows: int
    others: int
    step: float

    def chance(self, sigma: float) -> float:
        """That so many rows are the same with a noise of sigma, m."""
        return chance_of_copies(self.count, float(self.rows * self.others), self.step, sigma)


def copied_rows(days: Sequence[tuple[str, Dataset]]) -> Iterator[CopiedRows]:
    """Of each day after the first, the earlier one with most of its rows, the latest of several."""
    known: list[tuple[str, int, set[bytes]]] = []
    for label, data in days:
        keys = _keys(data)
        found = [(sum(key in others for key in keys), place) for place, (_, _, others) in enumerate(known)]
        count, place = max(found, default=(0, 0))
        if count:
            of, others, _ = known[place]
            yield CopiedRows(label, of, count, len(keys), others, step_of(data.position))
        known.append((label, len(keys), set(keys)))


def copied_lines(found: Sequence[CopiedRows], sigma: float) -> tuple[str, ...]:
    """What is said of those that are no chance."""
    return tuple(
        f"{each.label}: {each.count} of {each.rows} rows are those of {each.of} to the last digit: were they "
        "copied? They count as measured"
        for each in found if each.chance(sigma) < BY_CHANCE
    )


def _keys(data: Dataset) -> list[bytes]:
    assert data.position is not None  # poses have one
    known = data.position[np.isfinite(data.position).all(axis=1)]
    return [row.tobytes() for row in known + 0.0]
