"""Something else under a gyroscope: what the library lacks is told by what turns and what it follows, and no
effect stands for it with certainty."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.signal import Quantity, Signal
from exactarm.diagnose.something_else import beside_unknown
from exactarm.diagnose.verdict import UNEXPLAINED
from exactarm.effects import library
from exactarm.effects.gear_harmonics import GearHarmonics
from gear_simulation import DEGREE, GearRuns, joined, simulate
from rigid_arm import rigid

RATE_HZ, NOISE = 400.0, 0.05 * DEGREE
ORDER, SIZE = 23.0, 2e-3


@pytest.fixture(scope="module")
def racer():
    return rigid()


def runs(robot, sizes=(0.0, 0.0)) -> Dataset:
    """Two speeds of axis 2, to and fro, twice at 20 and twice at 40 degrees C; sizes of a wave of its gear at
    either."""
    parts, warm = [], []
    for number, (speed, size) in enumerate((speed, size) for size in sizes for speed in (40.0, 80.0)):
        case = GearRuns(2, speed * DEGREE, 4, RATE_HZ, NOISE, seed=5 + number, first_run=1 + 4 * number)
        wave = lambda time, phi, direction, size=size: size * np.sin(ORDER * phi) / ORDER
        parts.append(simulate(robot, case, rest=np.zeros(6), extra=wave))
        warm.append(np.full(len(parts[-1]), 20.0 if number < 2 else 40.0))
    return replace(joined(*parts), covariates={"temperature_degC": np.concatenate(warm)})


def share_of_the_wave(robot, data: Dataset):
    problem = problem_for(robot, data, data.select(np.zeros(len(data), bool)), 1, 0)
    effect, declared = GearHarmonics.zero(2, (ORDER,)), problem.declared()
    fitted = problem.fit(declared.joined(Layout.of((effect,))))
    without = fitted.without(len(declared.effects))
    steps = [(without, fitted.layout.effects[-1])]
    numbers = problem.correlation_factor(fitted) * fitted.residual.size
    return beside_unknown(problem, steps, lambda _: [effect], lambda _: numbers)


@pytest.mark.slow
def test_a_wave_of_a_gear_is_likelier_than_one_that_changes(racer):
    assert share_of_the_wave(racer, runs(racer, (SIZE, SIZE))).share > 0.99


@pytest.mark.slow
def test_what_a_wave_of_a_gear_changes_with_is_told_beside_it(racer):
    result = diagnose(racer, runs(racer, (SIZE, 3.0 * SIZE)))
    wave, = (finding for finding in result.findings if finding.effect.name == "gear_harmonics")
    assert wave.effect.values[0] == pytest.approx(ORDER, rel=0.01) and wave.probability > 0.99
    assert result.verdict == UNEXPLAINED
    assert [what for what in map(str, result.unknown) if what.startswith(
        "a turn of axis 2 follows the angle of axis 2 and the temperature_degC in 23")]


@pytest.mark.slow
def test_a_wave_that_grows_with_the_speed_is_no_other_where_the_library_lacks_it(racer, monkeypatch):
    """The same order at two speeds, twice as large at twice the speed."""
    parts = []
    for first, speed in ((1, 40.0), (5, 80.0)):
        case = GearRuns(2, speed * DEGREE, 4, RATE_HZ, NOISE, seed=9 + first, first_run=first)
        wave = lambda time, phi, direction, size=SIZE * speed / 40.0: size * np.sin(ORDER * phi) / ORDER
        parts.append(simulate(racer, case, rest=np.zeros(6), extra=wave))
    grown = joined(*parts)
    assert share_of_the_wave(racer, grown).share > 0.99  # the library has the effect that would win
    monkeypatch.delitem(library(), "speed_dependence")
    found = share_of_the_wave(racer, grown)
    assert found.share < 0.01
    assert "the speed of axis 2 in 23 waves a turn" in str(found.likeliest)


@pytest.mark.slow
def test_a_delay_that_the_library_lacks_follows_the_speed(racer, monkeypatch):
    monkeypatch.delitem(library(), "time_delay")
    clean = runs(racer)
    late = clean.gyro.copy()
    for run in np.unique(clean.run):
        rows = np.flatnonzero(clean.run == run)
        late[rows[3:]], late[rows[:3]] = clean.gyro[rows[:-3]], clean.gyro[rows[0]]
    result = diagnose(racer, replace(clean, gyro=late))
    assert result.verdict == UNEXPLAINED
    assert not [finding for finding in result.findings if finding.probability > 0.5]
    assert str(result.unknown[0]) == "a turn of axis 2 follows the speed of axis 2"


@pytest.mark.slow
def test_a_sensor_that_follows_a_covariate_is_told_with_its_axis(racer, monkeypatch):
    """A bias that bends with the temperature, as no effect of this library does."""
    monkeypatch.delitem(library(), "thermal_drift")
    clean = runs(racer)
    warm = np.linspace(20.0, 40.0, len(clean))
    biased = clean.gyro + 3e-3 * np.sin((warm - 20.0) / 4.0)[:, None] * np.array([0.0, 0.0, 1.0])
    result = diagnose(racer, replace(clean, gyro=biased, covariates={"temperature_degC": warm}))
    assert result.verdict == UNEXPLAINED
    assert "the sensor's z axis follows the temperature_degC" in map(str, result.unknown)


@pytest.mark.slow
def test_waves_that_may_change_are_those_of_the_model(racer):
    data = runs(racer, (SIZE, SIZE))
    problem = problem_for(racer, data, data.select(np.zeros(len(data), bool)), 1, 0)
    wave = GearHarmonics.zero(2, (ORDER,))
    declared = problem.fit(problem.declared())
    beside = problem.fit(problem.declared().joined(Layout.of((wave,))))
    asked = lambda fitted, instead=(): {one.by for one in problem.unknown_waves(fitted, instead)
                                        if abs(one.order - ORDER) < 1.0}
    named = {Signal(Quantity.TIME), Signal("temperature_degC"), Signal(Quantity.LOAD, 2)}
    others = named & set(problem.signals(declared))
    assert len(others) >= 2
    assert asked(declared) == asked(declared, [wave]) == set()
    assert asked(beside) == others
