"""Random serial arms of six or seven axes as robot files: elbow arms, arms with an offset wrist, seven-axis
arms.

Masses, springs and gears are declared at random: an engineer's file knows more or less about the arm.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

QUARTER = np.pi / 2.0
SPARE_MASS_KG = (60.0, 25.0, 18.0, 10.0, 4.0, 3.0, 1.0)


def write_random_arm(path: Path, random: np.random.Generator, name: str) -> None:
    """A drawn arm as a robot file."""
    draw = (_elbow, _offset_wrist, _seven_axes)[random.integers(3)]
    frames = draw(random)
    scale = random.uniform(0.3, 1.5)
    masses = random.random() < 0.85
    springs = masses and random.random() < 0.5
    gears = random.random()
    lines = ["format = 1", f'name = "{name}"', "gravity_m_s2 = [0.0, 0.0, -9.81]", ""]
    for index, (d, a, alpha) in enumerate(frames):
        lines += ["[[joints]]", f"a_m = {a!r}", f"alpha_rad = {alpha!r}"]
        lines.append("beta_rad = 0.0" if alpha == 0.0 and index < len(frames) - 1 else f"d_m = {d!r}")
        reach = float(random.uniform(1.8, 2.9)) if index else 2.9
        lines += [f"q_min_rad = {-reach!r}", f"q_max_rad = {reach!r}"]
        if gears < 0.5:
            ratio = float(round(random.uniform(50.0, 160.0), 2))
            lines.append(f"ratio = {ratio!r}")
        if springs:
            lines.append(f"spring_linear_Nm_rad = {float(scale * 3e5 / 2.0**index)!r}")
        if gears < 0.2 and index < 3:
            lines += _tables(random, ratio)
        lines.append("")
    if masses:
        for index, (d, a, alpha) in enumerate(frames):
            mass = float(scale * SPARE_MASS_KG[index] * random.uniform(0.7, 1.3))
            along = np.array([-0.5 * a, -0.5 * d * np.sin(alpha), -0.5 * d * np.cos(alpha)])
            centre = [float(v) for v in along + random.normal(0.0, 0.03, 3)]
            lines += ["[[links]]", f"mass_kg = {mass!r}", f"centre_of_mass_m = {centre!r}", ""]
    path.write_text("\n".join(lines))


def _tables(random, ratio: float) -> list[str]:
    orders = [float(np.round(ratio)) * k for k in (1, 2)]
    lines = []
    for side in ("cw", "ccw"):
        a, b = ([float(v) for v in random.normal(0.0, 2e-3, len(orders))] for _ in "ab")
        lines += [f"[joints.gear_{side}]", f"order_per_output_rev = {orders!r}", f"a = {a!r}", f"b = {b!r}"]
    return lines


def _elbow(random):
    upper, lower = random.uniform(0.3, 1.2, 2)
    shoulder = random.uniform(0.0, 0.3)
    return [
        (float(random.uniform(0.3, 0.8)), float(shoulder), QUARTER), (0.0, float(upper), 0.0),
        (0.0, float(random.uniform(0.0, 0.2)), QUARTER), (float(lower), 0.0, -QUARTER), (0.0, 0.0, QUARTER),
        (float(random.uniform(0.08, 0.2)), 0.0, 0.0),
    ]


def _offset_wrist(random):
    upper, lower = random.uniform(0.25, 0.8, 2)
    wrist = random.uniform(0.08, 0.2, 3)
    return [
        (float(random.uniform(0.1, 0.3)), 0.0, QUARTER), (0.0, -float(upper), 0.0), (0.0, -float(lower), 0.0),
        (float(wrist[0]), 0.0, QUARTER), (float(wrist[1]), 0.0, -QUARTER), (float(wrist[2]), 0.0, 0.0),
    ]


def _seven_axes(random):
    upper, lower = random.uniform(0.3, 0.6, 2)
    lengths = (random.uniform(0.3, 0.4), 0.0, upper, 0.0, lower, 0.0, random.uniform(0.1, 0.2))
    turns = (-QUARTER, QUARTER, QUARTER, -QUARTER, -QUARTER, QUARTER, 0.0)
    return [(float(d), 0.0, turn) for d, turn in zip(lengths, turns)]
