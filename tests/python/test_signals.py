"""Filters, derivatives and spectra of signals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import ndimage

from exactarm.numerics.signals import (
    derivative,
    derivative_operator,
    even_clock,
    gaussian_filter,
    gaussian_sigma,
    stamps_are_true,
    steady_direction,
    step_of_quantisation,
    strongest_orders,
    zoom,
)
from exactarm.numerics.stamps import blocks


def test_filter_halves_the_power_at_its_cutoff():
    """(3.1), (3.2): -3 dB at f_c, and no phase."""
    time = np.arange(0.0, 2.0, 0.001)
    wave = np.cos(2.0 * np.pi * 20.0 * time)
    filtered = gaussian_filter(wave, time, 20.0)
    middle = slice(300, -300)
    gain = filtered[middle] @ wave[middle] / (wave[middle] @ wave[middle])
    assert_allclose(gain, np.sqrt(0.5), rtol=2e-3)
    across = filtered[middle] @ np.sin(2.0 * np.pi * 20.0 * time)[middle]
    assert abs(across) < 1e-3 * abs(filtered[middle] @ wave[middle])
    assert_allclose(gaussian_sigma(20.0), np.sqrt(np.log(2.0)) / (2.0 * np.pi * 20.0))


def test_filter_leaves_straight_lines_to_their_ends():
    time = np.arange(0.0, 1.0, 0.002)
    line = 3.0 - 2.0 * time
    assert_allclose(gaussian_filter(line, time, 7.0), line, atol=1e-12)
    both = np.stack([line, 5.0 * line], axis=1)
    assert_allclose(gaussian_filter(both, time, 7.0), both, atol=1e-12)


def test_filter_does_not_reach_over_a_gap():
    time = np.concatenate([np.arange(0.0, 0.5, 0.01), np.arange(0.8, 1.3, 0.01)])
    steps = np.where(time < 0.6, 0.0, 1.0)
    assert len(blocks(time)) == 2
    assert_allclose(gaussian_filter(steps, time, 5.0), steps, atol=1e-12)


@pytest.mark.parametrize("frequency", [1.0, 30.0, 90.0])
def test_derivative_of_a_wave(frequency):
    time = np.arange(0.0, 1.0, 0.001)
    omega = 2.0 * np.pi * frequency
    slope = derivative_operator(time) @ np.sin(omega * time)
    assert_allclose(slope[4:-4], omega * np.cos(omega * time)[4:-4], atol=1e-4 * omega)


def test_derivative_of_polynomials_is_exact_and_linear():
    random = np.random.default_rng(1)
    time = np.arange(60) * 0.01
    operator = derivative_operator(time)
    square = np.stack([time**2, 1.0 - 3.0 * time], axis=1)
    assert_allclose(operator @ square, np.stack([2.0 * time, np.full(60, -3.0)], axis=1), atol=1e-10)
    one, other = random.normal(size=(2, 60))
    assert_allclose(operator @ (2.0 * one - other), 2.0 * (operator @ one) - operator @ other, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_derivative_of_short_runs(count):
    time = np.arange(count) * 0.1
    slope = derivative_operator(time) @ (2.0 * time)
    assert_allclose(slope, np.zeros(1) if count == 1 else np.full(count, 2.0), atol=1e-12)


def test_quantisation_is_seen_and_not_invented():
    random = np.random.default_rng(3)
    motion = np.cumsum(random.uniform(0.0, 3e-3, 5000))
    step = 2.0 * np.pi / 4096
    assert_allclose(step_of_quantisation(np.round(motion / step) * step), step, rtol=1e-6)
    assert step_of_quantisation(motion) == 0.0
    assert step_of_quantisation(np.ones(100)) == 0.0


def test_an_exact_angle_at_an_even_pace_is_not_quantised():
    """Even steps, and even growth of the steps, make grids of their own; a slow encoder's grid is seen beside
    them."""
    time = np.arange(0.0, 2.0, 1e-3)
    ramp = np.clip(time - 0.1, 0.0, 0.2)
    motion = 0.5 * 20.0 * ramp**2 + 4.0 * np.clip(time - 0.3, 0.0, None)
    assert step_of_quantisation(motion) == 0.0
    step = 2e-5
    slow = np.round(0.0213 * motion / step) * step
    assert_allclose(step_of_quantisation(slow), step, rtol=1e-6)


def test_direction_belongs_to_the_motion_beside_a_standstill():
    time = np.arange(0.0, 6.0, 0.01)
    rate = np.where(time < 1.0, 0.0, np.where(time < 3.0, 1.0, -1.0)) * (time < 5.0)
    rate = gaussian_filter(rate, time, 2.0)
    direction, reversal = steady_direction(rate, time)
    assert np.all(direction[time < 2.8] == 1.0) and np.all(direction[time > 3.2] == -1.0)
    turns = time[reversal]
    assert turns.size and np.all(np.abs(turns - 3.0) < 0.1)


def test_direction_of_a_standstill_is_none():
    direction, reversal = steady_direction(np.zeros(50), np.arange(50) * 0.01)
    assert not direction.any() and not reversal.any()


def test_zoom_agrees_with_the_sum_that_it_stands_for():
    angle = np.linspace(0.0, 3.0, 2000)
    values = 2.0 * np.cos(84.3 * angle) + 0.5 * np.sin(203.0 * angle)
    orders, amplitude = zoom(values, angle[1] - angle[0], 60.0, 220.0, 641)
    direct = 2.0 / angle.size * np.exp(-1j * np.outer(orders, angle)) @ values
    assert_allclose(np.abs(amplitude), np.abs(direct), atol=1e-9)
    assert abs(orders[np.argmax(np.abs(amplitude))] - 84.3) < 0.3


def test_strongest_orders_come_first():
    random = np.random.default_rng(4)
    pieces = []
    for _ in range(2):
        angle = np.sort(random.uniform(0.0, 4.0, 4000))
        values = 3.0 * np.cos(101.0 * angle
                              + 1.0) + np.cos(202.4 * angle) + random.normal(0.0, 1.0, angle.size)
        pieces.append((angle, values))
    found = strongest_orders(pieces, ratio=85.0)
    assert_allclose(found[:2], [101.0, 202.4], atol=0.5)
    noise = [(angle, random.normal(size=angle.size)) for angle, _ in pieces]
    assert len(strongest_orders(noise, ratio=85.0, over_floor=40.0)) == 0


@pytest.mark.parametrize("count", (5, 9, 40, 3000))
def test_derivative_is_that_of_the_operator(count):
    random = np.random.default_rng(count)
    time = 1e-3 * (np.arange(count) + 0.2 * random.random(count))
    time[count // 2 :] += 0.5  # a gap
    values = random.normal(size=(count, 3))
    operator = derivative_operator(time)
    assert_allclose(derivative(values, time), operator @ values, rtol=1e-11, atol=1e-9)
    assert_allclose(derivative(values[:, 0], time), operator @ values[:, 0], rtol=1e-11, atol=1e-9)


def test_wide_kernels_by_fourier_transform_are_the_direct_ones():
    """Each block by itself, also where it is shorter than the kernel's reach."""
    random = np.random.default_rng(4)
    time = np.concatenate([np.arange(2001), 2500 + np.arange(700), 5000 + np.arange(30)]) * 1e-3
    values = 250.0 + np.cumsum(random.normal(size=(time.size, 2)), axis=0)
    smooth = gaussian_filter(values, time, 7.0)
    width = gaussian_sigma(7.0) / 1e-3
    for start, end in ((0, 2001), (2001, 2701), (2701, 2731)):
        block = values[start:end]
        pad = min(int(np.ceil(6.0 * width)), len(block) - 1)
        padded = np.concatenate([2 * block[0] - block[pad:0:-1], block,
                                 2 * block[-1] - block[-2 : -pad - 2 : -1]])
        direct = ndimage.gaussian_filter1d(padded, width, axis=0, mode="nearest",
                                           radius=int(np.ceil(6.0 * width)))
        assert_allclose(smooth[start:end], direct[pad : pad + len(block)], atol=1e-11)


def test_jitter_is_no_gap_and_lost_samples_are():
    random = np.random.default_rng(11)
    time = 1e-3 * np.delete(np.arange(4000.0), [1200, 1201, 2500])
    lost = [1200, 2498]
    assert [int(rows[0]) for rows in blocks(time)[1:]] == lost
    jittered = time + 2e-4 * random.standard_normal(time.size)
    assert np.sum(np.diff(jittered) > 1.5e-3) > 50
    starts = np.array([int(rows[0]) for rows in blocks(jittered)[1:]])
    assert all(np.min(np.abs(starts - each)) <= 2 for each in lost) and starts.size <= 8


def test_one_clock_goes_on_through_lost_samples():
    """A seventh of a step of jitter and a fiftieth of the samples lost: late stamps near to a gap were gaps,
    too, and the short stretches between them had clocks of their own. Seeds 0 to 7, the first eight, some
    120 gaps each."""
    for seed in range(8):
        random = np.random.default_rng(seed)
        ticks = np.flatnonzero(random.random(6000) > 0.02)
        time = 2e-3 * ticks
        clock = even_clock(time + 3e-4 * random.standard_normal(time.size))
        astray = np.abs(clock - time) > 3e-4
        assert np.sqrt(np.mean((clock - time)[~astray] ** 2)) < 4e-5  # 5.3e-5 to 6.7e-5 before
        starts = [int(rows[0]) for rows in blocks(clock)[1:]]
        assert len(set(starts) ^ set(np.flatnonzero(np.diff(ticks) > 1) + 1)) <= 2
        assert np.mean(astray) < 1e-3  # 2e-3 to 4e-2 before


@pytest.mark.parametrize("step", [8e-4, 1.6e-3, 1.9e-3, 2.5e-3])
def test_stamps_in_milliseconds_are_counted_through_lost_samples(step):
    """Seed 1; 0 to 7 do as well. Rounding alone leaves less than a hundredth of a step. With one in fifty
    lost, an error of 0.05 to 0.28 steps RMS stood before, of which 0.01 to 0.09 are left."""
    ticks = np.flatnonzero(np.random.default_rng(1).random(20000) > 0.02)
    for each, most in ((np.arange(20000), 0.01), (ticks, 0.1)):
        late = (even_clock(np.round(step * each, 3)) - step * each) / step
        assert np.std(late) < most


def test_a_pause_begins_another_clock():
    random = np.random.default_rng(3)  # any: 0 to 7 were tried
    time = np.concatenate([1e-3 * np.arange(1000.0), 5.0007 + 1e-3 * np.arange(1000.0)])
    clock = even_clock(time + 1e-4 * random.standard_normal(time.size))
    assert_allclose(clock, time, atol=5e-5)


def test_even_clock_takes_jitter_out_to_the_ends_of_a_run():
    random = np.random.default_rng(12)
    time = np.arange(0.0, 4.0, 1e-3)
    clock = even_clock(time + 2e-4 * random.standard_normal(time.size))
    assert_allclose(np.diff(clock), 1e-3, rtol=2e-3)
    assert_allclose(clock, time, atol=5e-5)
    assert even_clock(time) is time


@pytest.mark.parametrize("noise", [0.0, 2e-5])
def test_true_stamps_are_told_from_a_late_logger(noise):
    """Samples at 1 rad/s with a wave on it, read at their stamps or evenly."""
    random = np.random.default_rng(13)
    even = np.arange(0.0, 4.0, 1e-3)
    stamps = even + 2e-4 * random.standard_normal(even.size)
    angle, rate = (lambda t: t + 0.1 * np.sin(5.0 * t)), 1.0 + 0.5 * np.cos(5.0 * even)
    scatter = noise * random.standard_normal(even.size)
    clock = even_clock(stamps)
    assert stamps_are_true(angle(stamps) + scatter, rate, stamps, clock)
    assert not stamps_are_true(angle(even) + scatter, rate, stamps, clock)
    assert not stamps_are_true(angle(even) + scatter, rate, even, even_clock(even))


def test_ends_of_a_noisy_signal_are_filtered_too():
    random = np.random.default_rng(14)
    time = np.arange(0.0, 20.0, 4e-3)
    line = 3.0 - 2.0 * time
    assert_allclose(gaussian_filter(line, time, 0.5, noisy=True), line, atol=1e-12)
    both = np.stack([line, 5.0 * line], axis=1)
    assert_allclose(gaussian_filter(both, time, 0.5, noisy=True), both, atol=1e-11)
    noise = random.standard_normal((time.size, 40))
    filtered = gaussian_filter(noise, time, 0.5, noisy=True)
    middle = np.sqrt(np.mean(filtered[2000:3000] ** 2))
    for end in (filtered[:20], filtered[-20:]):
        assert np.sqrt(np.mean(end**2)) < 3.0 * middle
    assert np.sqrt(np.mean(gaussian_filter(noise, time, 0.5)[0] ** 2)) > 8.0 * middle  # why it is asked for
