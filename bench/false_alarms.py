"""How often the daily check (exactarm/verify/change.py) alarms while nothing moves, and how soon when
something does.

    python bench/false_alarms.py --years 40 --poses 5 --occasions 10 --days-per-year 250

After a false alarm the check begins anew, with a new BEFORE. Noise of any size is the same: the statistic
does not see it.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from exactarm.verify.change import Detector, Evidence, Hypothesis


def hypotheses(poses: int, random: np.random.Generator) -> list[Hypothesis]:
    """Six zeros, base and tool of an arm with random levers."""
    columns = random.normal(size=(3 * poses, 15))
    single = [Hypothesis(f"zero of axis {i + 1}", columns[:, i : i + 1], ("q_rad",)) for i in range(6)]
    base = Hypothesis("base", columns[:, 6:12], tuple(f"base_{i}" for i in range(6)))
    return [*single, base, Hypothesis("tool", columns[:, 12:], tuple(f"tool_{i}" for i in range(3)))]


def fresh(poses: int, occasions: int, random: np.random.Generator) -> tuple[Detector, np.ndarray]:
    """A detector after BEFORE, and the level that it has seen."""
    level, before = 10.0 * random.normal(size=3 * poses), Evidence.none(3 * poses)
    for _ in range(occasions):
        before = before.with_day(level + random.normal(size=3 * poses), np.eye(3 * poses))
    return Detector(before, hypotheses(poses, random)), level


def false_alarms(days: int, boundary: float, poses: int, occasions: int, random: np.random.Generator) -> int:
    """Alarms in so many days on which nothing moves."""
    alarms = 0
    detector, level = fresh(poses, occasions, random)
    for _ in range(days):
        state = detector.step(level + random.normal(size=level.size), np.eye(level.size))
        if state.statistic >= boundary:
            alarms += 1
            detector, level = fresh(poses, occasions, random)
    return alarms


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--years", type=float, default=40.0)
    parser.add_argument("--days-per-year", type=float, default=250.0)
    parser.add_argument("--poses", type=int, default=5)
    parser.add_argument("--occasions", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    started, days = time.process_time(), round(arguments.years * arguments.days_per_year)
    random = np.random.default_rng(arguments.seed)
    alarms = false_alarms(days, arguments.days_per_year, arguments.poses, arguments.occasions, random)
    print(
        f"{alarms} false alarms in {arguments.years:g} years of {arguments.days_per_year:g} days: "
        f"{alarms / arguments.years:.2f} a year ({time.process_time() - started:.0f} s of processor time)"
    )


if __name__ == "__main__":
    main()
