"""Builds and runs the dynamics benchmark beside Pinocchio and prints medians and ratios.

python bench/dynamics_ratios.py [--build DIR] [--json FILE] [--repetitions N]

Times are CPU time of one thread in microseconds a call (rows "knot_*": a knot), medians over repetitions.
"ratio" = Pinocchio / ours: above 1, ours is faster. Pinocchio's headers come from its PyPI wheel (`pin`),
compiled in the same run with the same options; its last row leaves the contraction with a multiplier out.
Exit 1 when ours is slower in any row, or the second derivatives miss their 10 microseconds.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent
LIMIT_SECOND_US = 10.0


def pinocchio_prefix() -> Path | None:
    """Where the wheel keeps headers and libraries, or None without it."""
    spec = importlib.util.find_spec("cmeel")
    sites = [Path(spec.origin).parents[1]] if spec and spec.origin else [Path(path) for path in sys.path]
    for site in sites:
        prefix = site / "cmeel.prefix"
        if (prefix / "include" / "pinocchio").is_dir():
            return prefix
    return None


def build(directory: Path) -> Path:
    options = ["-DEXACTARM_BENCH=ON", "-DEXACTARM_PYTHON=OFF",
               f"-DEXACTARM_BENCH_PREFIX={pinocchio_prefix() or ''}"]
    subprocess.run(["cmake", "-S", ROOT, "-B", directory, *options], check=True, stdout=sys.stderr)
    subprocess.run(["cmake", "--build", directory, "--target", "dynamics_bench"], check=True,
                   stdout=sys.stderr)
    return directory / "bench" / "dynamics_bench"


def run(program: Path, repetitions: int) -> dict:
    command = [program, "--benchmark_format=json", f"--benchmark_repetitions={repetitions}"]
    command += ["--benchmark_min_time=0.05", "--benchmark_enable_random_interleaving=true"]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def medians(report: dict) -> dict[str, float]:
    """Microseconds a call (a knot) by row."""
    times: dict[str, list[float]] = {}
    for entry in report["benchmarks"]:
        if entry.get("run_type") == "iteration":
            times.setdefault(entry["run_name"], []).append(1e-3 * entry["cpu_time"] / entry.get("rows", 1.0))
    return {name: median(values) for name, values in times.items()}


def table(rows: dict[str, float]) -> str:
    lines = [f"{'':32}{'us':>9}{'pinocchio us':>15}{'ratio':>8}"]
    ours = [name for name in rows if not name.startswith("pinocchio/")]
    for name in sorted(ours, key=lambda name: (name.startswith("knot_"), rows[name])):
        time = rows[name]
        other = rows.get("pinocchio/" + name)
        beside = f"{other:15.3f}{other / time:8.2f}" if other else ""
        lines.append(f"{name:32}{time:9.3f}{beside}")
    return "\n".join(lines)


def verdict(rows: dict[str, float]) -> list[str]:
    """What misses its mark, in words."""
    misses = []
    for name, time in rows.items():
        if name.startswith("pinocchio/") and rows[name.removeprefix("pinocchio/")] > time:
            misses.append(f"{name.removeprefix('pinocchio/')}: slower than Pinocchio")
    if rows["first_and_second_derivatives"] > LIMIT_SECOND_US:
        misses.append(f"first_and_second_derivatives: above {LIMIT_SECOND_US} us")
    return misses


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build-bench")
    parser.add_argument("--json", type=Path, help="also write the whole report of google-benchmark")
    parser.add_argument("--repetitions", type=int, default=15)
    arguments = parser.parse_args()
    report = run(build(arguments.build), arguments.repetitions)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))
    rows = medians(report)
    print(table(rows))
    misses = verdict(rows)
    print("\n".join(misses) if misses else "all marks met")
    return 1 if misses else 0


if __name__ == "__main__":
    sys.exit(main())
