"""The steps of each long command in their order, and the share of its time that each takes.

Shares are processor time, rounded, as `python bench/step_times.py` measured them on shipped data and on days
and targets that it makes; where kinds of data differ, in between. Another arm or file has others, which is
why time left is told as "about". A command may leave steps out.
"""

from collections.abc import Sequence

from exactarm.design import design
from exactarm.diagnose import diagnosis
from exactarm.identify import calibrate, dynamics, gear

READING, CHECKING = "reading the data", "looking for mistakes in the data"
JUDGING, AT_POSES = "fitting the set-up and judging", "uncertainty at the poses asked for"
PLANNING, TRUSTED = "inverse kinematics and optimal control", "uncertainty of the model along the path"
CAUSES = "causes that these poses could tell"
MEASURING, CALIBRATING = "measuring poses", "calibrating"
EXECUTING = "planning and executing"
CASES = "planning and playing"
FRAMES, CORRECTING = "frames of the cell", "correcting programs"
SERIES, DETECTING = "fitting every day", "looking for a change"
JOBS, PICTURES = "jobs", "corners in pictures"

_START = {READING: 0.15, CHECKING: 0.15}
_DIAGNOSIS = dict(zip(diagnosis.STEPS, (0.02, 0.5, 0.1, 0.2, 0.1, 0.08)))

STEPS: dict[str, dict[str, float]] = {
    "batch": {JOBS: 1.0},
    "calibrate": _START | {calibrate.FRAMES: 0.1, calibrate.GEOMETRY: 0.4, calibrate.JUDGING: 0.2},
    "certify": {READING: 0.02, CHECKING: 0.63, JUDGING: 0.35},
    "check": {READING: 0.02, SERIES: 0.75, DETECTING: 0.23},
    "compensate": {FRAMES: 0.01, CORRECTING: 0.7, TRUSTED: 0.29},
    "corners": {PICTURES: 1.0},
    "design": {design.CANDIDATES: 0.05, design.EXCHANGE: 0.15, design.POLISH: 0.15, CAUSES: 0.65},
    "diagnose": {READING: 0.02, CHECKING: 0.02} | _DIAGNOSIS,
    "evaluate": {READING: 0.02, CHECKING: 0.5, JUDGING: 0.36, AT_POSES: 0.12},
    "gear": _START | {gear.FITTING: 0.7},
    "identify": {READING: 0.02, CHECKING: 0.39, dynamics.EXCITED: 0.1, dynamics.FITTING: 0.28,
                 dynamics.CONSISTENT: 0.21},
    "loop": {MEASURING: 0.01, CALIBRATING: 0.05} | {name: 0.69 * share for name, share in _DIAGNOSIS.items()}
    | {EXECUTING: 0.25},
    "plan": {PLANNING: 0.9, TRUSTED: 0.1},
    "study": {CASES: 1.0},
}


def steps_of_kinds(kinds: Sequence[str]) -> dict[str, float]:
    """Of a diagnosis of a file that holds data of these kinds, one after the other."""
    each = {name: share for name, share in STEPS["diagnose"].items() if name != READING}
    return {READING: STEPS["diagnose"][READING]} | {
        step_of(name, kind, kinds): share for kind in kinds for name, share in each.items()}


def step_of(name: str, kind: str, kinds: Sequence[str]) -> str:
    """A step as it is told, with the kind of data where there are several."""
    return f"{kind.replace('_', ' ')}, {name}" if len(kinds) > 1 else name
