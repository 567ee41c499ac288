"""Lines in the spectrum of what a model leaves."""

import numpy as np

from exactarm.noise.broadband import line_of_its_own

STEP = 0.01
TIME = STEP * np.arange(1500)


def noise(seed, size=0.3):
    return np.random.default_rng(seed).normal(0.0, size, TIME.size)


def wave(hertz):
    return np.sin(2.0 * np.pi * hertz * TIME)


def test_a_wave_that_no_prediction_has_is_told_by_its_frequency():
    residual, predicted = wave(3.3) + noise(1), wave(0.4)
    found = line_of_its_own([residual[:100], residual], [predicted[:100], predicted], STEP)
    assert abs(found - 3.3) < 0.5 / TIME[-1]


def test_noise_two_waves_and_a_wave_of_the_motion_are_no_line_of_their_own():
    assert line_of_its_own([noise(3)], [wave(0.4)], STEP) is None
    assert line_of_its_own([wave(3.3) + wave(7.1)], [wave(0.4)], STEP) is None
    assert line_of_its_own([wave(3.3)], [wave(0.4) + 0.2 * wave(3.3)], STEP) is None


def test_pieces_too_short_for_a_spectrum_tell_nothing():
    assert line_of_its_own([wave(3.3)[:60]], [wave(0.4)[:60]], STEP) is None
    assert line_of_its_own([], [], STEP) is None
