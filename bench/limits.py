"""Rows, processor seconds and peak memory of every command, each in its own process: docs/limits.md.

    python bench/limits.py [--most 100000] [--only evaluate,gear]

Data are the shipped and simulated ones, repeated to the number of rows; a command is not asked for more rows
once it has taken longer than `PATIENCE_S` or more than `MOST_GB`.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from exactarm.examples import data_path

PATIENCE_S, MOST_GB = 120.0, 6.0
GIGABYTE = 2**30
RUNNER = """
import resource, sys, time
from exactarm.cli import main
limit = int(float(sys.argv[1]) * 2**30)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
code = main(sys.argv[2:])
used = resource.getrusage(resource.RUSAGE_SELF)
print("MEASURED", code, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024)
"""


def poses(folder: Path, rows: int) -> list[str]:
    """Series B again and again, every repetition with other noise of 0.03 mm."""
    one = pd.read_csv(data_path("ur10/series_B.csv"))
    table = pd.concat([one] * (rows // len(one) + 1))[:rows]
    random = np.random.default_rng(1)
    for name in ("x_mm", "y_mm", "z_mm"):
        table[name] = table[name] + random.normal(0.0, 0.03, rows)
    for axis in range(1, 7):
        table[f"q_{axis}_rad"] += random.normal(0.0, 1e-6, rows)
    table.to_parquet(folder / "poses.parquet", index=False)
    return [str(folder / "poses.parquet")]


def motion(folder: Path, rows: int) -> list[str]:
    """The TX40's motion again and again, each repetition a run of its own."""
    one = pd.read_parquet(data_path("tx40/motion.parquet"))
    parts = [one.assign(run=number + 1) for number in range(rows // len(one) + 1)]
    pd.concat(parts)[:rows].to_parquet(folder / "motion.parquet", index=False)
    return [str(folder / "motion.parquet")]


def gear(folder: Path, rows: int) -> list[str]:
    one = pd.read_parquet(data_path("kr300/run_A.parquet"))
    parts = [one.assign(run=number + 1) for number in range(rows // len(one) + 1)]
    pd.concat(parts)[: max(rows, len(one))].to_parquet(folder / "runs.parquet", index=False)
    return [str(folder / "runs.parquet"), "--kind", "gear_run"]


CASES = {
    "evaluate": (("evaluate", "ur10"), poses, (1000, 10000, 100000, 1000000)),
    "calibrate": (("calibrate", "ur10"), poses, (1000, 4000, 16000, 64000)),
    "diagnose poses": (("diagnose", "ur10"), poses, (500, 1500, 4000)),
    "identify": (("identify", "tx40"), motion, (45000, 180000, 720000)),
    "gear": (("gear", "kr300"), gear, (2500, 25000, 250000)),
}


def measured(words: tuple[str, ...], make, rows: int, folder: Path) -> tuple[str, float, float]:
    """How it ended, processor seconds, bytes."""
    files = make(folder, rows)
    line = [sys.executable, "-c", RUNNER, str(MOST_GB + 2.0), *words, *files, "--out", str(folder / "out"),
            "--threads", "1", "--quiet"]
    done = subprocess.run(line, capture_output=True, text=True,
                          env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    told = [text for text in done.stdout.splitlines() if text.startswith("MEASURED")]
    if not told:
        return f"ended by signal {-done.returncode}", resource.getrusage(
            resource.RUSAGE_CHILDREN
        ).ru_utime, np.nan
    _, code, seconds, memory = told[0].split()
    how = (
        "done" if code == "0" else f"exit {code}: "
                                   f"{done.stderr.strip().removeprefix('exactarm: error: ')[:120]}"
    )
    return how, float(seconds), float(memory)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=int, default=1000000, help="rows")
    parser.add_argument("--only", default="", help="names of cases with commas between")
    arguments = parser.parse_args()
    chosen = arguments.only.split(",") if arguments.only else list(CASES)
    print("| command | rows | processor time | peak memory | |\n| --- | ---: | ---: | ---: | --- |")
    for name in chosen:
        words, make, counts = CASES[name]
        for rows in (count for count in counts if count <= arguments.most):
            with tempfile.TemporaryDirectory() as folder:
                how, seconds, memory = measured(words, make, rows, Path(folder))
            print(f"| `{name}` | {rows:,} | {seconds:.1f} s | {memory / GIGABYTE:.2f} GB | {how} |",
                  flush=True)
            if seconds > PATIENCE_S or not memory < MOST_GB * GIGABYTE or how != "done":
                break


if __name__ == "__main__":
    main()
