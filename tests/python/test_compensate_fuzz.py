"""Mutated programs: refused by file and line, or corrected rightly; never anything else."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import compensation_cell as cells
from compensation_cell import BASE, PULSES, TOOL, Cell, identified, nearby
from exactarm.compensate.correction import Correction, correct
from exactarm.compensate.flange_poses import flange_poses
from exactarm.compensate.formats import Job, dialect_of
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Program, SourceText
from exactarm.compensate.setting import Setting, chosen_points
from exactarm.errors import InputError
from exactarm.robot.robot import Placement

MAKERS = {
    "krl": cells.krl, "rapid": cells.rapid, "fanuc": cells.fanuc, "urscript": cells.urscript,
    "inform": cells.inform,
    "trajectory": lambda cell, q: cells.trajectory(q),
}
NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
FAR_M = 1e-5  # of pulses: a unit in the last place turns an axis by up to 1e-7 rad; of poses: of 3 decimals
MICROMETRE = 1e-6


@cache
def cell_of(dialect: str) -> Cell:
    coupling = ((3, 2, 1.0),) if dialect == "fanuc" else None
    robot = identified(coupling=coupling, pulses_per_rad=PULSES,
                       chain="calibrated" if dialect == "urscript" else "nominal")
    return Cell(robot, base=Placement()) if dialect == "urscript" else Cell(robot)


@cache
def program_of(dialect: str) -> dict[str, bytes]:
    cell = cell_of(dialect)
    return MAKERS[dialect](cell, nearby(cell.robot, 4))


def setting_of(dialect: str) -> Setting:
    turned = lambda frame: (*frame[:3], frame[5], frame[4], frame[3])
    shown = (lambda frame: frame) if dialect == "krl" else turned
    tools, bases = {"1": shown(TOOL), "4": shown(TOOL),
                    "5": shown(TOOL)}, {"2": shown(BASE), "3": shown(BASE)}
    return Setting(cell_of(dialect).robot, {} if dialect in ("rapid", "urscript") else tools,
                   bases if tools else {})


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """One to three small damages, as an editor, a line of a network or a careless hand makes them."""
    for _ in range(random.integers(1, 4)):
        if not re.search(NUMBER, content):
            return content
        place, lines = int(random.integers(len(content))), content.splitlines(keepends=True)
        line = int(random.integers(len(lines)))
        kind = random.integers(8)
        if kind == 0:
            content = content[:place] + content[place + 1 :]
        elif kind == 1:
            content = content[:place] + bytes([random.integers(32, 127)]) + content[place:]
        elif kind == 2:
            content = content[:place] + bytes([random.integers(32, 127)]) + content[place + 1 :]
        elif kind == 3:
            content = b"".join([*lines[:line], *lines[line + 1 :]])
        elif kind == 4:
            content = b"".join([*lines[: line + 1], *lines[line:]])
        elif kind == 5:
            other = int(random.integers(len(lines)))
            lines[line], lines[other] = lines[other], lines[line]
            content = b"".join(lines)
        elif kind == 6:
            content = content[: max(place, 1)]
        else:
            found = list(re.finditer(NUMBER, content))
            match = found[int(random.integers(len(found)))]
            new = str(random.choice(["0", "1e9", "-1", "nan", "1.5", "", "9E9", "007", "1e400",
                                     "--3"])).encode()
            content = content[: match.start()] + new + content[match.end() :]
    return content


def far_from_commands(model: CompensationModel, again: Program, result: Correction) -> float:
    """m of the flange between the commands and the targets of the new program, read as anyone would."""
    assert [target.name for target in again.targets] == [target.name for target in result.program.targets]
    rows = np.flatnonzero(~np.isnan(result.q_after).any(axis=1))
    wanted = model.controller.poses(result.q_after[rows])
    far = []
    for target, position in zip([again.targets[row] for row in rows], wanted.position):
        numbers = np.array([target.numbers])
        flange = (flange_poses(again.notation.poses(numbers), [target.base], [target.tool]) if target.is_pose
                  else model.controller.poses(again.notation.joints(numbers)))
        far.append(np.linalg.norm(flange.position[0] - position))
    return max(far)


def one(dialect: str, random: np.random.Generator) -> str:
    """What became of a mutated program: "refused" or "right"."""
    files = dict(program_of(dialect))
    name = str(random.choice(sorted(files)))
    files[name] = mutated(files[name], random)
    paths = sorted(map(Path, files), key=lambda path: path.suffix != ".src")
    setting = setting_of(dialect)
    job = Job(dialect_of(paths[0]), tuple(paths))
    sources = tuple(SourceText(path, files[str(path)]) for path in paths)
    model = CompensationModel.of(setting.robot)
    try:
        program = job.dialect.read(sources, setting)
        chosen = chosen_points(program, "calculated")
        result = correct(program, model, chosen, setting.start, 1,
                         lambda contents: job.reread(contents, setting))
    except InputError as error:
        assert re.search(r"line \d+|point \d+", str(error)) or re.search(r"prog\.\w+: ", str(error)), error
        return "refused"
    for source, content in zip(sources, result.contents):
        assert re.sub(NUMBER, b"#", content) == re.sub(NUMBER, b"#", source.content)
    for error in result.refused:
        assert re.search(r"line \d+", str(error)), error
    corrected = ~np.isnan(result.q_after).any(axis=1)
    assert corrected.sum() + len(result.refused) + sum(map(bool, result.why)) >= len(program.targets)
    if corrected.any():
        assert np.nanmax(result.reached) < MICROMETRE
        assert far_from_commands(model, job.reread(result.contents, setting), result) < FAR_M
    return "refused" if result.refused else "right"


@pytest.mark.slow
@pytest.mark.parametrize("dialect", MAKERS)
def test_mutated_programs_are_refused_by_line_or_corrected(dialect, count=50, seed=11):
    random = np.random.default_rng(seed)
    ends = [one(dialect, random) for _ in range(count)]
    assert {"refused", "right"} == set(ends), ends  # both happen, or the mutations tell nothing


@pytest.mark.slow
@pytest.mark.parametrize("dialect", MAKERS)
def test_ten_thousand_mutated_programs(dialect):
    test_mutated_programs_are_refused_by_line_or_corrected(dialect, count=10_000 // len(MAKERS) + 1, seed=12)
