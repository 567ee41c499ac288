"""A refusal is one line, whatever stands in the file that it quotes."""

import pytest

from exactarm.errors import LONGEST_MESSAGE, InputError


@pytest.mark.parametrize("text", ["P[1\n2] is computed", "a\r\nb", "bell \x07 and \x1b[31mred",
                                  "line\u2028end\x85of"])
def test_what_a_file_holds_cannot_break_the_line(text):
    said = str(InputError(text, file="part.ls", line=6))
    assert len(said.splitlines()) == 1 and said.startswith("part.ls, line 6: ") and said.isprintable()


def test_a_megabyte_is_cut():
    assert len(InputError("x" * 10**6).message) == LONGEST_MESSAGE


def test_the_name_of_a_column_cannot_break_the_line_either():
    error = InputError("expected a number", file="runs.csv", row=1, column="\x0f\x1d5\n")
    assert str(error) == "runs.csv, row 1, column  5 : expected a number"
    assert len(str(InputError("x", column="q" * 10**6))) < 2 * LONGEST_MESSAGE
