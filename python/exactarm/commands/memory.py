"""Memory before the work: what a command will need for so many rows, beside what the machine has free.

Bytes a row are measured (`bench/limits.py`; docs/limits.md); what a row takes is work, so it grows in
proportion. A command that would be killed by the system is refused with the number of rows that fit.
"""

from __future__ import annotations

from pathlib import Path

from exactarm.dataset import Dataset
from exactarm.errors import InputError
from exactarm.kinds import GEAR_RUN, MOTION, POSES

GIGABYTE = 2.0**30
MEMINFO = Path("/proc/meminfo")
SHARE = 0.9  # of what is free that one command may take
BASE_BYTES = 0.3 * GIGABYTE  # of the libraries and the figures
# command, kind of data -> bytes a row; None: it does not grow with the rows by more than the data (blocks,
# thinned runs)
BYTES_A_ROW = {
    ("calibrate", POSES.name): 65e3,
    ("diagnose", POSES.name): 1.3e6,
    ("evaluate", POSES.name): 1.5e3,
    ("identify", MOTION.name): 3e3,
    ("gear", GEAR_RUN.name): 5e3,
}


def require_memory(command: str, kind: str, data: Dataset) -> None:
    """Raises InputError where the rows need more than the machine has free."""
    each, free = BYTES_A_ROW.get((command, kind)), free_bytes()
    if each is None or free is None:
        return
    needed, most = BASE_BYTES + each * len(data), SHARE * free
    if needed > most:
        rows = max(int((most - BASE_BYTES) / each), 0)
        raise InputError(
            f"{len(data)} rows need about {needed / GIGABYTE:.3g} GB of memory, {free / GIGABYTE:.3g} GB are "
            "free; expected at most "
            f"{rows} rows: leave out rows, evenly, or take the sessions one by one", file=data.first_file)


def free_bytes() -> float | None:
    """What the system says that a new process can have; None where it does not say."""
    try:
        lines = MEMINFO.read_text(encoding="ascii").splitlines()
        return 1024.0 * int(next(line.split()[1] for line in lines if line.startswith("MemAvailable:")))
    except (OSError, StopIteration, ValueError, IndexError):
        return None
