"""What passes for noise in a noise model, and is none: rows that err together, a device that wanders."""

from __future__ import annotations

import numpy as np
from scipy import special

from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Structure
from exactarm.noise.model import NoiseModel
from exactarm.numerics.together import BY_CHANCE

WANDERS_AT = 2.0  # times the noise without it: a device that stands still would halve what is left
# independent stretches of a session, below which what a device wanders is a drift: drifts gave 1.9
# (bench/leave_one_out.py), noise with a memory of 2 to 12 rows 11 to 121 (bench/reliability.py)
DRIFTS_BELOW = 5.0
# of a row's variance that the next one shares: less, and a row is mostly its own, whatever it is called
COMMON = 0.5


def not_noise(noise: NoiseModel) -> tuple[Structure, ...]:
    """In words, where it asks for a cause."""
    found = []
    if noise.together:
        found.append(Structure(f"the {noise.together} rows that err most lie together in space, and err the "
                               "same way"))
    counts = noise.common_to_neighbours >= Problem.share_left
    drifts = counts and noise.stretches < DRIFTS_BELOW
    if counts and noise.jumps:
        times = "once" if noise.jumps == 1 else f"{noise.jumps} times"
        found.append(Structure(f"the device jumps {times}: likelier than noise that neighbouring rows share",
                               wanders=True))
    elif drifts or (noise.wander_over_rest >= WANDERS_AT and noise.common_to_neighbours >= COMMON):
        shared = noise.wander_over_rest**2 - 1.0
        does = "drifts with time" if drifts else "wanders or jumps"
        found.append(Structure(
            f"the device {does}: neighbouring rows share {shared:.{0 if shared >= 1.0 else 1}f} times the "
            f"variance of one row alone, for about {noise.wandering.memory:.0f} rows", wanders=True))
    return tuple(found)


def probability_of(noise: NoiseModel) -> float:
    """That it is none: of rows that err together, one less what chance makes of so many; of a device that
    wanders, by the likelihood, which pays for its two parameters."""
    if noise.together:
        return 1.0 - BY_CHANCE
    w = noise.wandering
    return 0.0 if w is None else float(special.expit(w.gain - np.log(len(noise.order))))
