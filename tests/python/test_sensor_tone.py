"""Tones of a gyroscope are found while the arm rests and taken out of its motion; gears and noise stay."""

import numpy as np
import pytest
from scipy.signal import lfilter

from exactarm.data.dataset import Dataset
from exactarm.identify.evaluate import evaluate_gear_runs
from exactarm.identify.sensor_tone import find_tones, hum_at, mains_near, without_tones
from rigid_arm import rigid

RATE_HZ, NOISE = 400.0, 8e-4


def motion(speed=0.5, cruise_s=3.0, rest_s=0.4):
    """Angles of a link, rad: at rest, to a place, and at rest again."""
    rest, cruise, ramp = (int(round(RATE_HZ * span)) for span in (rest_s, cruise_s, 0.3))
    rate = np.concatenate([np.zeros(rest), np.linspace(0, 1, ramp), np.ones(cruise), np.linspace(1, 0, ramp),
                           np.zeros(rest)])
    return np.cumsum(rate) * speed / RATE_HZ


def runs(seed=0, coloured=False, tone=(0.0, 0.0), order=0, ends=slice(None)) -> Dataset:
    """Axis 1 at two speeds, both ways; tone: Hz and rad/s, its phase wandering by 0.02 Hz; order: per turn of
    the link, by which the gear errs."""
    random = np.random.default_rng(seed)
    robot = rigid()
    parts = []
    for number, speed in enumerate((0.5, -0.5, 0.25, -0.25)):
        phi = motion(speed)[ends]
        time = np.arange(phi.size) / RATE_HZ
        link = phi + (1e-4 * np.sin(order * phi) if order else 0.0)
        noise = random.normal(size=(phi.size, 3)) * NOISE
        if coloured:
            noise = noise + lfilter([0.3], [1.0, -0.95], random.normal(size=noise.shape), axis=0) * NOISE
        phase = random.uniform(0.0, 6.0) + 2.0 * np.pi * (tone[0] + 0.02 * np.sin(0.3 * time)) * time
        reading = noise + tone[1] * np.outer(np.sin(phase), [0.6, -0.8, 0.3])
        reading[:, 2] += np.gradient(link, 1.0 / RATE_HZ)
        theta = np.zeros((phi.size, robot.axes))
        theta[:, 0] = np.round(phi * robot.ratios[0] * 1e4) / 1e4
        parts.append((theta, reading, time, np.full(phi.size, number + 1)))
    theta, reading, time, run = (np.concatenate(column) for column in zip(*parts))
    return Dataset.of_arrays("gear_run", {"theta": theta}, time=time, run=run, gyro=reading)


@pytest.mark.parametrize("frequency", [33.0, 50.0, 131.0])
def test_a_tone_is_found_with_its_frequency_and_size(frequency):
    tones = find_tones(runs(tone=(frequency, NOISE)))
    # three standard deviations in rests of 0.3 s
    assert [tone.frequency for tone in tones] == [pytest.approx(frequency, abs=0.3)]
    size = NOISE * np.linalg.norm([0.6, -0.8, 0.3])
    assert np.linalg.norm(tones[0].amplitude) == pytest.approx(size, rel=0.15)


def test_short_rests_know_the_mains():
    """A quarter of a second tells 50 Hz from 51 only beside the whole runs; without, most of it was left."""
    def left(hertz: float) -> float:
        data, calm = (runs(3, tone=(hertz, size), ends=slice(60, None)) for size in (4.0 * NOISE, 0.0))
        tones = find_tones(data)
        assert [tone.frequency for tone in tones] == [pytest.approx(hertz, abs=2.0)]
        return float(np.std(without_tones(data, tones).gyro - calm.gyro) / np.std(data.gyro - calm.gyro))

    assert left(50.01) < 0.25 and left(119.95) < 0.25


def test_hum_has_the_size_that_whole_runs_show():
    """A line of a gear near 100 Hz was called hum, and what was taken out there was noise."""
    assert hum_at(80.0, runs(4)) is None
    sizes = [np.linalg.norm(hum_at(50.1, runs(4, tone=(50.0, size))).amplitude) for size in (NOISE, 0.0)]
    assert sizes[0] == pytest.approx(NOISE * np.linalg.norm([0.6, -0.8, 0.3]), rel=0.15)
    # of white noise the band of 0.3 s holds step / (2 sqrt(pi) 0.3 s) = 0.0024 of each variance: 0.17 NOISE
    assert sizes[1] < 0.2 * NOISE


@pytest.mark.parametrize(("frequency", "sampling_hz", "mains"), [
    (50.1, 1000.0, 50.0), (149.8, 1000.0, 150.0), (20.0, 120.0, 100.0), (57.0, 1000.0, None),
    (26.0, 400.0, None)])
def test_the_mains_are_known_folded_too(frequency, sampling_hz, mains):
    assert mains_near(frequency, 0.3, sampling_hz) == mains


@pytest.mark.slow
def test_noise_alone_has_no_tone():
    """100 data sets, at a stated rate of false alarms of 1e-4 each: none is expected."""
    found = [find_tones(runs(seed, coloured=seed % 2 == 1)) for seed in range(100)]
    assert found == [()] * 100


def test_a_line_of_the_gear_is_none_and_stays():
    """Order 200 at 0.5 rad/s stands at 15.9 Hz for three seconds."""
    data = runs(order=200)
    assert find_tones(data) == ()
    both = runs(order=200, tone=(50.0, NOISE))
    left = without_tones(both, find_tones(both))
    assert np.sqrt(np.mean((left.gyro - data.gyro) ** 2)) < 0.12 * NOISE  # what of the noise passes there


def test_what_moves_the_arm_is_left_as_it_is_at_cut_ends_too():
    data = runs(tone=(50.0, NOISE), ends=slice(0, -400))
    left = without_tones(data, find_tones(data)).gyro - runs(ends=slice(0, -400)).gyro
    for number in range(1, 5):
        assert np.max(np.abs(left[data.run == number][-20:])) < 1.0 * NOISE


def test_runs_without_a_rest_show_no_tone():
    assert find_tones(runs(tone=(50.0, NOISE), ends=slice(300, -300))) == ()


def test_a_run_is_judged_without_its_tone():
    error = lambda data: np.sqrt(np.mean(evaluate_gear_runs(rigid(), data).error ** 2))
    assert error(runs(tone=(50.0, 3.0 * NOISE))) == pytest.approx(error(runs()), rel=0.02)
