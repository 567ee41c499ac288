"""All six dialects to the end: a program is compensated, its commands are driven on a virtual robot by
`simulate`, and the tip is measured where the uncompensated program said, within a micrometre."""

from dataclasses import replace

import numpy as np
import pytest

import compensation_cell as cells
import exactarm as ea
from compensation_cell import BASE, LOAD, TOOL, Cell, identified, nearby, reachable
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.effects.payload import Payload
from exactarm.robot.robot import Placement
from test_compensate import FRAMES, compensate, wpr

MICROMETRE = 1e-6
TURNED = (wpr(TOOL), wpr(BASE))


def measured_tips(folder, cell, q, approach, load=None):
    """(N, 3) what `simulate` measures without noise at the commands, in the base of the program, m."""
    robot = replace(cell.robot, base=Placement(), tool=cell.tool)
    if load is not None:
        payload = Payload(None, (load[0], *(load[0] * np.array(load[1]))))
        robot = replace(robot, effects=(*robot.effects, payload))
    path = folder / "commands.csv"
    write_dataset(path, Dataset.of_arrays("poses", {"q": q, "approach": approach}), robot)
    result = ea.simulate(robot, path, noise=0.0, counts=None, frames="declared", threads=1)
    assert result.data.position.shape == (len(q), 3)
    return (result.data.position - cell.base.position) @ cell.base.rotation


def krl():
    cell = Cell(identified())
    q = reachable(cell.robot, 8)
    return cell, cells.krl(cell, q), cells.read_krl, q, cell.approach(q), FRAMES, None


def rapid():
    cell = Cell(identified())
    q = reachable(cell.robot, 8)
    approach = cell.approach(np.vstack([q[:1], q]))[1:]
    return cell, cells.rapid(cell, q), cells.read_rapid, q, approach, [], LOAD


def fanuc():
    cell = Cell(identified(coupling=((3, 2, 1.0),)))
    q = nearby(cell.robot, 8)
    options = ["--tool", f"4={TURNED[0]}", "--base", f"3={TURNED[1]}"]
    return cell, cells.fanuc(cell, q), cells.read_fanuc, q[1:], cell.approach(q)[1:], options, None


def inform():
    cell = Cell(identified(pulses_per_rad=cells.PULSES))
    q = nearby(cell.robot, 8)
    options = ["--tool", f"5={TURNED[0]}", "--base", f"2={TURNED[1]}"]
    return cell, cells.inform(cell, q), cells.read_inform, q[1:], cell.approach(q)[1:], options, None


def urscript():
    cell = Cell(identified(chain="calibrated"), base=Placement())
    q = nearby(cell.robot, 8)
    files = {name: text.replace(b"movel(p[", b"movej(p[") for name, text in cells.urscript(cell, q).items()}
    return cell, files, cells.read_urscript, q[1:], cell.approach(q)[1:], [], LOAD


@pytest.mark.slow
@pytest.mark.parametrize("dialect", [krl, rapid, fanuc, inform, urscript])
def test_a_compensated_program_brings_the_virtual_arm_to_its_targets(tmp_path, dialect):
    cell, files, read, near, approach, options, load = dialect()
    code, written, _ = compensate(tmp_path, cell.robot, files, "--points", "calculated", *options)
    assert code == 0
    wanted = np.array([tip.position for tip in read(files)])
    driven = {name: cell.joints(read(text), near) for name, text in (("as it was", files), ("new", written))}
    missed = {name: np.linalg.norm(measured_tips(tmp_path, cell, q, approach, load) - wanted, axis=1).max()
              for name, q in driven.items()}
    assert missed["new"] < MICROMETRE and missed["as it was"] > 1e-3, missed


def test_a_compensated_trajectory_brings_the_virtual_arm_to_its_targets(tmp_path):
    cell = Cell(identified(), Placement(), Placement())
    q = reachable(cell.robot, 1) + np.linspace(0.0, 0.3, 12)[:, None]
    files = cells.trajectory(q)
    code, written, _ = compensate(tmp_path, cell.robot, files)
    wanted, approach = np.array([tip.position for tip in cell.tip(q)]), np.ones_like(q) * np.sign(
        cell.robot.ratios)
    missed = {
        name: np.linalg.norm(
            measured_tips(tmp_path, cell, cells.read_trajectory(text), approach) - wanted, axis=1).max()
        for name, text in (("as it was", files), ("new", written))
    }
    assert code == 0 and missed["new"] < MICROMETRE and missed["as it was"] > 1e-3, missed
