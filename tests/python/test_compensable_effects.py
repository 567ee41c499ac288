"""Every effect of the library: a program and a plan correct it, or say that they do not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from compensation_cell import identified, reachable
from exactarm import _core
from exactarm.chain import Layout, motion_record, predict_motion, predict_poses
from exactarm.compensate.flange_poses import pose_error
from exactarm.compensate.law import CompensationModel, actual_of
from exactarm.data.dataset import Dataset
from exactarm.effects import library
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.plan.compensation import known_functions, planning_model
from motions import fourier_motion, motion_data

ARM = replace(identified(effects=False), effects=(JointCompliance(2, (4e-7, 0.0)),))
Q = reachable(ARM, 6)
APPROACH = np.random.default_rng(3).choice([-1.0, 1.0], Q.shape)
STEP_S = 0.01
MOVES_RAD = 1e-8  # a change of a command or of a plan that is no rounding


def candidates() -> dict[str, list]:
    """Name -> effects of a plausible size, on every axis where it could be."""
    layout = Layout.of(ARM.effects, estimate=False)
    time, angle, _, _ = fourier_motion(ARM, 3.0, 1.0 / STEP_S, 3)
    warm = {"temperature_degC": np.linspace(20.0, 30.0, time.size)}
    moving = motion_record(ARM, replace(motion_data(ARM, time, angle), covariates=warm))
    poses = Dataset.of_arrays("poses", {"q": angle[::3], "approach": np.sign(angle[::3])}, time=time[::3],
                              position=np.zeros((len(angle[::3]), 3)),
                              covariates={name: values[::3] for name, values in warm.items()})
    views = (predict_motion(ARM, layout, moving).view, predict_poses(ARM, layout, poses).view)
    found: dict[str, list] = {name: [] for name, cls in library().items() if not cls.declared}
    for name, effects in found.items():
        for view in views:
            if view.kind in library()[name].kinds and not effects:
                effects += [sized(effect) for effect in library()[name].candidates(ARM, view)]
    draft = {"joint": 5, "form": "a*(q_4 + q_6)^2", "of": ["q_4", "q_6"], "values": {"a": 3e-4}}
    # no axis of this motion turns so far that a wobble of it would be tried
    wobble = library()["axis_wobble"](2, (2.0, 5e-5, 3e-5))
    return found | {"expression": [library()["expression"].from_table(draft)], "axis_wobble": [wobble]}


def sized(effect):
    def value(parameter, now):
        if parameter.fixed:
            return now
        if parameter.search:
            return parameter.search[len(parameter.search) // 2]
        return float(np.clip(0.3 * parameter.plausible, parameter.lower, parameter.upper))

    return effect.with_values(value(p, now) for p, now in zip(effect.parameters(), effect.values))


FOUND = candidates()
NAMES = sorted(FOUND)


def found_in_data(effects) -> dict:
    """Intervals of the effects' parameters, as a diagnosis leaves them."""
    pairs = ((e.parameter_label(p), v) for e in effects for p, v in zip(e.parameters(), e.values))
    return {label: (value - 1e-9, value + 1e-9) for label, value in pairs}


@cache
def commands(effects: tuple = ()) -> np.ndarray:
    model = CompensationModel.of(replace(ARM, effects=ARM.effects + effects,
                                         intervals=found_in_data(effects)))
    targets = model.controller.poses(Q)
    found = model.commands(targets, Q, APPROACH)
    assert np.abs(pose_error(targets, model.reached(found.q, APPROACH))).max() < 1e-9
    return found.q


@cache
def planned(effects: tuple = ()) -> tuple[np.ndarray, tuple[str, ...]]:
    """All that a plan is made of, and its warnings."""
    model = planning_model(replace(ARM, effects=ARM.effects + effects))
    q, rate, acceleration = fourier_motion(ARM, 2.0, 1.0 / STEP_S, 5, amplitude=0.3)[1:]
    known = known_functions(model, q, STEP_S, "motion", 1)
    torque = _core.inverse_dynamics(model.core, q, rate, acceleration, 1)
    parts = (known.phi_shift, known.displacement, 1e-3 * torque, q / model.robot.ratios)
    return np.concatenate([part.ravel() for part in parts]), model.warnings


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_program_and_a_plan_correct_an_effect_or_say_that_they_do_not(name):
    cls, effects = library()[name], FOUND[name]
    model = lambda effect: CompensationModel.of(replace(ARM, effects=(*ARM.effects, effect)))
    moved = max((float(np.abs(commands((e,)) - commands()).max()) for e in effects[:12]), default=0.0)
    told = all(model(effect).left_out == (effect,) for effect in effects)
    assert (moved > MOVES_RAD) != (told or not effects)
    plans = [planned((effect,)) for effect in effects[:12]]
    moved = max((float(np.abs(plan[0] - planned()[0]).max()) for plan in plans), default=0.0)
    told = all(effect.label in " ".join(plan[1]) for effect, plan in zip(effects, plans))
    assert (moved > MOVES_RAD) != (told or not effects)
    assert effects or not cls.compensable or name == "guide_error"  # of arms that slide: test_guide_error


@pytest.mark.parametrize("signal", ["temperature_degC", "time_h"])
def test_a_formula_of_what_a_program_does_not_know_is_left_out_by_name(signal):
    draft = {"joint": 5, "form": f"a*{signal}", "of": [signal], "values": {"a": 3e-4}}
    effect = library()["expression"].from_table(draft)
    robot = replace(ARM, effects=(*ARM.effects, effect))
    assert CompensationModel.of(robot).left_out == (effect,) and not effect.compensable
    assert effect.label in " ".join(planned((effect,))[1])


@pytest.mark.parametrize(("turned", "motor"), [(5, 4), (6, 5), (3, 2)])
@pytest.mark.parametrize("coupling", [-1.0, 0.05, 0.5, 1.0])
def test_a_coupling_is_compensated_however_far_it_turns_the_axis(turned, motor, coupling):
    effects = (JointCoupling(turned, (float(motor), coupling)),)
    robot = replace(ARM, effects=ARM.effects + effects, intervals=found_in_data(effects))
    found = commands(robot.effects[1:])
    assert np.abs(found - Q).max() > 0.3 * abs(coupling) * np.abs(Q[:, motor - 1]).max()
    assert np.abs(actual_of(robot, found, APPROACH) - Q).max() < 1e-8


@pytest.mark.parametrize(("turned", "motor", "coupling"), [(3, 2, -1.0), (6, 5, 0.25)])
def test_a_coupling_that_the_robot_file_declares_is_the_controllers_own(turned, motor, coupling):
    """A parallelogram is no error of the arm: the correction stays as small as without it."""
    robot = replace(ARM, effects=(*ARM.effects, JointCoupling(turned, (float(motor), coupling))))
    model = CompensationModel.of(robot)
    targets = model.controller.poses(Q)
    found = model.commands(targets, Q, APPROACH)
    assert np.abs(pose_error(targets, model.reached(found.q, APPROACH))).max() < 1e-9
    assert np.abs(found.q - Q).max() < 0.1
    clear = found.amplification < 20.0  # of singular poses, which lie elsewhere for a coupled arm
    assert clear.any() and np.abs(actual_of(robot, found.q, APPROACH) - Q)[clear].max() < 1e-8
    there = model.controller.poses(Q)
    again = model.controller.nearest(there.position[0], there.rotation[0], Q[0] + 0.05)
    np.testing.assert_allclose(again, Q[0], atol=1e-7)
