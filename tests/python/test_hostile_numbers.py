"""Numbers that patterns, `isdigit` and `int` do not agree on, put into places of every reader's sample: read,
or refused in one line that names the file."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from exactarm import cli
from exactarm.commands.execute import parse
from exactarm.commands.listing import import_command
from exactarm.errors import InputError
from exactarm.files.whole_number import whole_number
from robustness.samples import samples
from robustness.trials import READERS

HOSTILE = [b"9" * 5000, "²".encode("latin-1"), "²".encode(), "٣".encode(), b"\x1e7", b"\x1c 3", b"1e400",
           b"1_0"]
PLACES = 25  # numbers of a sample, drawn


@pytest.fixture(scope="module")
def valid():
    return samples()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in READERS if not name.endswith((".parquet", ".src"))])
def test_a_hostile_number_is_read_or_refused(valid, name, tmp_path):
    content, random, path = valid[name], np.random.default_rng(3), tmp_path / name
    found = list(re.finditer(rb"\d+", content))
    for place in random.permutation(len(found))[:PLACES]:
        for word in HOSTILE:
            path.unlink(missing_ok=True)  # a file system may flush what is written over
            path.write_bytes(content[: found[place].start()] + word + content[found[place].end() :])
            try:
                READERS[name](path)
            except InputError as error:
                said = str(error.within(path))
                assert len(said.splitlines()) == 1 and name in said, said


@pytest.mark.parametrize("text, number", [
    ("7", 7), (" 012 ", 12), ("", None), ("-1", None), ("+1", None), ("1_0", None), ("²", None), ("٣", None),
    ("\x1e7", None), ("9" * 10, None), ("9" * 5000, None), ("7\n", None),
])
def test_a_whole_number_is_digits_alone(text, number):
    assert whole_number(text) == number


@pytest.mark.parametrize("words", [
    ["--counts", "9" * 400], ["--visits", "-" + "9" * 30], ["--seed", "9" * 30],
])
def test_a_number_of_an_option_beyond_64_bits_is_refused_by_the_name_of_the_option(words, tmp_path, capsys):
    """--counts of 400 digits was a fault in exactarm."""
    assert cli.main(["simulate", "ur10", "--out", str(tmp_path / "out"), *words]) == 2
    shown = words[1] if len(words[1]) < 40 else "a number of 333 hexadecimal digits"
    assert capsys.readouterr().err.startswith(f"exactarm: error: argument {words[0]}: {shown}; expected a ")
    with pytest.raises(InputError, match=f"argument {words[0]}"):
        parse(import_command("simulate"), ["ur10", "--out", "out", *words])
