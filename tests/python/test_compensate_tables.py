"""Tables of targets as others write them: Excel's first line, columns of words, loads of rows."""

import csv

import numpy as np

from compensation_cell import LOAD, Cell, identified, nearby
from interpreters.verdict import robot_of
from test_compensate import MICROMETRE, compensate


def test_the_line_by_which_excel_tells_the_delimiter_stays(tmp_path):
    """It was taken for the header, and the run ended in a fault of the program."""
    cell = Cell(identified(effects=False))
    line = lambda row: ";".join(map(repr, row)).replace(".", ",") + "\r\n"
    rows = "".join(map(line, nearby(cell.robot, 3).tolist()))
    plain = ";".join(f"q_{i}_rad" for i in range(1, 7)) + "\r\n" + rows
    files = {"plain.csv": plain.encode(), "excel.csv": ("\ufeffsep=;\r\n" + plain).encode()}
    code, written, _ = compensate(tmp_path, cell.robot, files)
    assert code == 0 and written["excel.csv"] == b"\xef\xbb\xbfsep=;\r\n" + written["plain.csv"]
    assert written["plain.csv"] != files["plain.csv"]


def test_words_in_other_columns_of_a_table_stay(tmp_path):
    """They were asked to be numbers."""
    cell = Cell(identified(effects=False))
    rows = nearby(cell.robot, 3).tolist()
    header = ",".join(f"q_{i}_rad" for i in range(1, 7))
    lines = ["Bemerkung," + header + ",note", *(f"Tür {k}," + ",".join(map(repr, row)) + ",-"
                                              for k, row in enumerate(rows))]
    code, written, _ = compensate(tmp_path, cell.robot, {"t.csv": "\r\n".join(lines).encode()})
    new = list(csv.DictReader(written["t.csv"].decode().splitlines()))
    assert code == 0 and [row["Bemerkung"] for row in new] == ["Tür 0", "Tür 1", "Tür 2"]
    assert all(abs(float(row["q_1_rad"]) - old[0]) > 1e-6 for row, old in zip(new, rows))
    assert {row["note"] for row in new} == {"-"}


def test_the_load_of_a_row_is_held_up(tmp_path):
    """It was passed over without a word."""
    cell = Cell(robot_of())
    rows = np.repeat(nearby(cell.robot, 1), 3, axis=0)
    named = [f"q_{i}_rad" for i in range(1, 7)]
    load = ["payload_kg", "payload_x_m", "payload_y_m", "payload_z_mm"]
    loads = [(0.0, 0.0, 0.0, 0.0), (*LOAD[:1], *LOAD[1][:2], 1e3 * LOAD[1][2]), (9.0, 0.0, 0.0, 200.0)]
    lines = [",".join(map(repr, [*map(float, q), *kg])) for q, kg in zip(rows, loads)]
    table = {"t.csv": "\n".join([",".join(named + load), *lines]).encode()}
    code, written, _ = compensate(tmp_path, cell.robot, table)
    new = list(csv.DictReader(written["t.csv"].decode().splitlines()))
    found = np.array([[float(row[name]) for name in named] for row in new])
    assert code == 0 and np.abs(found[1] - found[0]).max() > 1e-6 and np.abs(found[2] - found[0]).max() > 1e-5
    wanted = cell.tip(rows[:1])[0].position
    assert np.linalg.norm(cell.true_tip(found[1:2], np.zeros((1, 6)), LOAD)[0] - wanted) < MICROMETRE
    bare = compensate(tmp_path, cell.robot, table, "--payload", "0,0,0,0")[1]
    new = list(csv.DictReader(bare["t.csv"].decode().splitlines()))
    assert len({row["q_1_rad"] for row in new}) == 1
