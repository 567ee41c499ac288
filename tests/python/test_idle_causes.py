"""A cause whose size comes out as nothing beside the others is none, however likely it was before them."""

from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.diagnose import posterior
from exactarm.diagnose.evidence import Members
from exactarm.diagnose.idle_causes import idle_places, least_told
from exactarm.diagnose.posterior import Place
from exactarm.effects import effect_from_table
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.joint_compliance import RelativeCompliance
from exactarm.robot_file import load_robot

BASE = effect_from_table({"effect": "base_compliance", "rad_per_Nm": 0.0})
RUN_OUT = effect_from_table({"effect": "gear_eccentricity", "joint": 2, "first_cos_rad": 3e-4,
                             "first_sin_rad": 0.0})
OF_A_SHARE = RelativeCompliance.none_of(load_robot("ur10"), 1).with_values((0.0, 1e-5, 0.0, 0.0))
DECLARED = Layout.of(())


def fitted(effects, residual=0.0, without_bound=0.0):
    """A fit whose bounds hold the base, and a spring beside its share at the flange, at zero; without_bound:
    where the fit would have the latter, in rad/Nm, known to 1e-5."""
    layout = Layout.of(tuple(effects))
    held = [np.full(int(free.sum()), effect is BASE) for effect, free in zip(layout.effects, layout.free)]
    held = np.concatenate(held or [np.zeros(0)]).astype(bool)
    values = layout.values
    unbounded = np.stack([values, np.full(held.size, 3e-5)])
    for effect, where in zip(layout.effects, layout.slices):
        if effect is OF_A_SHARE:
            held[where.start], unbounded[:, where.start] = True, (without_bound, 1e-5)
    bounds = np.stack([np.where(held, 0.0, -np.inf), np.full(held.size, np.inf)])
    return SimpleNamespace(layout=layout, residual=np.full((5, 3), residual), robot=load_robot("ur10"),
                           fit=SimpleNamespace(x=values, at_bound=held, bounds=bounds, unbounded=unbounded,
                                               covariance=1e-9 * np.eye(held.size)))


@pytest.mark.parametrize(("effects", "idle"),
                         [([BASE, RUN_OUT], [0]), ([RUN_OUT, BASE], [1]), ([RUN_OUT], []),
                          ([OF_A_SHARE, RUN_OUT], [0])])
def test_what_a_bound_holds_at_zero_or_no_arm_can_have_is_idle(effects, idle):
    assert idle_places(fitted(effects, without_bound=-2e-5), DECLARED) == idle


@pytest.mark.parametrize(("without_bound", "idle"), [(-1.7e-5, [0]), (-1.6e-5, []), (-1e-6, [])])
def test_a_spring_at_its_bound_stays_where_the_data_do_not_exclude_that_it_gives_way(without_bound, idle):
    """1.64 standard deviations. Under a generic load the weight at the flange may do nearly all that is
    seen."""
    assert idle_places(fitted([OF_A_SHARE, RUN_OUT], without_bound=without_bound), DECLARED) == idle


def test_the_effect_that_a_fit_tells_least_from_zero_goes_alone():
    """Two that trade are each uncertain: the other takes what the one leaves."""
    def told(*spreads):
        joint = [GearEccentricity(axis, (3e-4, 0.0, 0.0, 0.0)) for axis in range(1, len(spreads) + 1)]
        fit = fitted(joint)
        fit.fit.covariance = np.diag(np.repeat(np.square(spreads), 4))
        return least_told(fit, DECLARED)

    assert told(1e-5, 2e-5) == []
    assert told(1e-5, 4e-4) == [1] and told(5e-4, 4e-4, 1e-5) == [0]  # v' C^-1 v: 0.36 and 0.56
    assert told(1e-5, 2e-4) == []  # 2.25: of four values less than chance makes, but one may be real


@pytest.mark.parametrize("chosen", [[], [RUN_OUT]])
def test_the_others_are_fitted_anew_without_it(monkeypatch, chosen):
    tried = []

    def refit(problem, declared, effects, last, noise):
        tried.append(list(effects))
        return fitted(effects)

    monkeypatch.setattr(posterior, "refit", refit)
    picture = SimpleNamespace(quadratic=lambda members: (None, 0.0), vocabulary=SimpleNamespace(blocks=()))
    noise = SimpleNamespace(whiten=lambda columns: columns.reshape(-1, 1))
    found = SimpleNamespace(noise=noise, picture=picture, members=Members((), ()))
    new = [Place(effect.label, effect, 0.999, 9.0, (), 0) for effect in (BASE, RUN_OUT)]
    kept, fit = posterior._confirmed(None, DECLARED, chosen, fitted(chosen, 1.0), found, new)
    assert [place.effect for place in kept] == [RUN_OUT] and tried[-1] == [*chosen, RUN_OUT]
    assert fit.layout.effects == (*chosen, RUN_OUT)


def test_of_a_wave_and_a_curve_of_one_axis_each_is_found_again():
    """What a curve alone had promised was counted with the wave beside it in its place."""
    curve, wave = GearHarmonics.curve(6, 2, 1e-3, (-1.0, 1.0)), GearHarmonics.zero(6, (21.0, 22.0))
    places = [Place(effect.label, effect, 1.0, odds, (), 0)
              for effect, odds in ((curve, 900.0), (RUN_OUT, 500.0), (wave, 280.0))]
    assert posterior._one_each(places) == places[:2]  # the surest first
    blocks = [SimpleNamespace(label=place.label, effect=place.effect) for place in places]
    blocks.append(SimpleNamespace(label="unknown", effect=None))
    found = SimpleNamespace(members=Members((0, 1, 2, 3), (2, 2, 3, 4)), block=blocks.__getitem__)
    assert posterior._only(found, places[1:]) == Members((1, 2, 3), (2, 3, 4))
    assert posterior._only(found, [places[0]]) == Members((0, 3), (2, 4))
    assert posterior._only(found, []) == Members((3,), (4,))
