"""A short use of every part of an installed wheel that links a library or has builds for several processors.

Run by wheel.sh in a clean environment. The builds must agree: kinematics, dynamics and gears to 1e-12 of the
largest value, plans to 1e-9 rad, which is what the C++ tests ask of the two solvers.
"""

import os
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np

BUILDS = ("x86-64", "x86-64-v3", "x86-64-v4")
AGREEMENT = {"plan": 1e-9}
OTHER_AGREEMENT = 1e-12

PROGRAM = """
import sys
import numpy as np
from exactarm import _core
rng = np.random.default_rng(1)
link = _core.LinkInertia(1.0, np.full(3, 0.05), 0.1 * np.eye(3))
frames = [_core.Frame(a=0.3 * (i % 2), d=0.1, alpha=1.57 * (i % 3), beta=0.01 * i) for i in range(6)]
robot = _core.Robot([_core.Joint(frame, spring=_core.Spring(1e4), link=link) for frame in frames])
q, q_dot, q_ddot, multiplier = rng.normal(size=(4, 501, 6))
found = dict(zip(("position", "rotation", "columns"), _core.identification_jacobian(robot, q)))
found |= _core.inverse_dynamics_derivatives(robot, q, q_dot, q_ddot, multiplier)
found["batch"] = _core.inverse_dynamics(robot, q, q_dot, q_ddot, threads=2)
found["gravity"] = _core.gravity_torque_jacobian(robot, q)
found["regressor"] = _core.dynamics_regressor(robot, q, q_dot, q_ddot)
table = _core.GearTable([30.0, 85.0], [1e-3, 2e-3], [2e-3, -1e-3])
found["phi"], found["ratio"] = _core.gear_outputs(80.0, table, 80.0 * q.ravel())
problem = _core.PlanProblem(robot)
time = np.linspace(0.0, 1.0, 400)[:, None]
rise = time**4 * (35 - 84 * time + 70 * time**2 - 20 * time**3)
problem.q_desired, problem.step = 0.1 * rise * np.ones(6), 0.0025
for method in (_core.PlanMethod.stagewise, _core.PlanMethod.ipopt):
    options = _core.PlanOptions()
    options.method, options.threads = method, 2
    motion = _core.plan_motion(robot, problem, options)
    assert motion.status == "solved", (method, motion.status, motion.message)
    found["plan"] = motion.q
own = {line.split()[-1] for line in open("/proc/self/maps") if "ipopt" in line or "mumps" in line}
assert own and all("exactarm.libs" in name for name in own), own
np.savez(sys.argv[1], **found)
build = {line.split()[-1].rsplit("/", 1)[1] for line in open("/proc/self/maps") if "/_core.x86" in line}
print(*build)
"""


def run(command: list[str], **environment: str) -> str:
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)[:100]} {environment}: exit {done.returncode}\n{done.stderr}")
    return done.stdout.strip()


def runs_here(build: str) -> bool:
    command = [sys.executable, "-c", "import exactarm._core"]
    words = subprocess.run(command, env={**os.environ, "EXACTARM_CPU": build}, capture_output=True,
                           text=True).stderr
    return "this processor cannot run it" not in words


def largest_difference(ours: dict[str, np.ndarray], others: dict[str, np.ndarray], build: str) -> float:
    worst = 0.0
    for name, values in ours.items():
        difference = np.abs(values - others[name]).max() / max(np.abs(values).max(), 1.0)
        if difference > AGREEMENT.get(name, OTHER_AGREEMENT):
            sys.exit(f"{build}: {name} differs by {difference:.1e} of its largest value from that of "
                     f"{BUILDS[0]}")
        worst = max(worst, difference)
    return worst


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        first = None
        for build in (*BUILDS, ""):
            if not runs_here(build):
                print(f"   {build}: not on this processor")
                continue
            file = str(Path(folder) / "found.npz")
            used = run([sys.executable, "-c", PROGRAM, file], EXACTARM_CPU=build)
            if used and build not in used:
                sys.exit(f"EXACTARM_CPU={build} has loaded {used}")
            found = dict(np.load(file))
            first = first or found
            print(f"   {build or 'chosen'}: {used}, largest difference "
                  f"{largest_difference(first, found, build):.1e}")
        command = str(Path(sys.executable).with_name("exactarm"))
        assert run([command, "--version"]) == f"exactarm {version('exactarm')}"
        run([command, "plan", "racer-7-1.4", "line", "--out", folder, "--quiet"])
        print("   exactarm plan: done")


if __name__ == "__main__":
    main()
