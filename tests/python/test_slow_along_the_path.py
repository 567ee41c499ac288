"""What a tracked motion leaves is no noise where it changes slowly, whatever signal it follows."""

from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.tracked_problem import TrackedProblem

STEP = 0.005
TIME = np.tile(STEP * np.arange(1600), 2)
RUN = np.repeat([1, 2], 1600)


def told(residual, step=STEP):
    data = SimpleNamespace(time=TIME / STEP * step, run=RUN)
    fitted = SimpleNamespace(residual=residual, weight=np.where(np.arange(TIME.size) < 7, 0.0, 1.0))
    return TrackedProblem.waves(SimpleNamespace(record=SimpleNamespace(data=data)), fitted, None)


def noise(memory_s=0.0, size=3e-5):
    """Half of its variance has a memory, where there is any."""
    random = np.random.default_rng(3)
    white = random.normal(0.0, size, (TIME.size, 3))
    if memory_s == 0.0:
        return white
    keeps = np.exp(-STEP / memory_s)
    shared = np.zeros_like(white)
    for row in range(1, TIME.size):
        shared[row] = keeps * shared[row - 1] + np.sqrt(1.0 - keeps**2) * random.normal(0.0, size, 3)
    return np.sqrt(0.5) * (white + shared)


@pytest.mark.parametrize("memory_s", [0.0, 0.03, 0.2])
def test_noise_with_a_memory_of_milliseconds_is_noise(memory_s):
    assert told(noise(memory_s)) == ()


def test_what_goes_on_for_a_second_is_none():
    slow = 2e-4 * np.sin(2.0 * np.pi * 0.4 * TIME)[:, None] * (1.0, -0.5, 0.2)
    (structure,) = told(noise() + slow)
    assert str(structure).startswith("it changes slowly along the path") and not structure.signals
    assert told(noise() + 0.1 * slow) == ()


def test_the_arithmetic_of_exact_data_and_few_samples_tell_nothing():
    slow = np.sin(2.0 * np.pi * 0.4 * TIME)[:, None] * np.ones(3)
    assert told(1e-9 * slow) == ()
    assert told(1e-3 * slow, step=0.2) == ()
