"""Tables on terminals of every width."""

from __future__ import annotations

import pytest

from exactarm.report import Quantity, Report, Table
from exactarm.report.terminal import columns_of, render_text


@pytest.mark.parametrize("width", [100, 80, 60])
def test_tables_fit_a_narrow_terminal(width):
    """Headers and texts wrap, columns that do not fit continue below; no number is lost."""
    numbers = [[Quantity(1.2345 * 10.0**k, "Nm") for k in range(-1, 4)] for _ in range(4)]
    header = ("", "RMS of the torque", "RMS error before", "RMS error after", "maximum", "std. dev.")
    wide = Table("Wide", header,
                 tuple((f"axis {i + 1}, identification", *row) for i, row in enumerate(numbers)))
    why = "the data cannot tell it from the others: one of the two has to be declared by hand"
    said = Table("Said", ("what", "size", "why"), (("a parameter", 3, why), ("another one", 4, "no reason")))
    rows = ((why, 2, Quantity(0.5, "m")), ("short", 3, Quantity(2.0, "m")))
    mixed = Table("Mixed", ("cause", "axis", "size"), rows)
    text = render_text(Report("T", "V.", (wide, said, mixed)), width)
    assert max(len(line) for line in text.splitlines()) <= width
    assert all(f"axis {i + 1}," in text for i in range(4))
    assert all(text.count(cells[0]) >= 4 for cells in columns_of(wide)[1][1:])
    assert " ".join(why.split()[:4]) in " ".join(text.split())


def test_a_table_that_fits_is_left_alone():
    table = Table("Small", ("a", "b c"), (("x", 1), ("y", 22)))
    assert "  a  b c\n  x    1\n  y   22" in render_text(Report("T", "V.", (table,)), 60)
