"""The short runs of the commands on one machine beside another: results equal to 1e-9, words alike.

    python tests/robustness/machines.py files FOLDER              what the runs read, to copy to the other
    python tests/robustness/machines.py run FOLDER [COMMAND...]   on each machine
    python tests/robustness/machines.py compare FOLDER FOLDER     anywhere; exit 1 where they differ

What may differ: times (also in a sentence), the run's name, and the place of files. A number is compared with
the largest of the numbers beside it: of its list, or of a value and its interval.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.short_runs import RUNS, environment, prepare, words_of

EQUAL = 1e-9
SECONDS = re.compile(r"\b[\d.]+ s\b")
OWN = {"seconds", "asked", "run", "inputs", "files", "peak_MB"}


def run(folder: Path, names: list[str]) -> int:
    os.environ |= environment(Path(), folder)
    from exactarm.cli import main as exactarm

    ended = 0
    for name in names or list(RUNS):
        code = exactarm(words_of(name, folder / "files", folder / name))
        print(f"{name:<14} exit {code}", flush=True)
        ended = ended or code
    return ended


def numbers(value: object) -> list[float]:
    """The numbers of a list of them and of lists within it."""
    if isinstance(value, list):
        return [number for part in value for number in numbers(part)]
    return [float(value)] if isinstance(value, (int, float)) and not isinstance(value, bool) else []


def differences(ours: object, others: object, place: str = "",
                scale: float = 0.0) -> Iterator[tuple[float, str]]:
    """How far each value lies from that of the other, as a share of the scale, and where it is."""
    if isinstance(ours, dict) and isinstance(others, dict):
        if set(ours) != set(others):
            yield float("inf"), f"{place}: {sorted(set(ours) ^ set(others))} is in one alone"
        scale = max((abs(number) for value in ours.values() for number in numbers(value)), default=0.0)
        for name in sorted(set(ours) & set(others) - OWN):
            yield from differences(ours[name], others[name], f"{place}.{name}", scale)
    elif isinstance(ours, list) and isinstance(others, list):
        if len(ours) != len(others):
            yield float("inf"), f"{place}: {len(ours)} and {len(others)} values"
        scale = max(map(abs, numbers(ours)), default=0.0)
        for index, (one, other) in enumerate(zip(ours, others, strict=False)):
            yield from differences(one, other, f"{place}[{index}]", scale)
    elif isinstance(ours, float) and isinstance(others, (int, float)):
        if ours != others:
            yield abs(ours - others) / max(scale, abs(ours)), f"{place}: {ours!r} and {others!r}"
    elif ours != others and SECONDS.sub("", str(ours)) != SECONDS.sub("", str(others)):
        yield float("inf"), f"{place}: {ours!r} and {others!r}"


def compare(first: Path, second: Path) -> int:
    bad = 0
    for file in sorted(first.glob("*/result.json")):
        name = file.parent.name
        pair = [json.loads((folder / name / "result.json").read_text().replace(str(folder), ""))
                for folder in (first, second)]
        found = sorted(differences(*pair), reverse=True)
        worst = found[0][0] if found else 0.0
        print(f"{name:<14} largest difference {worst:.1e}")
        for size, words in found[:12]:
            if size > EQUAL:
                print(f"    {size:.1e} {words[:150]}")
        bad += worst > EQUAL
    print(f"{bad} commands differ by more than {EQUAL:g}")
    return bool(bad)


if __name__ == "__main__":
    task, folder, *words = sys.argv[1:]
    if task == "files":
        prepare(Path(folder) / "files")
    elif task == "run":
        sys.exit(run(Path(folder).resolve(), words))
    else:
        sys.exit(compare(Path(folder).resolve(), Path(words[0]).resolve()))
