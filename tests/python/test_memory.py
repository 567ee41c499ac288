"""What rows cost in memory is said before the work, and evaluations do it in blocks."""

import json
import os
import re
import threading
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from exactarm import cli
from exactarm.commands import memory
from exactarm.compensate.program import SourceText
from exactarm.data import point_text
from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.files import free_memory, table
from exactarm.files.examples import data_path
from exactarm.files.toml_file import read_toml
from exactarm.identify import evaluate as evaluation
from exactarm.robot.ur_calibration import _deltas
from exactarm.robot.urdf_tree import read_tree
from exactarm.robot_file import load_robot


class Said:
    """Keeps what a progress is told."""

    def __init__(self, stages: list):
        self.announce = stages.append


@pytest.fixture(scope="module")
def ur10():
    robot = load_robot("ur10")
    return robot, read_dataset(data_path("ur10/series_B.csv"), robot)


def test_too_many_rows_are_refused_with_the_number_that_fits(ur10, monkeypatch):
    _, data = ur10
    monkeypatch.setattr(memory, "free_bytes", lambda: 1.0 * memory.GIGABYTE)
    with pytest.raises(InputError,
                       match="series_B.csv: 1495 rows need about 3.02 GB of memory, 1 GB are free") as error:
        memory.within_memory("diagnose", "poses", data)
    most = int(re.search(r"at most (\d+) rows", str(error.value))[1])
    memory.within_memory("diagnose", "poses", data.select(np.arange(most)))
    memory.within_memory("evaluate", "poses", data)


def test_the_command_says_so_before_it_works(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(memory, "free_bytes", lambda: 0.4 * memory.GIGABYTE)
    assert cli.main(["diagnose", "ur10", str(data_path("ur10/series_B.csv")), "--out", str(tmp_path / "out"),
                     "--quiet"]) == 2
    assert "rows need about" in capsys.readouterr().err


def test_more_rows_than_are_worked_at_once_are_thinned_evenly_and_said(ur10, monkeypatch):
    _, data = ur10
    two = replace(data, session=np.where(np.arange(len(data)) < 60, 1, 2))
    monkeypatch.setitem(memory.COSTS, ("calibrate", "poses"), memory.Cost(65e3, 0.0, 300))
    said = []
    some, (warning,) = memory.within_memory("calibrate", "poses", two, Said(said))
    assert warning.startswith(f"1,495 rows are more than calibrate takes at once: it works on {len(some)}")
    assert 300 <= len(some) <= 350 and np.sum(some.session == 1) == memory.LEAST_OF_A_SESSION
    assert np.diff(some.row[some.session == 2]).max() <= 6 and some.row[-1] == data.row[-1]
    assert said and "of 1,495 rows" in said[0]
    assert memory.within_memory("calibrate", "poses", some.select(np.arange(300)), Said(said))[1] == ()


def test_of_more_rows_than_fit_a_command_that_may_leave_some_out_takes_those_that_fit(ur10, monkeypatch):
    _, data = ur10
    monkeypatch.setattr(memory, "free_bytes", lambda: 2.0 * memory.GIGABYTE)
    some, (warning,) = memory.within_memory("diagnose", "poses", data)
    assert memory.LEAST_WORKED <= len(some) < len(data)
    cost = memory.BASE_BYTES + len(some) * memory.COSTS["diagnose", "poses"].bytes_a_row
    assert cost <= memory.SHARE * 2.0 * memory.GIGABYTE
    assert warning.startswith(f"1,495 rows are more than diagnose takes at once in the memory that is free: "
                              f"it works on {len(some):,}")


def test_a_long_command_says_how_long_before_it_works(ur10, monkeypatch):
    _, data = ur10
    said = []
    memory.within_memory("diagnose", "poses", data, Said(said))
    assert len(said) == (1495 * memory.COSTS["diagnose", "poses"].seconds_a_row > memory.WORTH_SAYING_S)
    monkeypatch.setitem(memory.COSTS, ("diagnose", "poses"), memory.Cost(1e3, 1.0))
    memory.within_memory("diagnose", "poses", data, Said(said))
    assert said[-1] == "1,495 of 1,495 rows: about 25 min of a processor and 0.3 GB"


@pytest.mark.slow
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
def test_a_command_on_some_of_the_rows_warns_in_its_result(ur10, monkeypatch, tmp_path, command):
    monkeypatch.setitem(memory.COSTS, (command, "poses"), memory.Cost(65e3, 0.0, 60))
    assert cli.main([command, "ur10", str(data_path("ur10/series_B.csv")), "--out", str(tmp_path), "--quiet",
                     "--threads", "1"]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert f"1,495 rows are more than {command} takes at once" in result["warnings"][0]
    assert result["before"]["identification"]["n"] + result["before"]["validation"]["n"] == 60


def test_a_system_that_does_not_say_refuses_nothing(ur10, monkeypatch, tmp_path):
    monkeypatch.setattr(free_memory, "MEMINFO", tmp_path / "nothing")
    assert memory.free_bytes() is None
    memory.within_memory("diagnose", "poses", ur10[1])


def test_free_memory_is_read(tmp_path, monkeypatch):
    (tmp_path / "meminfo").write_text("MemTotal:  8 kB\nMemAvailable:     2048 kB\n")
    monkeypatch.setattr(free_memory, "MEMINFO", tmp_path / "meminfo")
    assert memory.free_bytes() == 2.0**21


def test_blocks_of_rows_give_what_all_rows_give(ur10, monkeypatch):
    robot, data = ur10
    whole = evaluation.evaluate_poses(robot, data)
    monkeypatch.setattr(evaluation, "BLOCK_ROWS", 97)
    assert np.array_equal(evaluation.evaluate_poses(robot, data).residual, whole.residual)


def test_frames_from_some_of_many_rows_judge_all_of_them(ur10, monkeypatch):
    robot, data = ur10
    two = replace(data, session=np.where(np.arange(len(data)) < 50, 1, 2))
    whole = evaluation.evaluate_poses(robot, two)
    monkeypatch.setattr(evaluation, "MOST_FITTED", 600)
    some = evaluation.evaluate_poses(robot, two)
    # The error of a nominal arm is structure: other rows give the frames a little other weights, at 600 rows
    # by 4 % of it.
    assert len(some.error) == len(data) and some.overall.rms == pytest.approx(whole.overall.rms, rel=0.05)


def test_the_limit_of_a_container_or_of_the_process_counts_where_it_is_smaller(monkeypatch, tmp_path):
    monkeypatch.setattr(free_memory, "MEMINFO", tmp_path / "meminfo")
    monkeypatch.setattr(free_memory, "GROUP", tmp_path)
    monkeypatch.setattr(free_memory, "STATM", tmp_path / "statm")
    assert memory.free_bytes() is None
    (tmp_path / "meminfo").write_text("MemTotal: 9000000 kB\nMemAvailable: 4000000 kB\n")
    assert memory.free_bytes() == 1024.0 * 4000000
    (tmp_path / "memory.current").write_text("1000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.free_bytes() == 1024.0 * 4000000
    (tmp_path / "memory.max").write_text("501000\n")
    assert memory.free_bytes() == 500000.0
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda which: (200 * resource.getpagesize(), 0))
    (tmp_path / "statm").write_text("190 7 3\n")
    assert memory.free_bytes() == 10.0 * resource.getpagesize() < 500000.0


def test_a_small_file_of_many_rows_is_refused_before_it_is_read(tmp_path, monkeypatch):
    rows = pa.table({"q_1_rad": np.full(1_000_000, 0.5)})
    pa.parquet.write_table(rows, tmp_path / "poses.parquet")
    assert (tmp_path / "poses.parquet").stat().st_size < 20_000
    monkeypatch.setattr(table, "free_bytes", lambda: 1e7)
    with pytest.raises(InputError, match="poses.parquet: 1000000 rows of 1 columns need 0.0149 GB of memory"):
        table.read_table(tmp_path / "poses.parquet")


def test_a_file_larger_than_the_memory_is_refused_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "poses.csv"
    with path.open("wb") as file:
        file.truncate(2**40)  # without a block on the disk
    with pytest.raises(InputError, match="poses.csv: cannot be read .larger than the memory that is free"):
        table.read_table(path)


@pytest.mark.parametrize("read", [
    lambda path: table.read_table(path), lambda path: read_toml(path, "a robot file"), read_tree,
    point_text.header_names, SourceText.read, lambda path: _deltas(path, 6),
])
def test_a_device_without_an_end_is_refused(read):
    with pytest.raises(InputError, match="/dev/zero: cannot be read"):
        read("/dev/zero")


def test_a_pipe_is_read(tmp_path):
    """As a shell hands over what a command prints."""
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=("name = 'arm'",))
    writer.start()
    assert read_toml(pipe, "a robot file") == {"name": "arm"}
    writer.join()
