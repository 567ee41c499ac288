"""Times the law of compensation: targets a second and core, by what the robot file holds.

    python bench/compensate_time.py [--count 20000] [--repeats 3] [--out FILE.json]

Random joint targets of the virtual Racer with a random approach; one thread, seconds of the processor
(median). Programs are read and written besides: `--program` times as many targets from file to file, as
tables and as programs of each controller (joint angles, or poses along a path): median of `--repeats`,
behind a first one of 100 targets, in which what is read but once (libraries) is not counted.
"""

from __future__ import annotations

import argparse
import io
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pyarrow
import pyarrow.parquet
from scipy.spatial.transform import Rotation

from exactarm.compensate.angles import to_zyx
from exactarm.compensate.collector import collector_at_rest
from exactarm.compensate.correction import correct
from exactarm.compensate.formats import jobs
from exactarm.compensate.law import NEAR_SINGULAR, CompensationModel
from exactarm.compensate.setting import Setting, chosen_points
from exactarm.effects.backlash import Backlash
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot


def arms() -> dict[str, Robot]:
    """The Racer with deviations of a new arm in its frames: bare, with its gear tables and springs, with two
    effects more."""
    nominal, random = load_robot("racer-7-1.4").with_controller_frames, np.random.default_rng(1)
    joints = tuple(
        replace(joint, a=joint.a + 5e-4 * random.normal(), alpha=joint.alpha + 1e-3 * random.normal(),
                q_offset=joint.q_offset + 1e-3 * random.normal(), controller_offset=float(offset))
        for joint, offset in zip(nominal.joints, nominal.controller_offsets)
    )
    full = replace(nominal, joints=joints)
    bare = replace(full, links=None,
                   joints=tuple(replace(j, cw=None, ccw=None, spring_linear=None) for j in joints))
    effects = (JointCompliance(2, (4e-7, 0.0)), Backlash(3, (3e-4, 20.0)))
    return {"geometry": bare, "gears and springs": full, "and two effects": replace(full, effects=effects)}


def targets(robot: Robot, count: int) -> np.ndarray:
    low, high = CompensationModel.of(robot).controller.limits
    return low + (high - low) * np.random.default_rng(2).uniform(0.1, 0.9, (count, robot.axes))


def law(robot: Robot, count: int, repeats: int) -> dict:
    model, q = CompensationModel.of(robot), targets(robot, count)
    approach = np.random.default_rng(3).choice([-1.0, 1.0], q.shape)
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        found = model.commands(model.controller.poses(q), q, approach)
        seconds.append(time.process_time() - start)
    good = found.amplification < NEAR_SINGULAR
    return {"targets_per_s": count / median(seconds),
            "left_over_99": float(np.quantile(found.left_over[good], 0.99)),
            "near_singular": float(1.0 - good.mean())}


def path(robot: Robot, count: int) -> np.ndarray:
    """Joint angles along a path: poses of a program lie close to each other."""
    low, high = CompensationModel.of(robot).controller.limits
    turn = np.linspace(0.0, 1e-3 * count, count)[:, None] * np.array([1.0, 1.3, 0.7, 1.9, 1.1, 0.5])
    return 0.5 * (low + high) + 0.2 * (high - low) * np.sin(turn[:, : robot.axes] + np.arange(robot.axes))


def table_of(robot: Robot, q: np.ndarray) -> str:
    header = ",".join(f"q_{i + 1}_rad" for i in range(robot.axes))
    return header + "\n" + "\n".join(",".join(map(repr, row.tolist())) for row in q) + "\n"


def krl_of(robot: Robot, q: np.ndarray, poses: bool) -> str:
    """PTP to joint angles; with `poses` LIN to all but the first."""
    axes = ["PTP {" + ",".join(f"A{i + 1} {angle:.6f}" for i, angle in enumerate(row)) + "}"
            for row in np.degrees(q)]
    if poses:
        at = CompensationModel.of(robot).controller.poses(q)
        numbers = [np.append(1e3 * p, np.degrees(to_zyx(r, np.zeros(3))))
                   for p, r in zip(at.position, at.rotation)]
        axes[1:] = ["LIN {" + ",".join(f"{key} {value:.6f}" for key, value in zip("XYZABC", row)) + "}"
                    for row in numbers[1:]]
    return "\n".join(["DEF bench()", "$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", *axes, "END", ""])


def rapid_of(robot: Robot, q: np.ndarray) -> str:
    """MoveL to robtargets, half of them data and half in brackets."""
    data, moves = [], []
    for i, (row, p, r) in enumerate(_poses(robot, q)):
        wxyz = np.roll(Rotation.from_matrix(r).as_quat(), 1)
        numbers = lambda values: ",".join(f"{value:.6f}" for value in values)
        word = ",".join(str(int(np.floor(row[k] / (np.pi / 2)))) for k in (0, 3, 5))
        text = f"[[{numbers(1e3 * p)}],[{numbers(wxyz)}],[{word},0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        if i % 2:
            data.append(f"CONST robtarget p{i}:={text};")
        moves.append(f"MoveL {f'p{i}' if i % 2 else text},v100,fine,tool0;")
    return "\n".join(["MODULE m", *data, "PROC main()", *moves, "ENDPROC", "ENDMODULE", ""])


def fanuc_of(robot: Robot, q: np.ndarray) -> str:
    moves, places = [], []
    for i, (_, p, r) in enumerate(_poses(robot, q), start=1):
        c, b, a = np.degrees(to_zyx(r, np.zeros(3)))
        x, y, z = 1e3 * p
        moves.append(f"{i:4d}:L P[{i}] 100mm/sec FINE    ;")
        places.append(f"P[{i}]{{\n   GP1:\n\tUF : 0, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
                      f"\tX = {x:.6f} mm,\t"
                      f"Y = {y:.6f} mm,\tZ = {z:.6f} mm,\n\tW = {a:.6f} deg,\tP = {b:.6f} deg,"
                      f"\tR = {c:.6f} deg\n}};")
    return "\n".join(["/PROG  M", "/MN", *moves, "/POS", *places, "/END", ""])


def urscript_of(robot: Robot, q: np.ndarray) -> str:
    lines = ["def prog():", "  set_tcp(p[0,0,0,0,0,0])"]
    for _, p, r in _poses(robot, q):
        pose = [*p, *Rotation.from_matrix(r).as_rotvec()]
        lines.append("  movel(p[" + ", ".join(f"{value:.9f}" for value in pose) + "], a=1.2, v=0.25)")
    return "\n".join([*lines, "end", ""])


def inform_of(robot: Robot, q: np.ndarray) -> str:
    places, moves = [], []
    for i, row in enumerate(q):
        places.append(f"C{i:05d}=" + ",".join(str(round(angle * 1e5)) for angle in row))
        moves.append(f"MOVJ C{i:05d} VJ=50.00")
    return "\n".join(["/JOB", "//NAME M", "//POS", "///TOOL 0", "///POSTYPE PULSE", "///PULSE", *places,
                      "//INST",
                      "NOP", *moves, "END", ""])


def trajectory_of(q: np.ndarray) -> str:
    names = ", ".join(f"joint_{i + 1}" for i in range(q.shape[1]))
    points = [f"- positions: [{', '.join(map(repr, row))}]\n"
              f"  time_from_start: {{sec: {i // 10}, nanosec: {100_000_000 * (i % 10)}}}"
              for i, row in enumerate(q.tolist(), start=1)]
    return "\n".join([f"joint_names: [{names}]", "points:", *points, ""])


def parquet_of(robot: Robot, q: np.ndarray) -> bytes:
    written = io.BytesIO()
    columns = {f"q_{i + 1}_rad": q[:, i] for i in range(robot.axes)}
    pyarrow.parquet.write_table(pyarrow.table(columns), written)
    return written.getvalue()


def _poses(robot: Robot, q: np.ndarray):
    at = CompensationModel.of(robot).controller.poses(q)
    return zip(q, at.position, np.reshape(at.rotation, (-1, 3, 3)))


@collector_at_rest()
def program(robot: Robot, name: str, text: str | bytes, q: np.ndarray) -> float:
    """Targets a second from file to file, with the check of what was written; q (T, n): their angles."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_bytes(text.encode() if isinstance(text, str) else text)
        (job,), setting = jobs([file]), Setting(robot, start=q[0])
        start = time.process_time()
        read = job.read(setting)
        found = correct(read, CompensationModel.of(robot), chosen_points(read, "calculated"), q[0], 1,
                        lambda new: job.reread(new, setting))
        seconds = time.process_time() - start
    if len(found.refused) > 0.1 * len(q):  # some are close to a singular pose
        raise SystemExit(f"{name}: {len(found.refused)} targets refused: {found.refused[0]}")
    return len(q) / seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--program", action="store_true")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    rows = {name: law(robot, arguments.count, arguments.repeats) for name, robot in arms().items()}
    for name, row in rows.items():
        print(f"{name:18}  {row['targets_per_s']:8.0f} targets a second and core; error left (99 %) "
              f"{row['left_over_99']:.1e} m, "
              f"{100 * row['near_singular']:.1f} % close to singular")
    if arguments.program:
        robot, count = arms()["gears and springs"], arguments.count
        random, along = targets(robot, count), path(robot, count)
        writers = {
            "table, CSV": ("table.csv", lambda q: table_of(robot, q), random),
            "table, Parquet": ("table.parquet", lambda q: parquet_of(robot, q), random),
            "JointTrajectory": ("points.yaml", trajectory_of, along),
            "KRL, joint angles": ("axes.src", lambda q: krl_of(robot, q, poses=False), random),
            "KRL, poses": ("poses.src", lambda q: krl_of(robot, q, poses=True), along),
            "RAPID, poses": ("poses.mod", lambda q: rapid_of(robot, q), along),
            "Fanuc TP, poses": ("poses.ls", lambda q: fanuc_of(robot, q), along),
            "URScript, poses": ("poses.script", lambda q: urscript_of(robot, q), along),
            "INFORM, pulses": ("pulses.jbi", lambda q: inform_of(robot, q), along)}
        pulses = (1e5,) * robot.axes
        known = replace(robot, controller=replace(robot.controller, chain="calibrated", coupling=(),
                                                  pulses_per_rad=pulses))
        rows["program"] = {}
        for kind, (name, write, q) in writers.items():
            program(known, name, write(q[:100]), q[:100])
            text = write(q)
            rows["program"][kind] = median(program(known, name, text, q) for _ in range(arguments.repeats))
        for kind, speed in rows["program"].items():
            print(f"{kind:18}  {speed:8.0f} targets a second and core, from file to file")
    if arguments.out:
        arguments.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
