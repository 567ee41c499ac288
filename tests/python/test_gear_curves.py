"""Curves of all gears at once, each under the law of its amplitudes that the data ask for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm.chain import Layout
from exactarm.diagnose.gear_curves import with_curves
from exactarm.diagnose.problems import problem_for
from exactarm.effects import effect_from_table
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

ROWS, NOISE_M, AXES = 300, 4e-5, 6
RUN_OUT = GearEccentricity(2, (3e-4, -2e-4, 1e-4, 1e-4))


def curve(axis: int, amplitude_rad: float, fall: float, orders: int, rng) -> GearHarmonics:
    """Drawn from its law; at every angle."""
    law = GearHarmonics.curve(axis, orders, amplitude_rad, (-np.pi, np.pi), fall)
    sizes = np.array([p.prior if np.isfinite(p.prior) else 0.0 for p in law.parameters()])
    values = np.where(sizes > 0.0, rng.standard_normal(sizes.size) * sizes, law.values)
    return effect_from_table({k: v for k, v in law.with_values(values).to_table().items()
                              if k not in ("seen_from_rad", "seen_to_rad")})


def with_run_outs_found(hidden, seed=1):
    """A fit of poses with hidden effects, to which a run-out of axis 2 has been added. Any seed will do: the
    tests below hold for 1 to 20 (a curve of no size once beat a run-out that is not there, but for seeds 4 to
    6, 15 and 19: seed 5 hid it, and is not the one any more)."""
    rng, robot = np.random.default_rng(seed), load_robot("ur10")
    true = true_robot(robot, rng, 0.0)
    q = [joints_in_limits(robot, ROWS, rng)]
    data = measured(robot, [true], q, NOISE_M, rng, layout=Layout.of(tuple(hidden(rng)), estimate=False))
    every = np.ones(len(data), bool)
    problem = problem_for(robot, data.select(every), data.select(~every), 1, 0)
    declared = problem.declared()
    found = RUN_OUT.with_values((0.0,) * 4)
    fitted = problem.fit(declared.joined(Layout.of((found,))))
    templates = [GearHarmonics.curve(axis, 40, 3e-5, (float(q[0][:, axis - 1].min()),
                                                     float(q[0][:, axis - 1].max())))
                 for axis in range(1, AXES + 1)]
    count = float(3 * ROWS - declared.size)
    return problem, fitted, len(declared.effects), templates, count


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_every_axis_gets_the_curve_that_it_asks_for(seed):
    hidden = lambda rng: [curve(axis, 3e-5, 1.0, 40, rng) for axis in (1, 2, 3)]
    problem, fitted, first, templates, count = with_run_outs_found(hidden, seed)
    effects = with_curves(problem, fitted, first, templates, count)
    curves = {effect.joint: effect for effect in effects if effect.any_curve}
    assert {1, 2, 3} <= set(curves)
    # Nothing is hidden on the others: what a curve there may take is an order of magnitude less.
    assert all(effect.curve_rad <= 3e-6 for axis, effect in curves.items() if axis > 3)
    # The amplitude is the drawn one, not one beside a noise that the curves were part of.
    assert all(curves[axis].curve_rad == 3e-5 for axis in (1, 2, 3))
    # The run-out is part of the curve now.
    assert [effect.joint for effect in effects].count(2) == 1
    before = problem.errors(fitted, problem.data)
    layout = Layout(fitted.layout.effects[:first], fitted.layout.free[:first])
    after = problem.errors(problem.fit(layout.joined(Layout.of(tuple(effects)))), problem.data)
    assert np.sqrt(np.mean(after**2)) < 0.6 * np.sqrt(np.mean(before**2))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("hidden", [lambda rng: [RUN_OUT], lambda rng: []], ids=["run-out", "nothing"])
def test_what_is_no_curve_gets_none(hidden, seed):
    assert with_curves(*with_run_outs_found(hidden, seed)) is None


@pytest.mark.parametrize("found", [(), (SimpleNamespace(family="", joint=None),)])
def test_without_any_error_of_a_gear_nothing_is_asked(found):
    """Encoders of 65,536 counts, each pose visited twice, showed curves otherwise (test_quantisation.py)."""
    fitted = SimpleNamespace(layout=SimpleNamespace(effects=found))
    assert with_curves(None, fitted, 0, [GearHarmonics.curve(1, 40, 3e-5, (-1.0, 1.0))], 100.0) is None


def test_a_law_is_written_and_read_back():
    law = GearHarmonics.curve(3, 40, 1e-5, (-1.0, 2.0), 1.5)
    read = effect_from_table(law.to_table())
    assert (read.fall, read.curve_rad, read.values) == (1.5, 1e-5, law.values)
    orders = np.arange(1, 41)
    amplitudes = np.array([p.prior for p in read.parameters()][1::2]) / orders
    assert amplitudes == pytest.approx(1e-5 * np.minimum(1.0, (orders / 10.0) ** -1.5))


def test_laws_share_their_first_terms():
    laws = list(GearHarmonics.curve(3, 4, 1e-5, (-1.0, 2.0)).laws())
    assert len({(law.curve_rad, law.fall, law.multiples) for law in laws}) == len(laws)
    assert all(law.values[0] == 1.0 and law.seen == (-1.0, 2.0) for law in laws)
    assert not list(GearHarmonics.zero(3, (5.0,)).laws())


@pytest.mark.slow
@pytest.mark.parametrize("crossed_rad", [0.0, 6e-4])
def test_poses_with_curves_tell_whether_something_else_acts(crossed_rad):
    """It was null. crossed: a turn of axis 4 by the angles of axes 1 and 5, which no effect of the library
    makes; half as large, it has 0.5. Seed 1, the first tried."""
    rng, robot = np.random.default_rng(1), load_robot("ur10")
    data = ea.simulate(robot, count=200, deviation=1, seed=1, noise=3e-5).data
    q = data.joints["theta"] / robot.ratios
    curves = [sum(4e-4 * k**-0.75 * np.sin(k * q[:, axis] + rng.uniform(0.0, 6.0)) for k in range(1, 15))
              for axis in (0, 2, 4)]
    wrong = np.zeros_like(q)
    wrong[:, [0, 2, 4]] = np.transpose(curves)
    wrong[:, 3] = crossed_rad * np.sin(2.0 * q[:, 0]) * np.cos(q[:, 4])
    shifted = replace(data, joints=dict(data.joints) | {"theta": data.joints["theta"] - wrong * robot.ratios})
    result = ea.diagnose(robot, shifted, seed=0, threads=1)
    assert result["self_test"] is None  # judged step by step
    something, nothing = result["probability_something_else"], result["probability_nothing"]
    if crossed_rad:
        assert something > 0.99 and nothing < 0.01 and result["verdict"] == "unexplained"
    else:
        assert something < 0.1 and nothing < 0.01 and result["verdict"] == "explained"
