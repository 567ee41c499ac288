"""Clean motions whose torques are rounded to so many steps over their range: how many a diagnosis gets wrong.

    python bench/coarse_torques.py [--steps 8 12 16 20 30 50] [--seeds 11 16]

Wrong is every verdict but that nothing is missing; steps 0: not rounded. Motions and rounding are those of
tests/python/test_coarse_torques.py; the limit of the first aid stands on seeds 11 to 16, others judge it.
Every wrong seed is printed.
"""

import argparse
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "tests" / "python"))

from exactarm.diagnose.diagnosis import diagnose  # noqa: E402
from exactarm.diagnose.verdict import NOTHING  # noqa: E402
from rigid_arm import LINKS_ALONE, rigid  # noqa: E402
from test_coarse_torques import with_steps  # noqa: E402
from test_rounded_angles import motion  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, nargs="+", default=[8, 12, 16, 20, 30, 50])
    parser.add_argument("--seeds", type=int, nargs=2, default=[11, 16], metavar=("FIRST", "LAST"))
    arguments = parser.parse_args()
    robot, (first, last) = rigid(**LINKS_ALONE), arguments.seeds
    for steps in arguments.steps:
        wrong = []
        for seed in range(first, last + 1):
            data = motion(robot, seed)
            if diagnose(robot, with_steps(data, steps) if steps else data).verdict != NOTHING:
                wrong.append(seed)
        print(f"{steps:4d} steps: {len(wrong)} of {last - first + 1} wrong {wrong or ''}", flush=True)


if __name__ == "__main__":
    main()
