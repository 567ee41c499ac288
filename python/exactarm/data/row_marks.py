"""Marks of measured rows: by which the same measurements are known again in another file format, with other
line ends, units, columns or names of columns, and as a part of another file.

    mark = hash(floor(p / s + o)),   p (3,) m: measured position, s = 1 um

Rounding differs in the last bits between formats. It changes a mark only where a coordinate lies within 1e-9
of a step beside its edge: o keeps the decimals that people write away from there. Two readings of one pose,
with a noise of 5 um a coordinate, share a mark with a chance of 2e-4 (copied_rows.py).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

STEP_M = 1e-6
OFFSET = 0.2360679775  # of a step
ON_RECORD = 64  # smallest marks in a robot file: a share of 1 / 10 of another file is seen with 98 %
IN_MEMORY = 4096  # smallest marks of a file that was read: enough where it has 64 times as many rows
LEAST_KNOWN = 2  # marks: one alone may be a pose that was measured again (above; 1 % of files, two 1e-4)
_MIX = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio: neighbours are spread over all numbers
_BITS, _LETTERS = 32, 8


@dataclass(frozen=True)
class RowMarks:
    """content: of all rows in their order, hex; smallest: in rising order. Empty without positions."""

    content: str = ""
    smallest: tuple[int, ...] = ()

    @staticmethod
    def of(position: np.ndarray | None) -> RowMarks:
        """position: (N, 3) m, NaN in rows without one."""
        if position is None or not (known := np.isfinite(position).all(axis=1)).any():
            return RowMarks()
        steps = np.floor(position[known] / STEP_M + OFFSET).astype(np.int64).astype(np.uint64)
        mark = np.zeros(len(steps), np.uint64)
        for column in steps.T:
            mark = (mark ^ column) * _MIX
            mark ^= mark >> np.uint64(_BITS)
        mark >>= np.uint64(_BITS)
        content = hashlib.sha256(mark.astype("<u4").tobytes()).hexdigest()[:16]
        return RowMarks(content, tuple(np.unique(mark)[:IN_MEMORY].tolist()))

    def entry(self) -> dict[str, str]:
        """What a robot file keeps of them."""
        smallest = "".join(f"{mark:0{_LETTERS}x}" for mark in self.smallest[:ON_RECORD])
        return {"content": self.content, "marks": smallest} if self.content else {}

    def same_rows(self, entry: Mapping[str, Any]) -> bool:
        """Whether a file on record holds the same rows in the same order."""
        return bool(self.content) and entry.get("content") == self.content

    def some_rows(self, entry: Mapping[str, Any]) -> bool:
        """Whether it shares rows with these."""
        known = _marks(entry.get("marks"))
        bound = max(known) if len(known) == ON_RECORD else 2**_BITS
        comparable = [mark for mark in self.smallest if mark <= bound]
        found = len(known.intersection(comparable))
        return found >= min(LEAST_KNOWN, len(comparable), len(known)) > 0


def _marks(text: Any) -> set[int]:
    try:
        return {int(text[k : k + _LETTERS], 16) for k in range(0, len(text), _LETTERS)}
    except (TypeError, ValueError):  # not written by us, or by hand
        return set()
