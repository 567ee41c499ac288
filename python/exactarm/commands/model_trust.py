"""How far the identified model itself is to be trusted at the joint angles of a plan or a program."""

import numpy as np

from exactarm.report import Highlight, Quantity, Text
from exactarm.report.numbers import quantity

HEADING = "How far the model is to be trusted"
UNKNOWN = ("Not known: the robot file carries no covariance of its parameters; `calibrate` and `diagnose` "
           "write it. The errors on this page are those of the model alone.")
_MOST_SAMPLES = 200  # of a trajectory: neighbours differ by less than a figure shows


def thinned(q: np.ndarray) -> np.ndarray:
    """At most 200 rows of joint angles (N, n), evenly."""
    return q[np.unique(np.linspace(0, len(q) - 1, min(len(q), _MOST_SAMPLES)).astype(int))]


def trust_json(radius: np.ndarray | None) -> dict[str, float] | None:
    """`model_uncertainty` of result.json."""
    if radius is None or not np.isfinite(radius).any():
        return None
    return {"radius95_median_m": float(np.nanmedian(radius)), "radius95_max_m": float(np.nanmax(radius))}


def trust_highlights(radius: np.ndarray | None) -> tuple[Highlight, ...]:
    """Beside the errors on the model, that of the real arm, where the robot file tells it."""
    found = trust_json(radius)
    return () if found is None else (
        Highlight("real arm, 95 % within", Quantity(found["radius95_median_m"], "m")),)


def trust_text(radius: np.ndarray | None, where: str) -> Text:
    """The section of a page; where: "along the path", "at the targets"."""
    found = trust_json(radius)
    if found is None:
        return Text(HEADING, (UNKNOWN,))
    median, worst = (quantity(found[f"radius95_{name}_m"], "m") for name in ("median", "max"))
    return Text(HEADING, (
        f"By the covariance in the robot file, 95 % of the real arm's errors {where} stay within {median} "
        f"(median), {worst} at the worst: estimates, curves of gears where they were not measured, and what "
        "the identification left. They are errors of the target that was measured, in the frame of the "
        "measuring device.",
        "`exactarm evaluate robot.toml NEW.csv --at POSES` scales this by poses that were measured."))
