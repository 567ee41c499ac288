"""Five measured arms, a ball in two seats: what calibration without a tracker leaves at a place that it has
not seen.

    python bench/ball_in_socket.py [ARM ...]

Each place is left out in turn; arm and tool are fitted at the others. There, spread: mean distance of the
predicted ball from the mean of its seat's rows; distance: mean |distance between the seats' means - 50 mm|.
Nominal: tool alone fitted. Effects: what `diagnose` adds to the same rows; nothing is chosen by the place
that is left out.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset, read_dataset
from exactarm.data.fixture import load_fixture
from exactarm.diagnose.closure_problem import ClosureProblem
from exactarm.diagnose.selection import select
from exactarm.files.examples import data_path
from exactarm.identify.closures import declare_closures, sessions_of
from exactarm.identify.loads import with_loads
from exactarm.measurement.closures import predict_closures, touches
from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot

ARMS = ("panda_3", "panda_6", "panda_7", "dinova_1", "dinova_2")
FOLDER = data_path("ball_in_socket")


def judged(robot: Robot, layout: Layout, data: Dataset) -> tuple[np.ndarray, list[float]]:
    """Distances (N,) from the seats' means at the places of `data`, and errors of the distances between the
    means, m."""
    points = predict_closures(robot, layout.held, data, tangents=False).view.signals["target"]
    spread, distances = np.zeros(len(data)), []
    for session in sessions_of(data):
        means = []
        for seat in (0, 1):
            rows = (data.session == session) & (data.contacts["socket"] == seat)
            means.append(points[rows].mean(axis=0))
            spread[rows] = np.linalg.norm(points[rows] - means[-1], axis=1)
        distances.append(abs(np.linalg.norm(means[0] - means[1]) - data.fixture.distances[0].length))
    return spread, distances


def leave_one_place_out(name: str) -> tuple[list[str], list[str]]:
    """The cells of one arm, and the effects that were found at each place."""
    robot = load_robot("panda" if name.startswith("panda") else "gen3lite")
    data = touches(read_dataset(FOLDER / f"{name}.csv", robot, fixture=load_fixture(FOLDER / "fixture.toml")))
    found: dict[str, list] = {"nominal": [], "geometry": [], "with effects": []}
    names = []
    for place in sessions_of(data):
        train, held = data.select(data.session != place), data.select(data.session == place)
        train = replace(train, identification=np.ones(len(train), bool))
        declared = declare_closures(robot, train, sessions=sessions_of(data))
        problem = ClosureProblem(with_loads(robot, train), train, held.select(np.zeros(len(held), bool)))
        fits = select(problem, declared.fit.layout).fits
        names += [effect.label for effect in fits[-1].layout.effects[len(declared.fit.layout.effects) :]]
        layouts = (declared.nominal.layout, declared.fit.layout, fits[-1].layout)
        for key, layout in zip(found, layouts):
            found[key].append(judged(problem.robot, layout, held))
    cells = [
        f"{1e3 * np.concatenate([spread for spread, _ in each]).mean():.2f} / "
        f"{1e3 * np.mean([d for _, ds in each for d in ds]):.2f}"
        for each in found.values()
    ]
    return [name, str(len(sessions_of(data))), str(len(data)), *cells], names


def main(arms: tuple[str, ...]) -> None:
    print("| arm | places | rows | nominal | geometry | with effects | effects found, over all places left "
          "out |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    started = time.process_time()
    for name in arms:
        cells, names = leave_one_place_out(name)
        counted = ", ".join(f"{label} ({names.count(label)})" for label in dict.fromkeys(names)) or "none"
        print("| " + " | ".join([*cells, counted]) + " |", flush=True)
    print(f"mean spread / distance error in mm; {time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or ARMS)
