"""Units on a sliding axis: m and N in tables and sentences, where a revolute one has rad and Nm."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.commands.effect_sections import parameters_table
from exactarm.diagnose.diagnosis import Finding
from exactarm.effects import library
from exactarm.effects.axis_units import moves_by, of_a_slide
from exactarm.effects.backlash import Backlash
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.effects.joint_offset import JointOffset
from exactarm.effects.units_in_names import unit_of
from exactarm.robot.robot import Joint, Robot

SLIDE, TURN = Joint(type="prismatic", q_min=-0.2, q_max=0.0), Joint(d=0.4, a=0.35)
ARM = Robot("scara", (TURN, replace(TURN, alpha=np.pi), SLIDE, Joint()))


@pytest.mark.parametrize("joint, motor, said, name, unit", [
    (3, 4, "the motor of axis 4 moves axis 3 by 0.0016 m per rad", "coupling_m_per_rad", "m/rad"),
    (4, 3, "the motor of axis 3 turns axis 4 by 0.0016 rad per m", "coupling_rad_per_m", "rad/m"),
    (2, 1, "the motor of axis 1 turns axis 2 by 0.0016 rad per rad", "coupling_rad_per_rad", "rad/rad"),
])
def test_a_coupling_is_in_the_units_of_its_two_axes(joint, motor, said, name, unit):
    effect = JointCoupling(joint, (float(motor), 1.6e-3))
    assert effect.describe_on(ARM) == said
    assert effect.in_units_of(ARM, "coupling_rad_per_rad") == name and unit_of(name) == unit


def test_a_sliding_axis_has_no_gear_ratio_but_a_scale_of_its_travel():
    """"A wrong gear ratio" was said of a rail."""
    slide, turn = GearRatio(3, (2e-4,)), GearRatio(1, (2e-4,))
    assert slide.in_plain_words_on(ARM) == "a wrong scale of the travel"
    assert slide.describe_on(ARM) == ("axis 3 travels 1 + 0.0002 times as far as is declared, 0.2 mm in a "
                                      "metre")
    assert turn.in_plain_words_on(ARM) == "a wrong gear ratio"
    assert "the gear of axis 1" in turn.describe_on(ARM)


def test_tables_say_the_unit_of_the_axis():
    effects = [JointCoupling(3, (4.0, 1.6e-3)), replace(Backlash(3, (2e-4, 0.0)), least_Nm=0.0)]
    findings = [Finding(e, np.array([[v, v] for v in e.values]), 1.0, 0.5, 1.0, "", {}) for e in effects]
    rows = parameters_table([(finding, None) for finding in findings], ARM).rows
    assert {(name, cell.unit) for _, name, cell in rows} >= {
        ("coupling_m_per_rad", "m/rad"), ("width_m", "m")}


def test_every_effect_of_one_axis_says_it_without_radians_or_newton_metres_there():
    """But for those whose angles are no travel of the axis: bearings that tilt, orders, gyroscopes."""
    own = [cls for cls in library().values() if cls.in_axis_units]
    assert len(own) >= 12
    for cls in own:
        for size in (0, 1, 2, 3):
            effect = cls(3, (0.5,) * size)
            try:
                effect = effect.with_values([0.5] * len(effect.parameters()))
            except ValueError:
                continue
            names = [effect.in_units_of(ARM, parameter.name) for parameter in effect.parameters()]
            said = f"{effect.describe_on(ARM)} {' '.join(names)}".replace("_", " ").split()
            assert "Nm" not in said and "rad" not in said, (cls.name, said)


def test_the_own_signal_of_an_axis_that_slides_is_its_travel():
    assert [moves_by(ARM, joint) for joint in (2, 3)] == ["angle of axis 2", "travel of axis 3"]


def test_the_zero_of_a_sliding_axis_is_a_length():
    assert JointOffset.of(ARM, 2).describe() == "axis 3 has its zero at 0.00000 m"
    labels = [JointOffset.of(ARM, i).parameter_label(None) for i in (1, 2)]
    assert labels == ["q_offset_2_rad", "q_offset_3_m"]


@pytest.mark.parametrize("words, slide", [
    ("width_rad", "width_m"), ("linear_rad_per_Nm", "linear_m_per_N"), ("radius", "radius"),
    ("cubic_rad_per_Nm3", "cubic_m_per_N3"), ("3 Nm s of it", "3 N s/m of it"),
    ("order_per_rev", "order_per_rev"),
])
def test_a_word_is_taken_as_a_whole(words, slide):
    assert of_a_slide(words) == slide


@pytest.mark.parametrize(("change", "words"), [
    (-0.8e-6, "axis 2 gives way by 3.2e-06 rad for every Nm that it carries, 8e-07 rad less than its "
              "declared spring has it"),
    (1e-6, "axis 2 gives way by 5e-06 rad for every Nm that it carries, 1e-06 rad more than its declared "
           "spring has it")])
def test_what_a_declared_spring_lacks_is_told_as_its_change(change, words):
    """It stood there as a spring that gives way by a negative number."""
    robot = ARM.with_joint(1, spring_linear=250e3)
    assert JointCompliance(2, (change, 0.0)).describe_on(robot) == words
    bare = robot.with_joint(1, spring_linear=None)
    plain = JointCompliance(2, (1e-6, 0.0)).describe_on(bare)
    assert plain == "axis 2 gives way by 1e-06 rad for every Nm that it carries"
    assert "8e-07 rad less" in JointCompliance(2, (-8e-7, 0.0)).describe()
