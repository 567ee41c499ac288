"""A log that repeats the last reading of a slow device until the next one comes, or of one that sees nothing.

Seeds: the first tried, none exchanged.
"""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import Dataset
from exactarm.data.held_samples import without_frozen, without_held

LOG_HZ, AXES, NOISE_M = 125.0, 2, 2e-5


def angles(time):
    return np.stack([0.6 * np.sin(0.9 * time + k) + 0.3 * np.sin(2.3 * time + 2 * k) for k in range(AXES)], 1)


def place(q):
    return np.stack([np.cos(q[:, 0]), np.sin(q[:, 0]), 0.5 * np.sin(q[:, 1])], axis=1)


def last_of(values, times, log):
    """What a log writes at its times of readings that came at others."""
    return values[np.clip(np.searchsorted(times, log, side="right") - 1, 0, None)]


def series(q_hz=None, tracker_hz=None, start_s=(0.0, 0.0), seed=0):
    """Angles and positions, each as it is in every row or repeated from its own rate on."""
    random = np.random.default_rng(seed)
    log = np.arange(0.0, 20.0, 1.0 / LOG_HZ)
    clock = lambda rate, start: log if rate is None else start + np.arange(0.0, 20.0, 1.0 / rate)
    times = clock(q_hz, start_s[0]), clock(tracker_hz, start_s[1])
    position = place(angles(times[1]))
    position += random.normal(0.0, NOISE_M, position.shape)
    return Dataset.of_arrays("tracked_motion", {"q": last_of(angles(times[0]), times[0], log)}, time=log,
                             position=last_of(position, times[1], log))


def left(data):
    """Position less that of the angles, RMS a component, with the one delay between the two that fits."""
    time, out = data.time - data.time[0], []
    for late in np.linspace(-0.01, 0.01, 401):
        q = np.stack([np.interp(time - late, time, column) for column in data.joints["q"].T], axis=1)
        out.append(np.sqrt(np.mean((data.position - place(q))[40:-40] ** 2)))
    return min(out)


@pytest.mark.parametrize("rates, rows", [
    ({"tracker_hz": 25.0}, 500),
    ({"tracker_hz": 30.0, "start_s": (0.0, 0.0037)}, 600),
    ({"q_hz": 25.0}, 2496),
    ({"q_hz": 62.0, "tracker_hz": 28.0, "start_s": (0.0011, 0.0037)}, 559),
], ids=["tracker", "tracker of its own clock", "angles", "both"])
@pytest.mark.slow
def test_only_new_readings_are_used(rates, rows):
    """Repeated readings leave 4.2 to 5.0 mm, new ones 0.020 to 0.046 mm (straight lines, as `left` draws
    them): seeds 0 to 2, of which the first is run."""
    held = series(**rates)
    data = without_held(held)
    assert left(held) > 1e-3
    assert left(data) < 1e-4
    assert abs(len(data) - rows) <= 2
    assert "repeats the last reading" in data.notes[0]


def test_new_readings_stay_as_they_are():
    held = series(tracker_hz=25.0)
    data = without_held(held)
    assert np.array_equal(data.position, held.position[data.row - 1])
    assert np.array_equal(data.joints["q"], held.joints["q"][data.row - 1])


def rounded(data, step):
    return replace(data, joints={"q": step * np.round(data.joints["q"] / step)})


def at_rest_between(data):
    """The arm stands still for half of the time, as its controller has it."""
    time = data.time
    moves = np.cumsum(np.where(time % 2.0 < 1.0, 1.0 / LOG_HZ, 0.0))
    q = angles(moves)
    return replace(data, joints={"q": q}, position=place(q))


@pytest.mark.parametrize("change", [
    lambda data: data,
    lambda data: rounded(data, 2e-3),
    lambda data: rounded(data, 2e-2),
    lambda data: replace(data, position=4e-5 * np.round(data.position / 4e-5)),
    lambda data: replace(data, position=1e-3 * np.round(data.position / 1e-3)),
    at_rest_between,
], ids=["as it is", "coarse", "coarser", "noise of half a step", "millimetres", "with stops"])
def test_rounded_readings_and_standstill_are_not_held(change):
    data = change(series())
    assert without_held(data) is data


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0, 4.0])
def test_noise_that_repeats_itself_is_not_held(step):
    """A single torque whose noise is as large as its rounding, or a few steps of it."""
    random = np.random.default_rng(1)
    time = np.arange(0.0, 20.0, 1.0 / LOG_HZ)
    torque = np.round(random.normal(0.0, 1.0, time.size) * step) / step
    tau = np.stack([torque, np.full(time.size, np.nan)], axis=1)
    data = Dataset.of_arrays("motion", {"theta": angles(time), "tau": tau}, time=time)
    assert without_held(data) is data


def test_an_arm_that_stands_still_is_read_all_the_same():
    """Angles of 25 Hz: where they stand for a second, they stand between its readings too."""
    moving = at_rest_between(series())
    last = np.arange(len(moving)) // 5 * 5
    data = without_held(replace(moving, joints={"q": moving.joints["q"][last]}))
    assert "between them they are interpolated" in data.notes[0]
    rest = np.flatnonzero((moving.time % 2.0 > 1.2) & (moving.time % 2.0 < 1.8))  # its starts are jumps
    rest = rest[rest < len(data)]
    assert rest.size > 600
    assert np.abs(data.joints["q"] - moving.joints["q"][: len(data)])[rest].max() < 1e-3


@pytest.mark.parametrize("shown", ["the last position", "zeros"])
def test_a_tracker_without_its_target_says_nothing(shown):
    data = series()
    lost = (data.time > 5.0) & (data.time < 5.6) | (data.time > 12.0) & (data.time < 12.1)
    position = np.where(lost[:, None], np.nan, data.position)
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(data))))
    position = data.position[last] if shown == "the last position" else np.nan_to_num(position)
    kept = without_frozen(replace(data, position=position))
    assert not lost[kept.row - 1].any()
    assert lost.sum() <= len(data) - len(kept) <= lost.sum() + 2  # the rows whose positions are repeated
    assert "lost its target" in kept.notes[0]


@pytest.mark.parametrize("change", [
    lambda data: data,
    at_rest_between,
    lambda data: replace(data, position=1e-2 * np.round(data.position / 1e-2)),
], ids=["as it is", "with stops", "rounded to a centimetre"])
def test_an_arm_that_stands_still_has_not_lost_its_target(change):
    data = change(series())
    assert without_frozen(data) is data
