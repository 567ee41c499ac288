"""Numbers in the sentences of a report."""

import pytest

from exactarm.report.numbers import with_prefixes


@pytest.mark.parametrize("words, said", [
    ("axis 2 gives way by 1.32e-05 rad for every Nm that it carries", "by 13.2 µrad for every Nm"),
    ("axis 3 has 0.0004 rad of backlash", "has 0.400 mrad of backlash"),
    ("tilted by 0.001, -0.003 rad more", "by 0.001, -0.003 rad more"),
    ("gone above 0.0125 rad/s", "above 0.0125 rad/s"),
    ("turns axis 3 by 0.01 rad per rad", "by 10.0 mrad per rad"),
])
def test_angles_have_their_prefix(words, said):
    assert said in with_prefixes(words)
