"""Touches that their own contact explains whatever the arm does: they do not count, and are said."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.errors import InputError
from exactarm.identify.closures import nominal_closures
from exactarm.identify.evaluate import evaluate_closures
from exactarm.identify.judged_rows import JUDGED_FROM, judged_rows, unjudged_lines
from exactarm.simulate import Sensors
from exactarm.simulate.closures import measure_closures
from test_closures import virtual


@pytest.fixture(scope="module", params=["socket", "plane", "sphere"])
def touched(request):
    """An arm whose contact 0 has many touches and contact 1 one fewer than tell anything."""
    kind, (robot, _) = request.param, virtual("panda", 3)
    sensors, random = Sensors(position_m=5e-5, counts=0), np.random.default_rng(1)
    data = measure_closures(robot, kind, 2, 30, sensors, random)[0]
    second = np.flatnonzero(data.contacts[kind] == 1)[: JUDGED_FROM[kind] - 1]
    return kind, robot.nominal, data, np.concatenate([np.flatnonzero(data.contacts[kind] == 0), second])


@pytest.mark.slow
def test_touches_that_a_contact_explains_by_itself_do_not_lower_the_error(touched):
    kind, robot, data, rows = touched
    few = evaluate_closures(robot, data.select(rows))
    assert few.overall.n == len(rows) - JUDGED_FROM[kind] + 1 and few.overall.min > 1e-6
    (told,) = [line for line in few.warnings if "do not count" in line]
    assert f"rows of {kind} 1 of session" in told and f"at least {JUDGED_FROM[kind]} touches" in told


@pytest.mark.slow
def test_a_contact_that_other_rows_have_fitted_judges_a_single_touch(touched):
    kind, robot, data, _ = touched
    layout = nominal_closures(robot, data, Layout.of(())).layout
    one = data.select(np.flatnonzero(data.contacts[kind] == 1)[:1])
    assert not judged_rows(one).any() and judged_rows(one, layout).all()
    assert judged_rows(data).all() and unjudged_lines(data) == ()


@pytest.mark.slow
def test_touches_of_which_none_can_be_judged_are_refused(touched):
    kind, robot, data, _ = touched
    names = np.arange(len(data)) // max(JUDGED_FROM[kind] - 1, 1)  # every contact one touch short
    with pytest.raises(InputError, match=f"no row can be judged: rows of {kind} 0 of session"):
        evaluate_closures(robot, replace(data, contacts=data.contacts | {kind: names}))

