"""Scores one diagnosis against the truth of its case, and many of them together.

A verdict counts as
    right       the first finding is a hidden effect, with its axis (and motor)
    in class    the first finding is a neighbour that such data can hardly tell from it (`NEIGHBOURS`), or the hidden
                effect is among the alternatives, marked as one that the data cannot tell apart
    wrong       anything else
and apart from that: the error after beside the best possible, false effects on clean data, honesty on foreign causes,
whether probabilities keep what they promise, and whether the validation error ever grew.
"""

from __future__ import annotations

import time
import traceback
from collections import defaultdict

import numpy as np

CLEAR = 1.5  # times the noise: from here on an effect has to be named
# Pairs that static poses or slow signals hardly tell apart, whatever the axis.
NEIGHBOURS = (
    {"base_compliance", "link_compliance"}, {"payload", "joint_compliance"}, {"thermal_drift", "tracker_drift"},
    {"thermal_drift", "tracker_scale"}, {"gear_eccentricity", "gear_harmonics"}, {"hysteresis", "backlash"},
    {"hysteresis", "direction_dependence"}, {"joint_compliance", "gear_eccentricity"}, {"joint_compliance", "link_compliance"},
    {"tracker_step", "tracker_drift"},
)


def diagnose_case(robot_file, data_file, truth: dict, seed: int = 0) -> dict:
    """Runs the diagnosis of one case and returns its score as a flat record."""
    from exactarm.dataset import read_dataset
    from exactarm.diagnose.diagnosis import diagnose
    from exactarm.robot_file import load_robot

    robot = load_robot(str(robot_file))
    start, worked = time.perf_counter(), time.process_time()
    try:
        found = diagnose(robot, read_dataset([str(data_file)], robot), seed=seed)
    except Exception:
        return _case_of(truth) | {"failed": traceback.format_exc(limit=-3), "score": "wrong", "seconds": time.perf_counter() - start}
    spent = {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - worked}
    return _case_of(truth) | spent | score(found, truth)


def _case_of(truth: dict) -> dict:
    return {
        "seed": truth["seed"], "arm": truth["arm"], "hidden": [label(effect) for effect in truth["effects"]],
        "foreign": any(effect["foreign"] for effect in truth["effects"]), "raised": truth["raised"],
        "noise": truth["noise"], "best": truth["best"], "rows": truth["rows"], "has": truth["has"],
    }


def label(effect: dict) -> str:
    axis = "" if effect["joint"] is None else f"_{effect['joint']}"
    by = f"_by_{effect['motor']}" if "motor" in effect else ""
    return effect["effect"] + axis + by


def label_of(effect) -> str:
    """The same for an effect of the package: drops forms that docs/effects.md does not have."""
    axis = "" if effect.joint is None else f"_{effect.joint}"
    by = f"_by_{effect.value_of('motor'):.0f}" if effect.name == "joint_coupling" else ""
    return effect.name + axis + by


def score(found, truth: dict) -> dict:
    """The record of one diagnosis."""
    hidden = [label(effect) for effect in truth["effects"]]
    named = [label_of(finding.effect) for finding in found.findings]
    judged = lambda summary: summary["validation"].rms if summary["validation"].n else summary["identification"].rms
    doubtful = {label_of(other.effect) for other in found.alternatives if other.collides}
    return {
        "verdict": found.verdict, "named": named, "score": _verdict_score(found, truth, hidden, named, doubtful),
        "probability": [float(finding.probability) for finding in found.findings],
        "hits": [name in hidden for name in named], "missed": [name for name in hidden if name not in named],
        "before": judged(found.before), "after": judged(found.after), "noise_found": found.noise.value,
        "against_best": judged(found.after) / truth["best"], "doubtful": sorted(doubtful), "sentence": found.sentence,
    }


def _verdict_score(found, truth, hidden, named, doubtful) -> str:
    if any(effect["foreign"] for effect in truth["effects"]):
        return "right" if found.verdict == "unexplained" else "wrong"
    if not hidden:
        return "right" if not named and found.verdict == "no_undeclared_effect" else "wrong"
    if not named:
        return "silent"
    if named[0] in hidden:
        return "right"
    first = found.findings[0].effect
    alike = any({first.name, effect["effect"]} in NEIGHBOURS and first.joint in (None, effect["joint"]) or
                {first.name, effect["effect"]} in NEIGHBOURS and effect["joint"] is None for effect in truth["effects"])
    return "in class" if alike or doubtful & set(hidden) else "wrong"


def summary(records: list[dict]) -> dict:
    """The marks over many cases."""
    share = lambda values: float(np.mean(values)) if len(values) else None
    alone = [r for r in records if len(r["hidden"]) == 1 and not r["foreign"]]
    clear = [r for r in alone if r["raised"] >= CLEAR]
    pairs = [r for r in records if len(r["hidden"]) == 2]
    clean = [r for r in records if not r["hidden"]]
    foreign = [r for r in records if r["foreign"]]
    run = [r for r in records if "failed" not in r]
    known = [r for r in run if r["hidden"] and not r["foreign"]]
    by_effect = defaultdict(list)
    for r in clear:
        by_effect[r["hidden"][0].rstrip("0123456789_").replace("_by", "").rstrip("0123456789_")].append(r["score"])
    bins = defaultdict(list)
    for r in run:
        if not r["foreign"]:
            for p, hit in zip(r["probability"], r["hits"]):
                bins["0.99+" if p >= 0.99 else "0.9-0.99" if p >= 0.9 else "0.5-0.9" if p >= 0.5 else "below 0.5"].append(hit)
    against = [r["against_best"] for r in known if r["raised"] >= CLEAR]
    return {
        "cases": len(records), "failed": len(records) - len(run),
        "first_right_when_clear": share([r["score"] == "right" for r in clear]), "clear_cases": len(clear),
        "first_right_or_in_class_when_clear": share([r["score"] in ("right", "in class") for r in clear]),
        "by_effect": {name: f"{scores.count('right')}/{len(scores)}" for name, scores in sorted(by_effect.items())},
        "first_right_when_faint": share([r["score"] == "right" for r in alone if r["raised"] < CLEAR]),
        "smallest_found": {f"{low}-{high}": share([r["score"] == "right" for r in alone if low <= r["raised"] < high])
                           for low, high in ((1.0, 1.1), (1.1, 1.25), (1.25, 1.5), (1.5, 2.0), (2.0, 5.5))},
        "pairs_both_named": share([not r.get("missed", [1]) for r in pairs]), "pairs": len(pairs),
        "pairs_first_right": share([r["score"] == "right" for r in pairs]),
        "clean_with_effects": share([r["score"] == "wrong" for r in clean]), "clean": len(clean),
        "foreign_unexplained": share([r["score"] == "right" for r in foreign]), "foreign": len(foreign),
        "after_over_best_median": float(np.median(against)) if against else None,
        "after_over_best_90": float(np.quantile(against, 0.9)) if against else None,
        "extra_effects": share([max(len(r["named"]) - len(r["hidden"]), 0) for r in known]),
        "validation_grew": [r["seed"] for r in run if r["after"] > r["before"] * (1.0 + 1e-9)],
        "probabilities": {name: f"{sum(hits)}/{len(hits)}" for name, hits in sorted(bins.items())},
        "seconds_median": float(np.median([r["seconds"] for r in records])) if records else None,
        "seconds_max": float(np.max([r["seconds"] for r in records])) if records else None,
    }
