"""Tracked motions whose time stamps scatter, and the rows of several files."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects import effect_from_table
from exactarm.identify.evaluate import evaluate_tracked_motion
from test_diagnose_tracked import NOISE_M, RATE_HZ, tracked, ur10


@pytest.mark.slow
@pytest.mark.parametrize("as_stamped", [False, True])
def test_stamps_that_scatter_hide_no_delay(as_stamped):
    """By a twentieth of a step, of samples read evenly or at their stamps: a spline through the stamps of
    even ones left twelve times the noise. Seed and noise are those of test_diagnose_tracked.py; 1.04 and 1.08
    of the noise are left here, 1.02 where no stamp scatters."""
    delay = effect_from_table({"effect": "time_delay", "delay_s": 0.012})
    if as_stamped:
        data = tracked(delay, 3, scatter=0.05)
    else:
        even = tracked(delay, 3)
        random = np.random.default_rng(3)
        data = replace(even, time=even.time + random.normal(0.0, 0.05 / RATE_HZ, len(even)))
    result = diagnose(ur10(), data)
    assert result.verdict == EXPLAINED and [f.effect.label for f in result.findings] == [delay.label]
    assert result.after["validation"].rms < 1.1 * np.sqrt(3.0) * NOISE_M


def test_every_session_of_paths_has_rows_of_either_sort():
    """Two files are two set-ups: the second was left to validation whole, and its frames to nobody."""
    data = replace(tracked(None, 3, runs=2, seconds=4.0), identification=None)
    data = replace(data, session=data.run)
    chosen = data.split(1)
    for session in (1, 2):
        assert 0.6 < np.mean(chosen[data.session == session]) < 0.8
    evaluate_tracked_motion(ur10(), data)
