"""Many trials (trials.py), each told by its seed:

    python tests/robustness/run.py --count 10000 [--seed 0] [--commands 0.1] [--folder DIR] [--gigabytes 6]

Prints the seeds of what failed and ends with exit 1 if any did; `--count 1 --seed N` does one again.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
from collections import Counter
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.samples import samples  # noqa: E402
from robustness.trials import SHARE_OF_COMMANDS, run_trial  # noqa: E402

TOLD_EVERY = 500  # trials between two lines of progress


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0, help="of the first trial; the others follow")
    parser.add_argument("--commands", type=float, default=SHARE_OF_COMMANDS,
                        help="share of trials that run a whole command")
    parser.add_argument("--folder", type=Path,
                        help="where the spoiled files are left (default: a temporary folder)")
    parser.add_argument("--gigabytes", type=float, default=6.0, help="of address space that a trial may take")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (int(arguments.gigabytes * 2**30),) * 2)
    valid, failures, ends, slowest = samples(), 0, Counter(), (0.0, 0)
    with tempfile.TemporaryDirectory() as temporary:
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            trial = run_trial(seed, (arguments.folder or Path(temporary)) / "trial", valid,
                              arguments.commands)
            ends["readers" if trial.code is None else f"exit {trial.code}"] += 1
            slowest = max(slowest, (trial.seconds, seed))
            if trial.failure:
                failures += 1
                print(f"seed {seed}, {trial.what}: {trial.failure[:400]}", flush=True)
            if (seed - arguments.seed + 1) % TOLD_EVERY == 0:
                print(f"{seed - arguments.seed + 1} trials, {failures} failed", file=sys.stderr, flush=True)
    counts = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    print(f"{arguments.count} trials from seed {arguments.seed} ({counts}): {failures} failed; slowest "
          f"{slowest[0]:.1f} s, seed {slowest[1]}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
