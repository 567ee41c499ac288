"""Copied rows: measured positions of one day that stand in an earlier one too, to the last digit.

Two measurements of one pose with noise sigma give the same coordinate, written in steps s, with a chance of
s / (2 sqrt(pi) sigma) or less: the density of their difference at zero. Of N x M pairs of rows, (s / (2
sqrt(pi) sigma))^3 N M are the same by chance at most. Where more are (Poisson), they were copied. Copied rows
are no news, and the check takes them for a day on which somebody measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.data.dataset import Dataset

BY_CHANCE = 1e-6  # of a day: one false word in thousands of years
_DIGITS = 9  # behind the point, in m: finer than any device writes


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
        same = min(1.0, self.step / (2.0 * np.sqrt(np.pi) * sigma)) ** 3 if sigma > 0.0 else 1.0
        return float(special.pdtrc(self.count - 1, same * self.rows * self.others))


def copied_rows(days: Sequence[tuple[str, Dataset]]) -> Iterator[CopiedRows]:
    """Of each day after the first, the earlier one with most of its rows, the latest of several."""
    known: list[tuple[str, int, set[bytes]]] = []
    for label, data in days:
        keys = _keys(data)
        found = [(sum(key in others for key in keys), place) for place, (_, _, others) in enumerate(known)]
        count, place = max(found, default=(0, 0))
        if count:
            of, others, _ = known[place]
            yield CopiedRows(label, of, count, len(keys), others, _step(data))
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


def _step(data: Dataset) -> float:
    """m: the coarsest power of ten in which all coordinates are written."""
    values = data.position[np.isfinite(data.position)]
    for digits in range(_DIGITS):
        scaled = values * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled) * 1e-6)):
            return 10.0**-digits
    return 10.0**-_DIGITS
