"""The steps of the demo: which command runs on which shipped data, in which order.

`{example/...}` is a file that comes with the package, `{out/STEP/...}` a file that an earlier step wrote.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """One command of the demo: folder of its results, what it shows, its words. `real`: on measured data.
    `picture`: the figure of its report that tells most, for the page of the demo; "" where the step only
    prepares another. `headline`: what its error before and after is of, for the top of that page."""

    folder: str
    title: str
    words: tuple[str, ...]
    real: bool = True
    picture: str = ""
    headline: str = ""


STEPS = (
    Step("ur10_calibrate", "UR10 under a laser tracker: calibrate the arm",
         ("calibrate", "ur10", "{example/ur10/series_B.csv}", "{example/ur10/series_C.parquet}"),
         picture="error_histogram", headline="UR10, calibrated"),
    Step("ur10_transfer_train", "UR10: calibrate on series B alone",
         ("calibrate", "ur10", "{example/ur10/series_B.csv}")),
    Step("ur10_transfer_judge", "UR10: the arm from series B judged on series C",
         ("evaluate", "{out/ur10_transfer_train/robot.toml}", "{example/ur10/series_C.parquet}"),
         picture="error_histogram"),
    Step("ur10_diagnose", "UR10: what is the rest of the error of series B?",
         ("diagnose", "ur10", "{example/ur10/series_B.csv}"), picture="effects",
         headline="UR10, causes found"),
    Step("kr300_gear", "KR300, encoders on both sides of the gears: ratios and what they leave",
         ("gear", "kr300", "{example/kr300/run_A.parquet}", "{example/kr300/run_B.parquet}")),
    Step("kr300_diagnose", "KR300: what lies between the two encoders of its axes?",
         ("diagnose", "kr300", "{example/kr300/run_A.parquet}", "{example/kr300/run_B.parquet}", "--kind",
          "gear_run"), picture="effects", headline="KR300, gears"),
    Step("panda_touched", "Panda, a ball in two seats: calibrated without a tracker",
         ("calibrate", "panda", "{example/ball_in_socket/panda_6.csv}", "--fixture",
          "{example/ball_in_socket/fixture.toml}"), picture="error_histogram",
         headline="Panda, without a tracker"),
    Step("tx40_identify", "TX40: inertias and friction from one motion",
         ("identify", "tx40", "{example/tx40/motion.parquet}"), picture="torque", headline="TX40, torques"),
    Step("racer_identifiable", "Racer 7-1.4: what poses can identify at all",
         ("identifiable", "racer-7-1.4"), real=False),
    Step("racer_design", "Racer 7-1.4: which poses to measure",
         ("design", "racer-7-1.4", "--count", "50", "--validation", "13"), real=False, picture="poses"),
    Step("racer_gear_runs", "Racer 7-1.4: a virtual robot turns its gears under a gyroscope",
         ("simulate", "racer-7-1.4", "--measure", "gear"), real=False),
    Step("racer_gear", "Racer 7-1.4: harmonics of the gears from these runs",
         ("gear", "racer-7-1.4", "{out/racer_gear_runs/gear_runs.parquet}"), real=False,
         picture="gear_2_cw_spectrum"),
    Step("racer_plan", "Racer 7-1.4: motor trajectory for a straight line",
         ("plan", "racer-7-1.4", "line"), real=False, picture="motor_rate"),
    Step("racer_play", "Racer 7-1.4: the virtual robot follows that trajectory",
         ("simulate", "racer-7-1.4", "{out/racer_plan/trajectory.csv}", "--frames", "declared"), real=False),
    Step("racer_worth", "Racer 7-1.4: rigid planning and exactarm's, played on a robot that deviates from "
                        "its drawing",
         ("simulate", "racer-7-1.4", "--compare", "line", "--rate", "500"), real=False, picture="compare",
         headline="simulated Racer, planned"),
    Step("racer_loop", "Racer 7-1.4 with a hidden backlash: the full loop, to the plan that knows of it",
         ("loop", "racer-7-1.4", "--effect", "backlash joint=2 width_rad=4e-4"), real=False,
         picture="tracking", headline="simulated Racer, backlash"))
