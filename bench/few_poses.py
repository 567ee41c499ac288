"""Few poses chosen, beside few poses drawn, from the poses of a UR10 that come with the package.

    python bench/few_poses.py [--series B] [--counts 12 20 30 50] [--sets 30] [--out FILE.json]

The fitted rows of a random split (70 %) are the pool, the other rows judge. From the pool are taken sets at
random, and sets by `design.exchange` from each of `STARTS` random starts:

    D    the criteria of `exactarm design`: log det, smallest singular value
    I    the least mean variance of the position over the pool, tr(M^-1 W), W the mean of its J'J
    S    the same, where waves of each axis, of unknown size, are a part of the noise

none of them polished, which needs poses that nobody measured. Each set is calibrated with position and
orientation as `exactarm calibrate` does it. Printed: the mean error on the rows that judge, in mm: of all
pool rows, of the random sets (median, tenth to ninetieth percentile), of the chosen ones (median over the
starts, and in brackets the share of random sets that are better).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from exactarm.data.dataset import Dataset, read_dataset
from exactarm.design.criterion import Criterion
from exactarm.design.design import reference_identifiability
from exactarm.design.exchange import ExchangeOptions, exchange
from exactarm.errors import ComputationError, InputError
from exactarm.files.examples import example
from exactarm.identify.calibrate import calibrate
from exactarm.identify.observability import column_scale
from exactarm.identify.planned import PlannedModel, row_weights
from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot

STARTS = 3
WAVES, WAVE_RAD = (
    (1, 2, 3, 4),
    2e-4,
)  # orders, and the amplitude of the first, of the errors that the model lacks
CRITERIA = ("D", "I", "S")
LEAST_FALL = 1e-3  # of the mean variance, relative, in the steps that an exchange waits for
SEED = 1


@dataclass(frozen=True, eq=False)
class MeanVariance(Criterion):
    """-log tr(M^-1 W), the mean variance of what is predicted; `weight` W (m, m): its mean J'J."""

    weight: np.ndarray

    def values(self, information: np.ndarray) -> np.ndarray:
        regular = np.linalg.eigvalsh(information)[..., 0] > 0.0
        safe = np.where(regular[..., None, None], information, np.eye(information.shape[-1]))
        solved = np.linalg.solve(safe, np.broadcast_to(self.weight, safe.shape))
        return np.where(regular, -np.log(np.trace(solved, axis1=-2, axis2=-1)), -np.inf)


def planned(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks (N, 6, m) of the identifiable parameters and (N, 6, w) of waves of the axes, each row over its
    noise, and the mean J'J of the position (m, m)."""
    model = PlannedModel.of(robot, q, "both", True)
    blocks = model.blocks(q)
    identifiability = reference_identifiability(model, blocks)
    scaled = (
        blocks[:, :, identifiability.kept]
        * column_scale(model.names, model.plausible)[identifiability.kept]
    )
    position = scaled[:, :3]
    turned = [model.names.index(f"q_offset_{i + 1}_rad") for i in range(robot.axes)]
    waves = [
        blocks[:, :, column] * (wave(k * q[:, axis]) * WAVE_RAD / k)[:, None]
        for axis, column in enumerate(turned)
        for k in WAVES
        for wave in (np.cos, np.sin)
    ]
    noise = row_weights(True)[:, None]
    weight = np.einsum("nri,nrj->ij", position, position) / len(q)
    return scaled * noise, np.stack(waves, axis=2) * noise, weight


def chosen(planned_for: tuple, count: int, criterion: str, random) -> np.ndarray:
    """(count,) indices into the pool; the start is drawn until it is regular."""
    blocks, waves, weight = planned_for
    options, prior = ExchangeOptions(), None
    if criterion in ("I", "S"):
        if (
            criterion == "S"
        ):  # waves of amplitude 1 in their scale; the target's error by them is not asked for
            m, w = blocks.shape[2], waves.shape[2]
            blocks, weight = np.concatenate([blocks, waves], axis=2), np.pad(weight, (0, w))
            prior = np.diag(np.repeat([0.0, 1.0], [m, w]))
        own = MeanVariance(weight)
        options = replace(options, keep=own, add=own, threshold=LEAST_FALL)
    for _ in range(20):
        try:
            start = random.choice(len(blocks), count, replace=False)
            return exchange(blocks, start, random, options, prior).chosen
        except (ComputationError, np.linalg.LinAlgError):
            continue
    raise SystemExit(f"no {count} poses of the pool identify all parameters")


def error_of(robot: Robot, data: Dataset, pool: np.ndarray, rows: np.ndarray) -> float:
    """Mean error (m) on the rows that are not in the pool, calibrated on `rows` of it; inf where it cannot
    be."""
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
    data = read_dataset([str(example(f"ur10/series_{series}"))], robot)
    pool = np.flatnonzero(data.split(SEED))
    planned_for = planned(robot, data.joints["q"][pool])
    every = error_of(robot, data, pool, pool)
    print(
        f"series {series}: {len(pool)} poses in the pool, {len(data) - len(pool)} judge; all: "
        f"{1e3 * every:.3f} mm"
    )
    print(f"| poses | random: median (10 to 90 %) | {' | '.join(CRITERIA)} |")
    print("| --- " * (2 + len(CRITERIA)) + "|")
    rows = {"all_mm": 1e3 * every}
    for count in counts:
        random = np.random.default_rng([SEED, count])
        drawn = np.array(
            [error_of(robot, data, pool, random.choice(pool, count, replace=False)) for _ in range(sets)]
        )
        sets_of = {
            name: [pool[chosen(planned_for, count, name, random)] for _ in range(STARTS)]
            for name in CRITERIA
        }
        found = {
            name: float(np.median([error_of(robot, data, pool, rows) for rows in each]))
            for name, each in sets_of.items()
        }
        better = {name: float(np.mean(drawn < value)) for name, value in found.items()}
        low, middle, high = 1e3 * np.quantile(drawn, (0.1, 0.5, 0.9))
        cells = " | ".join(f"{1e3 * found[name]:.3f} ({100 * better[name]:.0f} %)" for name in CRITERIA)
        print(f"| {count} | {middle:.3f} ({low:.3f} to {high:.3f}) | {cells} |", flush=True)
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
