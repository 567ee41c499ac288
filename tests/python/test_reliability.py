"""bench/reliability.py: cases come back by their seed, shares of right statements by bin."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

import reliability  # noqa: E402
from exactarm.effects.gear_eccentricity import GearEccentricity  # noqa: E402
from exactarm.effects.gear_harmonics import GearHarmonics  # noqa: E402


def one(stated, hidden=("backlash_1",), noise="normal"):
    return {
        "seed": 0,
        "hidden": list(hidden),
        "masses": True,
        "noise": noise,
        "rows": 60,
        "verdict": "explained",
        "stated": stated,
        "seconds": 1.0,
    }


def test_bins_count_what_was_stated_and_what_was_right():
    cases = [one([("backlash_1", 0.97, True), ("payload", 0.96, False)]), one([("payload", 0.7, True)])]
    low, high = reliability.reliability(cases)
    assert (low["n"], low["right"], low["stated"]) == (1, 1, pytest.approx(0.7))
    assert (high["n"], high["right"], high["stated"]) == (2, 1, pytest.approx(0.965))
    assert high["interval"][0] < 0.5 < high["interval"][1]
    assert "3 statements, expected calibration error 0.410" in reliability.printed(cases)


def test_another_form_of_a_hidden_cause_is_right_and_another_axis_is_not():
    curve = GearHarmonics.curve(3, 40, 1e-4, (-2.0, 2.0))
    assert reliability.is_right(GearEccentricity(3, (0.0,) * 4), (curve,), "normal")
    assert not reliability.is_right(GearEccentricity(2, (0.0,) * 4), (curve,), "normal")


@pytest.mark.parametrize("kind", reliability.NOISES)
def test_noise_has_its_variance_and_only_coloured_noise_a_memory(kind):
    noise = reliability.noise_of(kind, 20_000, np.random.default_rng(5))
    inner = noise[np.abs(noise).max(axis=1) < 5.0]
    assert np.std(inner) == pytest.approx(1.0, rel=0.12)
    neighbours = np.mean(noise[1:] * noise[:-1]) / np.mean(noise**2)
    assert (neighbours > 0.2) == (kind == "coloured")


def test_the_diagram_is_drawn(tmp_path):
    reliability.draw([one([("backlash_1", 0.97, True)])], tmp_path / "diagram.svg")
    drawn = (tmp_path / "diagram.svg").read_text()
    assert drawn.count("<path") > 40  # letters, axes, a point with its interval
