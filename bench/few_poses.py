"""Few poses chosen, beside few poses drawn, from the poses of a UR10 that come with the package.

    python bench/few_poses.py [--series B] [--counts 12 20 30 50] [--sets 30] [--out FILE.json]

The fitted rows of a random split (70 %) are the pool, the other rows judge. From the pool are taken: sets
at random; a set by the criteria of `exactarm design` (D: log det, smallest singular value), by
`identify.exchange` from each of `STARTS` random starts; and one by those of `exactarm design --aim
accuracy` (I: the least mean variance of the position over the pool), all without polishing, which needs
poses that nobody measured. Each set is calibrated with position and orientation as `exactarm calibrate`
does it. Printed: the mean error on the rows that judge, in mm: of all pool rows, of the random sets
(median, and tenth to ninetieth percentile), of the chosen ones (median over the starts), and the share of
random sets that are better than it.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from exactarm.dataset import Dataset, read_dataset
from exactarm.errors import ComputationError, InputError
from exactarm.examples import data_path
from exactarm.identify.calibrate import calibrate
from exactarm.identify.criterion import MeanVariance
from exactarm.identify.design import LEAST_FALL, reference_identifiability
from exactarm.identify.exchange import ExchangeOptions, exchange
from exactarm.identify.observability import column_scale
from exactarm.identify.planned import PlannedModel, row_weights
from exactarm.robot import Robot
from exactarm.robot_file import load_robot

STARTS = 3
SEED = 1


def planned(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Blocks (N, 6, m) of the identifiable parameters, each row over its noise, and the mean J'J of the position."""
    model = PlannedModel.of(robot, q, "both", True)
    blocks = model.blocks(q)
    identifiability = reference_identifiability(model, blocks)
    scaled = (
        blocks[:, :, identifiability.kept] * column_scale(model.names, model.plausible)[identifiability.kept]
    )
    position = scaled[:, :3]
    return scaled * row_weights(True)[:, None], np.einsum("nri,nrj->ij", position, position) / len(q)


def chosen(blocks: np.ndarray, weight: np.ndarray, count: int, criterion: str, random) -> np.ndarray:
    """(count,) indices into the pool; the start is drawn until it is regular."""
    options = ExchangeOptions()
    if criterion == "I":
        own = MeanVariance(weight)
        options = replace(options, keep=own, add=own, threshold=LEAST_FALL)
    for _ in range(20):
        try:
            return exchange(blocks, random.choice(len(blocks), count, replace=False), random, options).chosen
        except (ComputationError, np.linalg.LinAlgError):
            continue
    raise SystemExit(f"no {count} poses of the pool identify all parameters")


def error_of(robot: Robot, data: Dataset, pool: np.ndarray, rows: np.ndarray) -> float:
    """Mean error (m) on the rows that are not in the pool, calibrated on `rows` of it; inf where it cannot be."""
    identification = np.zeros(len(data), bool)
    identification[rows] = True
    judged = ~np.isin(np.arange(len(data)), pool)
    part = replace(data, identification=identification).select(identification | judged)
    try:
        return calibrate(robot, part).after["validation"].mean
    except (InputError, ComputationError):
        return float("inf")


def measured(series: str, counts: list[int], sets: int) -> dict:
    robot = load_robot("ur10")
    data = read_dataset([str(data_path(f"ur10/series_{series}.csv"))], robot)
    pool = np.flatnonzero(data.split(SEED))
    blocks, weight = planned(robot, data.joints["q"][pool])
    every = error_of(robot, data, pool, pool)
    print(
        f"series {series}: {len(pool)} poses in the pool, {len(data) - len(pool)} judge; all: {1e3 * every:.3f} mm"
    )
    print(
        "| poses | random: median (10 to 90 %) | D | I | random sets better than D, I |\n| --- | --- | --- | --- | --- |"
    )
    rows = {"all_mm": 1e3 * every}
    for count in counts:
        random = np.random.default_rng([SEED, count])
        drawn = np.array(
            [error_of(robot, data, pool, random.choice(pool, count, replace=False)) for _ in range(sets)]
        )
        found = {
            name: float(
                np.median(
                    [
                        error_of(robot, data, pool, pool[chosen(blocks, weight, count, name, random)])
                        for _ in range(STARTS)
                    ]
                )
            )
            for name in ("D", "I")
        }
        better = {name: float(np.mean(drawn < value)) for name, value in found.items()}
        low, middle, high = 1e3 * np.quantile(drawn, (0.1, 0.5, 0.9))
        print(
            f"| {count} | {middle:.3f} ({low:.3f} to {high:.3f}) | {1e3 * found['D']:.3f} | {1e3 * found['I']:.3f} | "
            f"{100 * better['D']:.0f} %, {100 * better['I']:.0f} % |",
            flush=True,
        )
        rows[str(count)] = {"random_mm": [low, middle, high], "better": better} | {
            f"{name}_mm": 1e3 * value for name, value in found.items()
        }
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--series", choices=("B", "C"), default="B")
    parser.add_argument("--counts", type=int, nargs="+", default=[12, 20, 30, 50])
    parser.add_argument("--sets", type=int, default=30)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    rows = measured(arguments.series, arguments.counts, arguments.sets)
    if arguments.out:
        arguments.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
