"""Time and memory of a plan by its number of knots: the source's line, at its own length and slower.

    python bench/planning_growth.py [growth.json] [--seconds 25]

Medians of the stage-wise solver's wall clock and processor time; the largest memory of a process that plans
once, in bytes (each in a process of its own).
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from dataclasses import replace

RUNS = 5


def measure(duration):
    from exactarm import _core
    from exactarm.plan import PlanOptions, load_path, plan_path
    from exactarm.plan.compensation import planning_model
    from exactarm.plan.optimal import _joint_reference, _problem, _solve_options
    from exactarm.robot_file import load_robot

    robot, path = load_robot("racer-7-1.4"), load_path("line")
    path = replace(path, duration=duration)
    plan = plan_path(robot, path, PlanOptions(threads=2))
    memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    model, reference, options = planning_model(robot), path.reference(), PlanOptions(threads=2)
    joints, known, _ = _joint_reference(model, reference, path, options)
    problem, chosen = _problem(model, path, reference.step, joints, known,
                               options), _solve_options(path, options)
    rows = []
    for _ in range(RUNS):
        wall, processor = time.perf_counter(), time.process_time()
        motion = _core.plan_motion(model.core, problem, chosen)
        rows.append((time.process_time() - processor, time.perf_counter() - wall))
    processor, wall = sorted(rows)[RUNS // 2]
    return {"knots": len(plan.time), "seconds": wall, "processor_seconds": processor,
            "iterations": motion.iterations,
            "status": motion.status, "position_rms_m": plan.tracking.position_rms,
            "peak_memory_bytes": memory}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", nargs="?", default="planning_growth.json")
    parser.add_argument("--seconds", type=float, default=25.0)
    parser.add_argument("--measure", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure is not None:
        result = measure(arguments.measure)
    else:
        rows = [json.loads(subprocess.run([sys.executable, __file__, "-", "--measure", str(duration)],
                                          check=True,
                                          capture_output=True, text=True).stdout)
                for duration in (2.5, arguments.seconds)]
        short, long = rows
        result = {"rows": rows, "ratio": long["seconds"] / short["seconds"],
                  "processor_ratio": long["processor_seconds"] / short["processor_seconds"]}
        for row in rows:
            print(f"{row['knots']:6d} knots  {row['iterations']} iterations  {row['seconds']:.3f} s  "
                  f"{row['processor_seconds']:.3f} s of the processor  "
                  f"{row['peak_memory_bytes'] / 2**20:.0f} MiB  "
                  f"{1e9 * row['position_rms_m']:.2f} nm  {row['status']}")
        print(f"ratio {result['ratio']:.1f}, of processor time {result['processor_ratio']:.1f}")
    if arguments.out == "-":
        print(json.dumps(result))
        return
    with open(arguments.out, "w", encoding="utf-8") as file:
        json.dump(result, file, indent=1)


if __name__ == "__main__":
    main()
