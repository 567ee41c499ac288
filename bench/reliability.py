"""Whether stated probabilities keep what they promise: random arms, poses, causes and noise.

    python bench/reliability.py --count 40 --seed 70000 --out cases.json [--noise coloured] [--causes 0]
    python bench/reliability.py --read cases.json ... [--plot docs/images/reliability.svg]

A case: an arm of six or seven axes with deviations of a new one, 60 to 300 poses, with or without times and
directions of approach, with declared masses or none; none, one or two causes of the library, with axis, grid
point and direction at random, so large that all identification rows together move by 3 to 30 standard
deviations beyond what the declared parameters absorb (half of them are near the limit of what can be told);
noise normal, Student, with gross rows, or half of it shared by neighbours. The causes come from the package's
own physics: what is judged is the statistics, not the library (bench/blind has physics of its own).

A statement is right where name and axis are those of a hidden cause, or of another form of it. Intervals of
shares are exact binomial ones of 95 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind.random_arms import write_random_arm  # noqa: E402
from exactarm.chain import Layout, predict_poses  # noqa: E402
from exactarm.data.dataset import Dataset  # noqa: E402
from exactarm.diagnose.diagnosis import diagnose  # noqa: E402
from exactarm.diagnose.joint_fit import candidates_for  # noqa: E402
from exactarm.diagnose.problems import problem_for  # noqa: E402
from exactarm.diagnose.scan import free_mask, grid  # noqa: E402
from exactarm.effects.base import Effect  # noqa: E402
from exactarm.numerics.rotation import exp  # noqa: E402
from exactarm.robot.generic_masses import with_generic_masses  # noqa: E402
from exactarm.robot.robot import Placement, Robot  # noqa: E402
from exactarm.robot_file import load_robot  # noqa: E402
from exactarm.simulate.virtual_robot import deviated  # noqa: E402

SIGMA_M, SHOWN = 5e-5, (3.0, 30.0)  # standard deviations by which a cause moves all rows together
CAUSES, CHANCES = (0, 1, 2), (0.3, 0.5, 0.2)
NOISES = ("normal", "student", "gross", "coloured")
GROSS_SHARE, GROSS_TIMES = 0.03, 40.0
TRIES = 100  # of a cause that can be as large as it has to be
BINS = (0.0, 0.6, 0.8, 0.9, 0.95, 0.99, 0.999, 1.0)


def noise_of(kind: str, rows: int, random: np.random.Generator) -> np.ndarray:
    """(rows, 3) of about unit variance, gross rows apart."""
    noise = random.standard_normal((rows, 3))
    if kind == "student":
        freedom = random.uniform(3.0, 8.0)
        noise *= np.sqrt((freedom - 2.0) / random.chisquare(freedom, rows))[:, None]
    elif kind == "gross":
        noise[random.random(rows) < GROSS_SHARE] *= GROSS_TIMES
    elif kind == "coloured":
        keeps, shared = np.exp(-1.0 / random.uniform(2.0, 12.0)), random.standard_normal((rows, 3))
        for row in range(1, rows):
            shared[row] = keeps * shared[row - 1] + np.sqrt(1.0 - keeps**2) * shared[row]
        noise = np.sqrt(0.5) * (noise + shared)
    return noise


def measured(true: Robot, hidden: tuple[Effect, ...], data: Dataset, noise: np.ndarray) -> Dataset:
    """The same commands, measured on the true arm with its hidden causes."""
    prediction = predict_poses(true, Layout.of(hidden, estimate=False), data, tangents=False)
    return replace(data, position=prediction.position + noise)


def angles(robot: Robot, rows: int, random: np.random.Generator) -> dict[str, np.ndarray]:
    """Within the limits."""
    low = np.array([-2.0 if joint.q_min is None else joint.q_min for joint in robot.joints])
    high = np.array([2.0 if joint.q_max is None else joint.q_max for joint in robot.joints])
    q = random.uniform(low, high, (rows, robot.axes))
    return {"theta": (q - robot.controller_offsets) * robot.controller_ratios}


def commands(robot: Robot, random: np.random.Generator) -> Dataset:
    """Poses within the limits, 70 % of them to identify with."""
    rows = int(random.integers(60, 301))
    joints, columns = angles(robot, rows, random), {}
    if random.random() < 0.5:
        columns["time"] = np.cumsum(random.uniform(15.0, 60.0, rows))
    if random.random() < 0.5:
        joints["approach"] = random.choice((-1.0, 1.0), (rows, robot.axes))
    columns |= {"position": np.zeros((rows, 3)), "identification": random.random(rows) < 0.7}
    return Dataset.of_arrays("poses", joints, **columns)


def drawn_causes(count: int, declared: Robot, clean: Dataset, random: np.random.Generator) -> tuple:
    """Causes of the library at the sizes that `SHOWN` asks for; names are equally likely."""
    own = clean.select(clean.split(0))
    problem = problem_for(declared, own, clean.select(~clean.split(0)), 1, 0)
    fitted = problem.fit(problem.declared())
    every = [e for e in candidates_for(problem, fitted) if type(e).keep is Effect.keep]
    found: list[Effect] = []
    for _ in range(TRIES):
        if len(found) == count:
            break
        name = random.choice(sorted({e.name for e in every} - {e.name for e in found}))
        effect = random.choice([e for e in every if e.name == name])
        point = (points := grid(effect))[random.integers(len(points))]
        mask = free_mask(point)
        plausible = np.array([p.plausible for p in point.parameters()])[mask]
        direction = random.standard_normal(mask.sum()) * plausible
        positive = [p.lower == 0.0 for p, m in zip(point.parameters(), mask) if m]
        direction = np.where(positive, np.abs(direction), direction)
        moved = fitted.whiten(fitted.view.response(point)[:, :3])[:, mask] @ direction
        shown = np.linalg.norm(moved - fitted.basis @ (fitted.basis.T @ moved)) * fitted.sigma[0] / SIGMA_M
        if shown < 1e-3:
            continue
        values = np.array(point.values, float)
        values[mask] = direction * np.exp(random.uniform(*np.log(SHOWN))) / shown
        if all(p.lower <= v <= p.upper for p, v in zip(point.parameters(), values)):
            found.append(point.with_values(values))
    return tuple(found)


def case(seed: int, folder: Path, kind: str | None = None, count: int | None = None) -> dict:
    """One drawn case, diagnosed: what was hidden, what was stated with which probability, right or not.

    kind of noise and count of causes: drawn, where they are not given."""
    random = np.random.default_rng(seed)
    write_random_arm(folder / "arm.toml", random, f"arm-{seed}")
    known = load_robot(folder / "arm.toml")
    masses = bool(random.random() < 0.7)
    if not masses:  # nor springs: else the load would be a cause that no one hid
        stiff = tuple(replace(joint, spring_linear=None, spring_cubic=0.0) for joint in known.joints)
        known = replace(known, joints=stiff)
    place = Placement(exp(random.normal(0.0, 1.0, (1, 3)))[0], random.normal(0.0, 2.0, 3))
    true = replace(
        deviated(known, 0.5, random, frames=False),
        links=with_generic_masses(known).links,  # no arm is without masses
        base=place,
        tool=Placement(position=random.uniform(-0.2, 0.2, 3) + np.array([0.0, 0.0, 0.15])),
    )
    declared = known if masses else replace(known, links=None)
    data, drawn = commands(known, random), NOISES[random.integers(len(NOISES))]
    kind = kind or drawn
    noise = SIGMA_M * noise_of(kind, len(data), random)
    by_chance = int(random.choice(CAUSES, p=CHANCES))
    count = by_chance if count is None else count
    clean = measured(true, (), data, noise)
    hidden = drawn_causes(count, known, clean, random) if count else ()
    data = measured(true, hidden, data, noise)
    worked = time.process_time()
    result = diagnose(declared, data, seed=0)
    stated = [
        (f.effect.label, float(f.probability), is_right(f.effect, hidden, kind)) for f in result.findings
    ]
    return {
        "seed": seed,
        "hidden": [h.label for h in hidden],
        "masses": masses,
        "noise": kind,
        "rows": len(data),
        "verdict": result.verdict,
        "stated": stated,
        "seconds": time.process_time() - worked,
    }


def is_right(named: Effect, hidden: tuple[Effect, ...], noise: str) -> bool:
    """Name and axis of a hidden cause, another form of it, or gross rows that are there."""
    if named.name == "outliers":
        return noise == "gross"
    return any(
        (named.name, named.joint) == (one.name, one.joint) or named.includes(one) or one.includes(named)
        for one in hidden
    )


def reliability(cases: list[dict]) -> list[dict]:
    """Of every bin of stated probability: how many, mean stated, share right with its interval."""
    stated = np.array([(p, right) for one in cases for _, p, right in one["stated"]]).reshape(-1, 2)
    found = []
    for low, high in zip(BINS[:-1], BINS[1:]):
        own = stated[(stated[:, 0] >= low) & ((stated[:, 0] < high) | (high == BINS[-1]))]
        if len(own):
            n, k = len(own), int(own[:, 1].sum())
            interval = [
                float(stats.beta.ppf(0.025, k, n - k + 1)) if k else 0.0,
                float(stats.beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0,
            ]
            mean = float(own[:, 0].mean())
            found.append({"from": low, "to": high, "n": n, "right": k, "stated": mean, "interval": interval})
    return found


def printed(cases: list[dict]) -> str:
    """The marks in words."""
    bins = reliability(cases)
    clean = [one for one in cases if not one["hidden"] and one["noise"] != "gross"]
    total = sum(b["n"] for b in bins)
    error = sum(b["n"] * abs(b["right"] / b["n"] - b["stated"]) for b in bins) / max(total, 1)
    lines = [f"{len(cases)} cases, {total} statements, expected calibration error {error:.3f}"]
    lines += [
        f"{b['from']:5.3f} to {b['to']:5.3f}: {b['right']:3d} of {b['n']:3d} right, mean {b['stated']:.3f}, "
        f"interval {b['interval'][0]:.2f} to {b['interval'][1]:.2f}"
        for b in bins
    ]
    named = sum(bool(one["stated"]) for one in clean)
    lines.append(
        f"nothing hidden: {named} of {len(clean)} named something, "
        f"{sum(one['verdict'] == 'unexplained' for one in clean)} unexplained"
    )
    for key, value in (("masses", True), ("masses", False), *(("noise", kind) for kind in NOISES)):
        own = [one for one in cases if one[key] == value]
        said = [right for one in own for _, p, right in one["stated"] if p >= 0.99]
        lines.append(f"{key} {value}: {len(own)} cases, of 0.99 and more right {sum(said)} of {len(said)}")
    return "\n".join(lines)


def draw(cases: list[dict], path: Path) -> None:
    """The reliability diagram."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    axes, bins = figure.subplots(), reliability(cases)
    stated, share = ([b["stated"] for b in bins], [b["right"] / b["n"] for b in bins])
    reach = np.abs(np.array([b["interval"] for b in bins]).T - share)
    place = np.arange(len(bins))
    axes.plot(place, stated, "_", color="0.4", markersize=22, label="as stated")
    axes.errorbar(place, share, yerr=reach, fmt="o", color="#1f5fa8", capsize=3, label="right, 95 % interval")
    names = [f"{b['from']:g} to {b['to']:g}\n{b['right']} of {b['n']}" for b in bins]
    axes.set_xticks(place, names, fontsize=8)
    axes.set(xlabel="stated probability of a cause", ylabel="share that is right", ylim=(0.0, 1.05))
    axes.legend(loc="lower left", frameon=False)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=70000)
    parser.add_argument("--noise", choices=NOISES)
    parser.add_argument("--causes", type=int, choices=CAUSES)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--read", type=Path, nargs="+")
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    cases: list[dict] = []
    if arguments.read:
        cases = [one for path in arguments.read for one in json.loads(path.read_text())]
    else:
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(arguments.seed, arguments.seed + arguments.count):
                cases.append(case(seed, Path(folder), arguments.noise, arguments.causes))
                print(json.dumps(cases[-1]), flush=True)
                if arguments.out:
                    arguments.out.write_text(json.dumps(cases, indent=1) + "\n")
    print(printed(cases))
    if arguments.plot:
        draw(cases, arguments.plot)


if __name__ == "__main__":
    main()
