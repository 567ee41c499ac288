"""One build for any x86-64 beside one for this machine (-march=native): processor time by operation.

    python bench/portable_build.py NATIVE PORTABLE [--rounds 41] [--out FILE.json]

NATIVE, PORTABLE: folders with the extension (`_core*.so`) of a build with EXACTARM_CPU=native and of one with
EXACTARM_CPU=dispatch, as wheels have it. Each runs in a process of its own; rounds alternate between the two,
so that what else the machine does falls on both. Printed: the least processor time of each, and the median
over the rounds of portable / native.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

LEAST_S = 0.05  # that an operation runs in a round: the grain of the clock is far below a per cent of it


def use(folder: Path) -> None:
    """Makes the extension in `folder` that of exactarm."""
    import exactarm

    file = next(folder.glob("_core.cpython*.so"))
    spec = importlib.util.spec_from_file_location("exactarm._core", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["exactarm._core"] = module
    spec.loader.exec_module(module)
    exactarm._core = module  # type: ignore[attr-defined]


def operations() -> dict:
    import numpy as np

    from exactarm import _core
    from exactarm.plan import PlanOptions, load_path
    from exactarm.plan.compensation import planning_model
    from exactarm.plan.optimal import _joint_reference, _problem, _solve_options
    from exactarm.robot_file import load_robot

    robot, path, options = load_robot("racer-7-1.4"), load_path("line"), PlanOptions(threads=1)
    model, reference, core = planning_model(robot), path.reference(), robot.core
    joints, known, _ = _joint_reference(model, reference, path, options)
    problem = _problem(model, path, reference.step, joints, known, options)
    chosen = _solve_options(path, options)
    rng = np.random.default_rng(1)
    q, q_dot, q_ddot = rng.normal(size=(3, 2000, robot.axes))
    return {
        "forward kinematics": lambda: _core.forward_kinematics(core, q, 1),
        "identification Jacobian": lambda: _core.identification_jacobian(core, q, threads=1),
        "gravity torque and its Jacobian": lambda: (_core.gravity_torque(core, q, 1),
                                                    _core.gravity_torque_jacobian(core, q, 1)),
        "inverse dynamics": lambda: _core.inverse_dynamics(core, q, q_dot, q_ddot),
        "dynamics regressor": lambda: _core.dynamics_regressor(core, q, q_dot, q_ddot, 1),
        f"plan of {len(reference.time)} knots": lambda: _core.plan_motion(model.core, problem, chosen),
    }


def serve(folder: Path) -> None:
    """Answers each line, the name of an operation, with its processor time in s."""
    use(folder)
    known = operations()
    for work in known.values():
        work()
    print(json.dumps(list(known)), flush=True)
    for line in sys.stdin:
        work, start, count = known[line.strip()], time.process_time(), 0
        while time.process_time() - start < LEAST_S:
            work()
            count += 1
        print((time.process_time() - start) / count, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=41)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if len(arguments.folders) == 1:
        serve(arguments.folders[0])
        return
    servers = [subprocess.Popen([sys.executable, __file__, str(folder)], stdin=subprocess.PIPE,
                                stdout=subprocess.PIPE, text=True) for folder in arguments.folders]
    names = [json.loads(server.stdout.readline()) for server in servers][0]
    rows = {}
    for name in names:
        seconds = []
        for _ in range(arguments.rounds):
            for server in servers:
                server.stdin.write(name + "\n")
                server.stdin.flush()
                seconds.append(float(server.stdout.readline()))
        native, portable = seconds[::2], seconds[1::2]
        rows[name] = {"native_s": min(native), "portable_s": min(portable),
                      "ratio": median(b / a for a, b in zip(native, portable))}
        print(f"{name:34s} {1e3 * min(native):8.3f} ms {1e3 * min(portable):8.3f} ms  "
              f"{rows[name]['ratio']:.3f}")
    for server in servers:
        server.stdin.close()
        server.wait()
    if arguments.out:
        arguments.out.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
