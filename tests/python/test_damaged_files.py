"""Bytes of valid files changed at random: every reader either reads or refuses in one line, and nothing
else."""

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.robot.urdf import urdf_text
from exactarm.robot_file import load_robot, write_robot
from urdf_sample import random_urdf

DAMAGES = 150
WORDS = [b"", b",", b"\n", b"nan", b"1e999", b"-", b'"', b"\xff", b"\0", b"[", b"=", b"<", b"/>", b"_", b"99",
         b"session"]


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One to three places overwritten, cut out or doubled."""
    for _ in range(rng.integers(1, 4)):
        start = rng.integers(0, len(content))
        length = rng.integers(0, 12)
        word = WORDS[rng.integers(len(WORDS))]
        if rng.random() < 0.2:
            word = content[start : start + 40] * 2
        content = content[:start] + word + content[start + length :]
    return content[: rng.integers(1, len(content))] if rng.random() < 0.1 else content


def valid(tmp_path, kind: str) -> tuple[bytes, object]:
    robot = load_robot("ur10")
    if kind == "csv":
        return b"\n".join(
            data_path("ur10/series_B.csv").read_bytes().splitlines()[:12]
        ) + b"\n", lambda p: read_dataset(p, robot)
    if kind == "parquet":
        import pandas

        pandas.read_csv(data_path("ur10/series_B.csv"), nrows=12).to_parquet(tmp_path / "valid.parquet")
        return (tmp_path / "valid.parquet").read_bytes(), lambda p: read_dataset(p, robot)
    if kind == "toml":
        write_robot(tmp_path / "valid.toml", load_robot("racer-7-1.4"))
        return (tmp_path / "valid.toml").read_bytes(), load_robot
    text = urdf_text(robot) if kind == "urdf" else random_urdf(np.random.default_rng(1), "rrfr")
    return text.encode(), load_robot


@pytest.mark.parametrize("kind, ending",
                         [("csv", "csv"), ("parquet", "parquet"), ("toml", "toml"), ("urdf", "urdf"),
                          ("chain", "urdf")])
def test_damage_is_read_or_refused(tmp_path, kind, ending):
    content, read = valid(tmp_path, kind)
    path = tmp_path / f"damaged.{ending}"
    refused = 0
    for seed in range(DAMAGES):
        path.write_bytes(damaged(content, np.random.default_rng(seed)))
        try:
            read(path)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) and str(path) in str(error), f"seed {seed}"
        except Exception as error:
            pytest.fail(f"seed {seed}: {type(error).__name__}: {error}")
    assert refused > DAMAGES / 4
