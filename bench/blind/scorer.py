"""Scores one diagnosis against the truth of its case, from the `result.json` that the command has written.

A verdict counts as
    right       the first finding is a hidden effect, with its axis (and motor)
    in class    the first finding is a neighbour that such data can hardly tell from it (`NEIGHBOURS`), or the
                hidden effect is among the alternatives, marked as one that the data cannot tell apart
    wrong       anything else
and apart from that: the error after beside the best possible, false effects on clean data, honesty on
foreign causes, whether probabilities and intervals keep what they promise, and whether the validation error
ever grew.

The program under test runs in this process, by its command line: its place on `sys.path` says which it is.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

# Pairs that static poses or slow signals hardly tell apart, whatever the axis.
NEIGHBOURS = (
    {"base_compliance", "link_compliance"},
    {"payload", "joint_compliance"},
    {"thermal_drift", "tracker_drift"},
    {"thermal_drift", "tracker_scale"},
    {"gear_eccentricity", "gear_harmonics"},
    {"hysteresis", "backlash"},
    {"hysteresis", "direction_dependence"},
    {"joint_compliance", "gear_eccentricity"},
    {"joint_compliance", "link_compliance"},
    {"tracker_step", "tracker_drift"},
)
UNKNOWN = "unknown"  # the entry of a result that says: something else


def diagnose_case(robot_file, data_file, truth: dict, seed: int = 0, without: tuple[str, ...] = ()) -> dict:
    """Runs the diagnosis of one case and returns its score as a flat record.

    without: effects that the library of the program is not to have; hidden ones of them are foreign to it.
    """
    truth = truth | {
        "effects": [e | {"foreign": e["foreign"] or e["effect"] in without} for e in truth["effects"]]
    }
    start, worked = time.perf_counter(), time.process_time()
    found, failed = _run(robot_file, data_file, seed, without)
    spent = {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - worked}
    case = _case_of(truth) | spent | {"without": list(without)}
    return case | ({"failed": failed, "score": "wrong"} if found is None else score(found, truth))


def _run(robot_file, data_file, seed: int, without: tuple[str, ...]) -> tuple[dict | None, str]:
    from exactarm.cli import main

    shrink_library(without)
    said, streams = io.BytesIO(), [io.TextIOWrapper(io.BytesIO(), write_through=True) for _ in range(2)]
    streams[1] = io.TextIOWrapper(said, write_through=True)
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(streams[0]), redirect_stderr(streams[1]):
        words = [
            "diagnose",
            str(robot_file),
            str(data_file),
            "--out",
            folder,
            "--seed",
            str(seed),
            "--quiet",
            "--debug",
        ]
        code = main(words)
        result = Path(folder) / "result.json"
        if code == 0 and result.exists():
            return json.loads(result.read_text()), ""
    return None, said.getvalue().decode(errors="replace")[-2000:] or f"exit code {code}"


def shrink_library(without: tuple[str, ...]) -> None:
    """Takes effects out of the library of the program under test, for this process."""
    if not without:
        return
    from exactarm.effects import library

    for name in without:
        library().pop(name, None)
        if name in library():
            raise RuntimeError(f"the library of this program does not let {name} be taken out")


def _case_of(truth: dict) -> dict:
    return {
        "seed": truth["seed"],
        "arm": truth["arm"],
        "hidden": [label(effect) for effect in truth["effects"]],
        "kind": truth["kind"],
        "foreign": any(effect["foreign"] for effect in truth["effects"]),
        "raised": truth["raised"],
        "noise": truth["noise"],
        "best": truth["best"],
        "rows": truth["rows"],
        "has": truth["has"],
        "conditions": truth.get("conditions", {}),
    }


def label(effect: dict) -> str:
    """`joint_coupling_6_by_5`, of a cause in the truth or of an entry of a result; forms are dropped."""
    axis = "" if effect["joint"] is None else f"_{effect['joint']}"
    motor = effect.get("motor", effect.get("parameters", {}).get("motor"))
    return effect["effect"] + axis + ("" if motor is None else f"_by_{motor:.0f}")


def score(found: dict, truth: dict) -> dict:
    """The record of one diagnosis; found: its result.json."""
    hidden = [label(effect) for effect in truth["effects"]]
    effects = [effect for effect in found["effects"] if effect["effect"] != UNKNOWN]
    named = [label(effect) for effect in effects]
    doubtful = {label(other) for other in found["alternatives"] if other["cannot_be_told_apart"]}
    doubtful = {name for name in hidden if any(name == d or name.startswith(d + "_by_") for d in doubtful)}
    return {
        "verdict": found["verdict"],
        "named": named,
        "score": _verdict_score(found, truth, hidden, effects, doubtful),
        "probability": [float(effect["probability"]) for effect in effects],
        "hits": [name in hidden for name in named],
        "missed": [name for name in hidden if name not in named],
        "before": _judged(found["before"]),
        "after": _judged(found["after"]),
        "noise_found": found["noise_floor"],
        "against_best": _judged(found["after"]) / truth["best"],
        "doubtful": sorted(doubtful),
        "sentence": found["sentence"],
        "intervals": _intervals(effects, named, truth),
        "sets": [_in_set(effect["set"], truth["effects"]) for effect in effects if effect.get("set")],
        "else_joint": [effect["joint"] for effect in found["effects"] if effect["effect"] == UNKNOWN],
        "else_said": " ".join(e.get("evidence", "") for e in found["effects"] if e["effect"] == UNKNOWN),
        "drafts": len(found.get("drafts", ())),
    } | {
        key: found[key]
        for key in ("probability_nothing", "probability_something_else", "false_alarm_rate", "converged")
        if key in found
    }


def _judged(summaries: dict) -> float:
    return summaries["validation" if summaries["validation"]["n"] else "identification"]["rms"]


def _intervals(effects: list[dict], named: list[str], truth: dict) -> dict[str, bool]:
    """For every parameter that the truth has as the program has it: does the interval hold it?"""
    true = {label(effect): effect.get("parameters", {}) for effect in truth["effects"]}
    return {
        f"{name}.{parameter}": bool(entry["ci95"][0] <= true[name][parameter] <= entry["ci95"][1])
        for name, effect in zip(named, effects)
        if name in true
        for parameter, entry in effect["parameters"].items()
        if parameter in true[name] and isinstance(entry, dict) and None not in entry["ci95"]
    }


def _in_set(members: list[dict], hidden: list[dict]) -> bool:
    """Whether a credible set holds a hidden cause with its axis."""
    true = {(effect["effect"], effect["joint"]) for effect in hidden}
    return any((member["effect"], member["joint"]) in true for member in members)


def _verdict_score(
    found: dict, truth: dict, hidden: list[str], effects: list[dict], doubtful: set[str]
) -> str:
    if any(effect["foreign"] for effect in truth["effects"]):
        return "right" if found["verdict"] == "unexplained" else "wrong"
    if not hidden:
        return "right" if not effects and found["verdict"] == "no_undeclared_effect" else "wrong"
    if not effects:
        return "silent"
    first = effects[0]
    if label(first) in hidden:
        return "right"
    alike = any(
        {first["effect"], effect["effect"]} in NEIGHBOURS
        and first["joint"] in (None, effect["joint"])
        or {first["effect"], effect["effect"]} in NEIGHBOURS
        and effect["joint"] is None
        for effect in truth["effects"]
    )
    return "in class" if alike or doubtful else "wrong"
