"""What a calibration shows of parameters, where it has estimated none of the arm."""

from types import SimpleNamespace

import numpy as np

from exactarm.commands.calibrate import _parameter_sections
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.identify.drawing import FREE
from exactarm.report import Figure
from exactarm.robot_file import load_robot


def result(*names: ParameterId) -> SimpleNamespace:
    count = len(names)
    fit = SimpleNamespace(x=np.full(count, 0.1), at_bound=np.zeros(count, bool),
                          interval=lambda: np.tile([0.05, 0.15], (count, 1)))
    return SimpleNamespace(names=names, fit=SimpleNamespace(fit=fit), shown=fit, drawn=FREE)


def figures(*names: ParameterId) -> list[Figure]:
    sections = _parameter_sections(load_robot("ur10"), result(*names))
    return [section for section in sections if isinstance(section, Figure)]


def test_without_a_parameter_of_the_arm_there_is_nothing_to_draw():
    frame = ParameterId("session_1.base_x_m", Group.FRAME, "base", session=1)
    assert figures(frame) == []
    (figure,) = figures(ParameterId("a_2_m", Group.GEOMETRY, "a", 2), frame)
    figure.build()
