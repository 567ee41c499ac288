"""What rows that stand for several samples of a log show of a wave over the angle of a motor."""

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain.log_samples import LogSamples

STEP_S, EVERY, CUTOFF_HZ, ORDER = 1e-3, 4, 50.0, 6.0


def fast_motor(step=STEP_S, every=EVERY, cutoff=CUTOFF_HZ, seconds=4.0):
    """The samples of a motor that speeds up to 80 turns a second, and (N,) turns a second, angle at the
    rows."""
    time = np.arange(0.0, seconds, step)
    turns = 80.0 * (time / seconds)
    angle = 2.0 * np.pi * np.cumsum(turns) * step
    rate = np.gradient(angle, step)[:, None]
    samples = LogSamples(angle[:, None], rate, (slice(0, len(time)),), every, step, cutoff)
    return samples, turns[::every], angle[::every]


def test_a_wave_shows_as_it_is_gathered_up_to_the_rate_of_the_rows_and_beyond():
    """At 42 turns a second the rows see the wave standing still: its folded image is none of the log's."""
    samples, turns, angle = fast_motor()
    gathered = samples.gathered(np.cos(ORDER * samples.angle[:, 0]))
    shown, _ = samples.shown_of_wave(turns, ORDER)
    inside = slice(25, -25)
    np.testing.assert_allclose((shown * np.cos(ORDER * angle))[inside], gathered[inside], atol=0.04)
    assert np.max(np.abs(np.cos(ORDER * angle) - gathered)[np.abs(ORDER * turns - 250.0) < 20.0]) > 0.9


def test_a_wave_that_folds_within_the_log_shows_where_it_folds_to():
    samples, turns, angle = fast_motor(step=2.5e-3, every=2)  # 400 samples a second, the wave up to 480
    gathered = samples.gathered(np.cos(ORDER * samples.angle[:, 0]))
    shown, _ = samples.shown_of_wave(turns, ORDER)
    at = np.abs(ORDER * turns - 400.0) < 10.0
    assert at.sum() > 10 and shown[at].min() > 0.99
    np.testing.assert_allclose((shown * np.cos(ORDER * angle))[at], gathered[at], atol=0.04)


def test_slope_by_the_order():
    samples, turns, _ = fast_motor()
    assert_derivative(lambda order: samples.shown_of_wave(turns, order[0])[0], np.array([ORDER]),
                      samples.shown_of_wave(turns, ORDER)[1][:, None], 1e-4, relative=1e-5)


@pytest.mark.parametrize("samples", [{"every": 1}, {"cutoff": None}])
def test_rows_that_are_the_samples_show_all_of_it(samples):
    made, turns, _ = fast_motor(**samples)
    assert made.shown_of_wave(turns, ORDER) is None
