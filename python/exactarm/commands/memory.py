"""Memory and time before the work: what a command will need for so many rows, beside what is free.

Bytes and seconds a row are measured (`bench/limits.py`; docs/limits.md); what a row takes is work, so both
grow in proportion. Above `Cost.most` rows, or above those that fit into what is free, such a command works on
that many, evenly spread over the sessions, and says so: more rows of the same poses narrow the intervals and
change nothing else. A command that the system would kill is refused with the number of rows that fit.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN, MOTION, POSES
from exactarm.errors import InputError
from exactarm.files.free_memory import GIGABYTE, SHARE, free_bytes
from exactarm.progress import SILENT, Progress

BASE_BYTES = 0.3 * GIGABYTE  # of the libraries and the figures
WORTH_SAYING_S = 60.0  # a command that takes longer says so before it works
LEAST_WORKED = 500  # rows: on fewer than that a command which may leave rows out does not work unasked
LEAST_OF_A_SESSION = 50  # rows that a session keeps, however many there are of others


@dataclass(frozen=True)
class Cost:
    """What a row costs; most: rows that are worked on, None where blocks or resampling bound the memory."""

    bytes_a_row: float
    seconds_a_row: float = 0.0
    most: int | None = None


COSTS = {
    ("calibrate", POSES.name): Cost(65e3, 4e-4, 50_000),
    ("diagnose", POSES.name): Cost(1.95e6, 1.6e-2, 3_500),  # bytes where seven causes are found; else 1.0e6
    ("evaluate", POSES.name): Cost(1.5e3),
    ("identify", MOTION.name): Cost(3e3),
    ("gear", GEAR_RUN.name): Cost(5e3),
}


def within_memory(command: str, kind: str, data: Dataset,
                  progress: Progress = SILENT) -> tuple[Dataset, tuple[str, ...]]:
    """The rows that are worked on, and a warning where these are not all; raises InputError where they need
    more than the machine has free."""
    cost, free = COSTS.get((command, kind)), free_bytes()
    if cost is None:
        return data, ()
    fits = len(data) if free is None else max(int((SHARE * free - BASE_BYTES) / cost.bytes_a_row), 0)
    most = cost.most if cost.most is None or fits < LEAST_WORKED else min(cost.most, fits)
    rows, told = _evenly(data, most), ()
    if len(rows) < len(data):
        where = " in the memory that is free" if most != cost.most else ""
        told = (f"{len(data):,} rows are more than {command} takes at once{where}: it works on "
                f"{len(rows):,}, evenly spread over the {kind.replace('_', ' ')} of every session",)
    needed, seconds = BASE_BYTES + cost.bytes_a_row * len(rows), cost.seconds_a_row * len(rows)
    if free is not None and needed > SHARE * free:
        raise InputError(
            f"{len(rows)} rows need about {needed / GIGABYTE:.3g} GB of memory, {free / GIGABYTE:.3g} GB are "
            f"free; expected at most {fits} rows: leave out rows, evenly, or take the sessions one by one",
            file=data.first_file)
    if seconds > WORTH_SAYING_S or told:
        minutes = max(seconds / 60.0, 1.0)
        progress.announce(f"{len(rows):,} of {len(data):,} rows: about {minutes:.0f} min of a processor and "
                          f"{needed / GIGABYTE:.1f} GB")
    return rows, told


def _evenly(data: Dataset, most: int | None) -> Dataset:
    """At most about `most` rows, every session in proportion."""
    if most is None or len(data) <= most:
        return data
    kept = []
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        count = min(len(rows), max(LEAST_OF_A_SESSION, most * len(rows) // len(data)))
        kept.append(rows[np.linspace(0, len(rows) - 1, count).astype(int)])
    return data.select(np.sort(np.concatenate(kept)))
