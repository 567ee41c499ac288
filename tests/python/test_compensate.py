"""`exactarm compensate`: dialects through a virtual cell, what is refused, what is written."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import compensation_cell as cells
from compensation_cell import BASE, TOOL, Cell, identified, nearby, reachable
from exactarm.cli import main
from exactarm.robot.robot import Placement
from exactarm.robot_file import write_robot

MICROMETRE = 1e-6
FRAMES = ["--tool", "1=" + ",".join(map(str, TOOL)), "--base", "2=" + ",".join(map(str, BASE))]


def compensate(folder, robot, files, *options):
    """Exit code, new contents and result.json of a run."""
    write_robot(folder / "robot.toml", robot)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    paths = [str(folder / name) for name in files]
    code = main(["compensate", str(folder / "robot.toml"), *paths, "--out", str(folder / "out"), "--quiet",
                 *options])
    if code:
        return code, {}, {}
    written = {name: (folder / "out" / name).read_bytes() for name in files}
    return code, written, json.loads((folder / "out/result.json").read_text())


def missed(cell, wanted, commanded, near, approach, load=None):
    """Largest distance of the true tip from the targets, m."""
    q = cell.joints(commanded, near)
    return np.linalg.norm(cell.true_tip(q, approach, load) - [tip.position for tip in wanted], axis=1).max()


def changed_bytes_are_numbers(old: bytes, new: bytes) -> bool:
    """The same text once all numbers are taken out."""
    import re

    number = rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?"
    return re.sub(number, b"#", old) == re.sub(number, b"#", new)


def test_krl_points_are_met_within_a_micrometre(tmp_path):
    cell = Cell(identified())
    q = reachable(cell.robot, 8)
    files = cells.krl(cell, q)
    code, written, result = compensate(tmp_path, cell.robot, files, "--points", "calculated", *FRAMES)
    assert code == 0 and result["correction"]["n"] == 9
    assert result["as_written_max_m"] < MICROMETRE
    assert missed(cell, cells.read_krl(files), cells.read_krl(written), q, cell.approach(q)) < MICROMETRE
    assert missed(cell, cells.read_krl(files), cells.read_krl(files), q, cell.approach(q)) > 1e-3
    for name in files:
        assert changed_bytes_are_numbers(files[name], written[name]) and files[name] != written[name]


def test_urscript_poses_are_met_under_the_load_of_the_program(tmp_path):
    cell = Cell(identified(chain="calibrated"), base=Placement())
    q = nearby(cell.robot, 8)
    files = cells.urscript(cell, q)
    code, written, _ = compensate(tmp_path, cell.robot, files, "--points", "calculated")
    assert code == 0
    wanted, commanded = cells.read_urscript(files), cells.read_urscript(written)
    # linear motions come from the side of their last direction, so only joint motions are compared here
    joint = np.arange(1, 8)[[i % 2 == 1 for i in range(1, 8)]] - 1
    pick = lambda tips: [tips[k] for k in joint]
    assert missed(cell, pick(wanted), pick(commanded), q[1:][joint], cell.approach(q)[1:][joint],
                  cells.LOAD) < MICROMETRE
    assert changed_bytes_are_numbers(files["prog.script"], written["prog.script"])


def test_rapid_targets_are_met_under_the_load_of_their_tool(tmp_path):
    cell = Cell(identified())
    q = reachable(cell.robot, 8)
    files = cells.rapid(cell, q)
    code, written, result = compensate(tmp_path, cell.robot, files, "--points", "calculated")
    assert code == 0 and result["correction"]["n"] == 9 and result["as_written_max_m"] < MICROMETRE
    approach = cell.approach(np.vstack([q[:1], q]))[1:]
    assert missed(cell, cells.read_rapid(files), cells.read_rapid(written), q, approach,
                  cells.LOAD) < MICROMETRE
    assert changed_bytes_are_numbers(files["prog.mod"], written["prog.mod"])


def test_fanuc_positions_are_met_with_j3_from_the_horizon(tmp_path, capsys):
    cell = Cell(identified(coupling=((3, 2, 1.0),)))
    q = nearby(cell.robot, 8)
    files = cells.fanuc(cell, q)
    options = ["--points", "calculated", "--tool", "4=" + wpr(TOOL), "--base", "3=" + wpr(BASE)]
    code, written, result = compensate(tmp_path, cell.robot, files, *options)
    assert code == 0 and result["correction"]["n"] == 8 and result["as_written_max_m"] < MICROMETRE
    wanted, commanded = cells.read_fanuc(files), cells.read_fanuc(written)
    assert missed(cell, wanted, commanded, q[1:], cell.approach(q)[1:]) < MICROMETRE
    assert changed_bytes_are_numbers(files["prog.ls"], written["prog.ls"])
    assert "P[3]: its configuration" in refused(
        tmp_path, capsys, changed(files, "prog.ls", b"N U T", b"F U T"), *options[2:], robot=cell.robot)
    assert "coupling" in refused(tmp_path, capsys, files, *options[2:], robot=identified())


def wpr(frame):
    x, y, z, a, b, c = frame
    return ",".join(map(str, (x, y, z, c, b, a)))


def test_inform_positions_are_met_in_pulses_and_in_a_user_frame(tmp_path, capsys):
    cell = Cell(identified(pulses_per_rad=cells.PULSES))
    q = nearby(cell.robot, 8)
    files = cells.inform(cell, q)
    options = ["--points", "calculated", "--tool", "5=" + wpr(TOOL), "--base", "2=" + wpr(BASE)]
    code, written, result = compensate(tmp_path, cell.robot, files, *options)
    assert code == 0 and result["correction"]["n"] == 8 and result["as_written_max_m"] < MICROMETRE
    wanted, commanded = cells.read_inform(files), cells.read_inform(written)
    assert missed(cell, wanted, commanded, q[1:], cell.approach(q)[1:]) < MICROMETRE
    assert changed_bytes_are_numbers(files["prog.jbi"], written["prog.jbi"])
    assert "pulses per rad" in refused(tmp_path, capsys, files, *options[2:], robot=identified())


def test_joint_trajectories_are_met_at_their_own_order_of_joints(tmp_path, capsys):
    cell = Cell(identified(), Placement(), Placement())
    q = reachable(cell.robot, 1) + np.linspace(0.0, 0.3, 12)[:, None]
    files = cells.trajectory(q)
    code, written, result = compensate(tmp_path, cell.robot, files)
    wanted, commands = np.array([tip.position for tip in cell.tip(q)]), cells.read_trajectory(written)
    assert code == 0 and result["as_written_max_m"] < MICROMETRE
    assert np.linalg.norm(cell.true_tip(commands, np.ones_like(q) * np.sign(cell.robot.ratios)) - wanted,
                          axis=1).max() < MICROMETRE
    assert changed_bytes_are_numbers(files["prog.yaml"], written["prog.yaml"])
    assert "joint_names" in refused(tmp_path, capsys, changed(files, "prog.yaml", b"axis_3", b"elbow"))


def test_urscript_poses_need_the_controllers_own_calibration(tmp_path, capsys):
    cell = Cell(identified(), base=Placement())
    code, *_ = compensate(tmp_path, cell.robot, cells.urscript(cell, reachable(cell.robot, 3)), "--points",
                          "calculated")
    assert code == 2 and 'chain = "calibrated"' in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.slow
def test_tables_of_poses_get_the_joint_angles_that_reach_them(tmp_path, suffix):
    import pandas
    from scipy.spatial.transform import Rotation

    cell = Cell(identified(), Placement(), Placement())
    q = reachable(cell.robot, 30)
    tips = cell.tip(q)
    columns = {f"{axis}_mm": [1e3 * tip.position[i] for tip in tips] for i, axis in enumerate("xyz")}
    wxyz = np.roll([Rotation.from_matrix(tip.rotation).as_quat() for tip in tips], 1, axis=1)
    table = pandas.DataFrame(columns | {f"q{axis}": wxyz[:, i] for i, axis in enumerate("wxyz")}
                             | {f"q_{i + 1}_rad": q[:, i] for i in range(6)}
                             | {f"approach_{i + 1}": np.ones(30, int) for i in range(6)})
    path = tmp_path / f"targets.{suffix}"
    table.to_csv(path, index=False) if suffix == "csv" else table.to_parquet(path)
    code, _, result = compensate(tmp_path, cell.robot, {path.name: path.read_bytes()})
    new = (
        pandas.read_csv(tmp_path / "out" / path.name)
        if suffix == "csv" else pandas.read_parquet(tmp_path / "out" / path.name)
    )
    commands = new[[f"q_{i + 1}_rad" for i in range(6)]].to_numpy()
    wanted = np.array([tip.position for tip in tips])
    assert code == 0 and result["correction"]["n"] == 30
    assert np.linalg.norm(cell.true_tip(commands, np.ones_like(q)) - wanted, axis=1).max() < 1e-8
    assert new["x_mm"].equals(table["x_mm"]) or np.allclose(new["x_mm"], table["x_mm"], rtol=1e-15)


def test_tables_of_joint_angles_are_corrected_in_place(tmp_path):
    cell = Cell(identified(), Placement(), Placement())
    q = reachable(cell.robot, 5)
    lines = ["note,q_1_deg,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad"]
    lines += [f"{i}," + ",".join([repr(float(np.degrees(row[0]))), *map(repr, row[1:].tolist())])
              for i, row in enumerate(q)]
    code, written, _ = compensate(tmp_path, cell.robot, {"t.csv": ("\r\n".join(lines) + "\r\n").encode()})
    rows = list(csv.DictReader(written["t.csv"].decode().splitlines()))
    commands = np.array([[float(row[f"q_{i}_rad"]) for i in range(1, 7)] for row in rows])
    wanted = np.array([tip.position for tip in cell.tip(q)])
    assert (
        code == 0 and written["t.csv"].count(b"\r\n") == 6 and [row["note"] for row in rows] == list("01234")
    )
    assert np.linalg.norm(cell.true_tip(commands, cell.approach(commands)) - wanted, axis=1).max() < 1e-8


def test_a_table_keeps_its_delimiter_and_its_decimal_mark(tmp_path):
    cell = Cell(identified(), Placement(), Placement())
    q = reachable(cell.robot, 4)
    plain = ["q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad,note"]
    plain += [",".join([*map(repr, row.tolist()), str(i)]) for i, row in enumerate(q)]
    plain = "\n".join(plain) + "\n"
    marks = {"semicolon.csv": (";", ","), "tabulator.csv": ("\t", ","), "point.csv": (";", ".")}
    in_marks = lambda text, delimiter, decimal: text.replace(",", delimiter).replace(".", decimal)
    theirs = {name: in_marks(plain, *of) for name, of in marks.items()}
    files = {name: text.encode() for name, text in {"ours.csv": plain, **theirs}.items()}
    code, written, _ = compensate(tmp_path, cell.robot, files)
    assert code == 0
    for name, of in marks.items():
        assert written[name].decode() == in_marks(written["ours.csv"].decode(), *of)
        assert written[name].decode() != theirs[name]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_columns_by_other_names_are_corrected_like_ours(tmp_path, suffix):
    import pandas

    cell = Cell(identified())
    q = reachable(cell.robot, 5)
    tables = {name: pandas.DataFrame(np.degrees(q), columns=[letters.format(i) for i in range(1, 7)])
              for name, letters in (("ours", "q_{}_deg"), ("theirs", "J{}"))}
    files = {}
    for name, table in tables.items():
        path = tmp_path / f"{name}.{suffix}"
        table.to_csv(path, index=False) if suffix == "csv" else table.to_parquet(path)
        files[name] = path.read_bytes()
    options = [word for i in range(1, 7) for word in ("--map", f"J{i}=q_{i}_deg")]
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    _, ours, _ = compensate(tmp_path / "a", cell.robot, {f"t.{suffix}": files["ours"]})
    code, theirs, _ = compensate(tmp_path / "b", cell.robot, {f"t.{suffix}": files["theirs"]}, *options)
    read = pandas.read_csv if suffix == "csv" else pandas.read_parquet
    both = [read(tmp_path / f"{folder}/out/t.{suffix}") for folder in "ab"]
    assert code == 0 and both[0].equals(both[1]) and list(both[1]) == [f"q_{i}_rad" for i in range(1, 7)]
    assert 1e-5 < np.abs(both[1].to_numpy() - q).max() < 0.1
    assert suffix == "parquet" or ours == theirs  # the one of pandas remembers its own names


def test_a_map_that_fits_no_table_is_refused(tmp_path, capsys):
    cell = Cell(identified())
    q = reachable(cell.robot, 2)
    header = ",".join(f"q_{i}_rad" for i in range(1, 7))
    table = {"t.csv": (header + "\n" + ",".join(map(str, q[0])) + "\n").encode()}
    assert "--map names a column that is not there" in refused(tmp_path, capsys, table, "--map", "J1=q_1_deg")
    assert "expected a table" in refused(tmp_path, capsys, cells.krl(cell, q), "--map", "J1=q_1_deg",
                                         "--points", "calculated")


def test_a_point_of_a_program_that_may_be_taught_is_not_touched_without_a_word(tmp_path, capsys):
    cell = Cell(identified())
    files = cells.krl(cell, reachable(cell.robot, 3))
    code, *_ = compensate(tmp_path, cell.robot, files, *FRAMES)
    assert code == 2 and "--points" in capsys.readouterr().err
    _, written, _ = compensate(tmp_path, cell.robot, files, *FRAMES, "--points", "taught")
    assert written == files
    _, written, result = compensate(tmp_path, cell.robot, files, *FRAMES, "--points", "XP2")
    assert result["correction"]["n"] == 1 and written["prog.src"] == files["prog.src"]
    assert compensate(tmp_path, cell.robot, files, *FRAMES, "--points", "XP2,XP22")[0] == 2
    assert "--points XP22: no point" in capsys.readouterr().err


def test_a_position_of_fanuc_is_named_with_its_brackets(tmp_path):
    """They were read as a choice of letters, and no position had such a name."""
    cell = Cell(identified(coupling=((3, 2, 1.0),)))
    frames = ["--tool", "4=" + ",".join(map(str, (*TOOL[:3], *TOOL[:2:-1]))),
              "--base", "3=" + ",".join(map(str, (*BASE[:3], *BASE[:2:-1])))]
    files = cells.fanuc(cell, nearby(cell.robot, 3))
    _, _, result = compensate(tmp_path, cell.robot, files, *frames, "--points", "P[2],p[3]")
    assert result["correction"]["n"] == 2


def refused(tmp_path, capsys, files, *options, robot=None):
    cell = Cell(robot or identified())
    code, *_ = compensate(tmp_path, cell.robot, files, "--points", "calculated", *options)
    assert code == 2 and not (tmp_path / "out/result.json").exists()
    return capsys.readouterr().err


def changed(files, name, old, new, count=1):
    assert old in files[name]
    return files | {name: files[name].replace(old, new, count)}


@pytest.mark.slow
def test_what_cannot_be_corrected_is_refused_by_file_line_and_reason(tmp_path, capsys):
    cell = Cell(identified())
    files = cells.krl(cell, reachable(cell.robot, 3))
    say = lambda name, old, new: refused(tmp_path, capsys, changed(files, name, old, new), *FRAMES)
    assert "prog.dat, line 4: XP1: unknown tool 7" in say("prog.dat", b"TOOL_NO 1", b"TOOL_NO 7")
    assert "prog.src, line 1: $ABS_ACCUR" in say("prog.src", b"DEF prog()", b"$ABS_ACCUR=TRUE")
    assert "prog.src, line 4: LIN_REL" in say("prog.src", b"PTP XP2", b"LIN_REL {X 10}")
    assert "prog.src, line 4" in say("prog.src", b"XP2", b"XP9")
    assert "is given 2 times" in say("prog.dat", b"E6POS XP3", b"E6POS XP2")
    assert "line 4" in say("prog.dat", b"={X ", b"={X 9999")
    assert "Y is missing" in say("prog.dat", b",Y ", b",E2 ")
    assert "#TCP" in say("prog.dat", b"IPO_FRAME #BASE", b"IPO_FRAME #TCP")
    assert "external axis" in say("prog.dat", b"E1 0.0", b"E1 5.0")


def test_an_arm_whose_controller_corrects_already_is_refused(tmp_path, capsys):
    robot = identified(absolute_accuracy=True)
    assert "twice" in refused(tmp_path, capsys, cells.krl(Cell(robot), reachable(robot, 2)), *FRAMES,
                              robot=robot)


def test_limits_and_singular_poses_are_refused_or_kept(tmp_path, capsys):
    robot = identified()
    q = reachable(robot, 3)
    q[1, 4] = 0.0
    line = lambda row: ",".join(map(repr, row.tolist()))
    files = {"t.csv": ("q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad\n" + "\n".join(map(line, q))
                       + "\n").encode()}
    error = refused(tmp_path, capsys, files)
    assert "t.csv, line 3: row 2: close to a singular pose" in error
    code, _, result = compensate(tmp_path, robot, files, "--keep-refused")
    assert code == 0 and result["correction"]["n"] == 2 and len(result["refused"]) == 1
    tight = replace(robot, joints=(replace(robot.joints[0], q_max=float(q[0, 0]) - 1e-3), *robot.joints[1:]))
    assert "axis 1 would leave its limit" in refused(tmp_path, capsys, files, robot=tight)


def straight_programs(cell, q):
    """One long straight motion in the three dialects that take points in between."""
    ur, abb = cells.urscript(cell, q), cells.rapid(cell, q)
    ur["prog.script"] = ur["prog.script"].replace(b"movej(p[", b"movel(p[")
    lines = [line.replace(b"MoveJ [[", b"MoveL [[") for line in abb["prog.mod"].split(b"\n")]
    krl = cells.krl(cell, q, linear=True)
    frames = b"$TOOL=TOOL_DATA[1]\r\n  $BASE=BASE_DATA[2]\r\n  PTP XHOME"
    krl["prog.src"] = krl["prog.src"].replace(b"PTP XHOME", frames)
    return {"urscript": ur, "rapid": {"prog.mod": b"\n".join(lines)}, "krl": krl}


@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["urscript", "rapid", "krl"])
def test_points_in_between_keep_the_real_tip_on_its_line(tmp_path, dialect):
    rippled = identified(effects=False, chain="calibrated")
    robot = replace(rippled, joints=tuple(replace(joint, cw=None, ccw=None) for joint in rippled.joints))
    cell = Cell(robot, base=Placement()) if dialect == "urscript" else Cell(robot)
    start = nearby(robot, 1)
    q = np.vstack([start, start + 0.3])
    files, options = straight_programs(cell, q)[dialect], FRAMES if dialect == "krl" else []
    limit = lambda mm: ["--points", "calculated", "--tolerance-mm", mm, *options]
    *_, plain = compensate(tmp_path, robot, files, *limit("100"))
    code, written, result = compensate(tmp_path, robot, files, *limit("0.03"))
    (bend,) = result["programs"][0]["straight_motions"]
    assert (
        code == 0 and bend["off_line_m"] > 5e-5 and bend["points_in_between"] >= 1
        and bend["off_line_after_m"] < 3e-5
    )
    assert plain["programs"][0]["straight_motions"][0]["off_line_m"] == bend["off_line_m"]
    name = next(iter(files))
    marks = (b"r=0.001", b",z1,", b"C_DIS")
    more = [line for line in written[name].splitlines() if any(mark in line for mark in marks)]
    assert len(written[name].splitlines()) - len(files[name].splitlines()) == len(more) == bend[
        "points_in_between"
    ]
    # jumps of a flank and ripple of a gear within a few degrees are more than points in between can follow:
    # told
    *_, rough = compensate(tmp_path, rippled, files, *limit("0.03"))
    assert any("leave their line" in warning for warning in rough["warnings"])
    # the new program is one that can be read, and its points in between are what a compensation of them would
    # give
    _, again, _ = compensate(tmp_path, robot, written, "--points", "taught", *options)
    assert again == written


@pytest.mark.parametrize("what", ["fold", "trigger"])
def test_no_points_are_put_where_a_program_would_not_take_them(tmp_path, what):
    rippled = identified(effects=False)
    robot = replace(rippled, joints=tuple(replace(joint, cw=None, ccw=None) for joint in rippled.joints))
    cell, start = Cell(robot), nearby(robot, 1)
    files = straight_programs(cell, np.vstack([start, start + 0.3]))["krl"]
    old, new = {
        "fold": (b"  LIN XP2", b";FOLD LIN P2 %{PE}\r\n  LIN XP2"),
        "trigger": (b"  LIN XP2", b"  TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\r\n  LIN XP2"),
    }[what]
    files = changed(files, "prog.src", old, new)
    code, written, result = compensate(tmp_path, robot, files, "--points", "calculated", "--tolerance-mm",
                                       "0.03", *FRAMES)
    assert code == 0 and len(written["prog.src"].splitlines()) == len(files["prog.src"].splitlines())
    assert any("where no points in between can be put (KRL): XP2" in text for text in result["warnings"])
