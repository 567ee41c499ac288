"""The marks over many scored cases: how often right, how honest the probabilities, how wide the intervals.

Expected calibration error: sum over bins of n_bin / n |share right - mean stated probability| (Naeini,
Cooper and Hauskrecht 2015), over every effect that was named on cases without a foreign cause. Intervals of
shares are exact binomial ones (Clopper and Pearson 1934) of 95 %.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from scipy.stats import beta

CLEAR = 1.5  # times the noise: from here on an effect has to be named
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)  # fine where statements are
SIZES = (1.0, 1.1, 1.25, 1.5, 2.0, 5.5)


def summary(records: list[dict]) -> dict:
    """The marks over the records of `scorer.diagnose_case`."""
    alone = [r for r in records if len(r["hidden"]) == 1 and not r["foreign"]]
    clear = [r for r in alone if r["raised"] >= CLEAR]
    pairs = [r for r in records if len(r["hidden"]) == 2 and not r["foreign"]]
    clean = [r for r in records if not r["hidden"]]
    foreign = [r for r in records if r["foreign"]]
    run = [r for r in records if "failed" not in r]
    known = [r for r in run if r["hidden"] and not r["foreign"]]
    by_effect = defaultdict(list)
    for r in clear:
        by_effect[_name_of(r["hidden"][0])].append(r["score"])
    against = [r["against_best"] for r in known if r["raised"] >= CLEAR]
    return (
        {
            "cases": len(records),
            "failed": len(records) - len(run),
            "first_right_when_clear": _share([r["score"] == "right" for r in clear]),
            "clear_cases": len(clear),
            "first_right_or_in_class_when_clear": _share(
                [r["score"] in ("right", "in class") for r in clear]
            ),
            "by_effect": {
                name: f"{scores.count('right')}/{len(scores)}" for name, scores in sorted(by_effect.items())
            },
            "first_right_when_faint": _share([r["score"] == "right" for r in alone if r["raised"] < CLEAR]),
            "faint_cases": len(alone) - len(clear),
            "smallest_found": {
                f"{low}-{high}": _share([r["score"] == "right" for r in alone if low <= r["raised"] < high])
                for low, high in zip(SIZES[:-1], SIZES[1:])
            },
            "pairs_both_named": _share([not r.get("missed", [1]) for r in pairs]),
            "pairs": len(pairs),
            "pairs_first_right": _share([r["score"] == "right" for r in pairs]),
            "clean_with_effects": _share([bool(r.get("named", ["failed"])) for r in clean]),
            "clean": len(clean),
            "false_alarms": _counted([bool(r.get("named", ["failed"])) for r in clean]),
            "clean_unexplained": _counted([r.get("verdict") == "unexplained" for r in clean]),
            "foreign_unexplained": _share([r["score"] == "right" for r in foreign]),
            "foreign": len(foreign),
            "after_over_best_median": float(np.median(against)) if against else None,
            "after_over_best_90": float(np.quantile(against, 0.9)) if against else None,
            "extra_effects": _share([max(len(r["named"]) - len(r["hidden"]), 0) for r in known]),
            "validation_grew": [r["seed"] for r in run if r["after"] > r["before"] * (1.0 + 1e-9)],
        }
        | calibration(run)
        | {
            "intervals_hold": _counted([held for r in run for held in r.get("intervals", {}).values()]),
            "credible_sets_hold": _counted(
                [held for r in run if not r["foreign"] for held in r.get("sets", [])]
            ),
            "by_condition": _by_condition(records),
            "seconds_median": float(np.median([r["seconds"] for r in records])) if records else None,
            "seconds_max": float(np.max([r["seconds"] for r in records])) if records else None,
            "cpu_seconds_median": float(
                np.median([r["cpu_seconds"] for r in records if "cpu_seconds" in r] or [0.0])
            ),
            "cpu_seconds_max": float(
                np.max([r["cpu_seconds"] for r in records if "cpu_seconds" in r] or [0.0])
            ),
        }
    )


def calibration(run: list[dict]) -> dict:
    """Whether stated probabilities keep what they promise: shares right in bins, the expected error."""
    said = [(p, bool(hit)) for r in run if not r["foreign"] for p, hit in zip(r["probability"], r["hits"])]
    stated, hit = np.array([p for p, _ in said]), np.array([h for _, h in said], float)
    bins, expected = {}, 0.0
    for low, high in zip(BINS[:-1], BINS[1:]):
        own = (stated >= low) & ((stated < high) | (high == BINS[-1]))
        if np.any(own):
            right, mean = float(hit[own].mean()), float(stated[own].mean())
            bins[f"{low:g}-{high:g}"] = {
                "right": f"{int(hit[own].sum())}/{own.sum()}",
                "stated": mean,
                "share": right,
            }
            expected += own.sum() / len(said) * abs(right - mean)
    above = lambda least: _counted(list(hit[stated >= least] > 0.0))
    return {
        "right_of_0.95": above(0.95),
        "right_of_0.99": above(0.99),
        "statements": len(said),
        "expected_calibration_error": float(expected) if said else None,
        "reliability": bins,
    }


def _by_condition(records: list[dict]) -> dict:
    """Clear single causes first right, clean cases with an effect, the error after, by condition."""
    table = {}
    names = sorted({name for r in records for name in r.get("conditions", {})})
    for name in names:
        own = [r for r in records if name in r.get("conditions", {})]
        clear = [
            r["score"] == "right"
            for r in own
            if len(r["hidden"]) == 1 and not r["foreign"] and r["raised"] >= CLEAR
        ]
        false = [bool(r.get("named", ["failed"])) for r in own if not r["hidden"]]
        against = [r["against_best"] for r in own if "against_best" in r and r["hidden"] and not r["foreign"]]
        table[name] = {
            "cases": len(own),
            "clear_first_right": f"{sum(clear)}/{len(clear)}",
            "clean_with_effects": f"{sum(false)}/{len(false)}",
            "after_over_best_median": float(np.median(against)) if against else None,
        }
    return table


def _name_of(hidden: str) -> str:
    """`joint_coupling` of `joint_coupling_6_by_5`."""
    digits = "0123456789_"
    return hidden.rstrip(digits).removesuffix("_by").rstrip(digits)


def _share(values: list) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _counted(values: list[bool]) -> dict:
    """How many of how many, with the exact 95 % interval of the share."""
    n, k = len(values), int(sum(values))
    if not n:
        return {"of": "0/0", "share": None, "ci95": None}
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return {"of": f"{k}/{n}", "share": k / n, "ci95": [low, high]}


def printed(marks: dict) -> str:
    """The marks as a table: name, value; tables within it indented beneath their name."""
    lines = []
    for name, value in marks.items():
        nested = isinstance(value, dict) and any(isinstance(inner, dict) for inner in value.values())
        lines.append(f"{name:36s} {'' if nested else _text(value)}".rstrip())
        lines += [f"  {key:34s} {_text(inner)}" for key, inner in value.items()] if nested else []
    return "\n".join(lines)


def _text(value) -> str:
    if isinstance(value, dict) and "ci95" in value:
        if value["ci95"] is None:
            return value["of"]
        low, high = (100 * end for end in value["ci95"])
        return f"{value['of']} ({100 * value['share']:.1f} %, {low:.1f} to {high:.1f} %)"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(inner)}" for key, inner in value.items())
    return f"{value:.3f}" if isinstance(value, float) else "-" if value is None else str(value)
