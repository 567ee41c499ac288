"""The rule by which results of two machines are compared: what it finds and what it lets pass."""

import copy
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.same_numbers import EQUAL, differences

RESULT = {
    "verdict": "something", "seconds": 3.0, "sentence": "Planned in 12 iterations and 3.1 ms.", "n": 7,
    "gear": {"value": 250.0, "ci95": [249.9, 250.1]},
    "error": {"rms": 1.0, "min": 1e-6, "max": 4.0, "n": 4268},
    "singular_values": [3.0, 1e-7], "probability": 0.5, "detectable": [{"parameter": "d_1", "size": 1e-3}],
    "tracking": {"max": 1e-5}, "path": {"max": 1e-5},
}


def found(*changes: tuple[object, ...]) -> list[str]:
    other = copy.deepcopy(RESULT)
    for *places, name, value in changes:
        part = other
        for place in places:
            part = part[place]
        part[name] = value
    return [words.split(":")[0] for size, words in differences(RESULT, other) if size > EQUAL]


@pytest.mark.parametrize("change", [
    ("verdict", "nothing"), ("n", 8), ("gear", "value", 250.0 + 1e-6), ("gear", "ci95", 0, 249.9 + 1e-6),
    ("error", "min", 1e-6 + 1e-8), ("error", "n", 4269), ("singular_values", 1, 1.1e-7),
    ("probability", 0.5 + 1e-8), ("detectable", [{"parameter": "d_1", "size": 1e-3 + 1e-11}]),
    ("detectable", [{"parameter": "d_2", "size": 1e-3}]),
    ("detectable", []), ("singular_values", [3.0]), ("more", 1), ("tracking", "max", 1.1e-5),
    ("path", "max", 1e-5 + 1e-11), ("probability", float("nan")),
], ids=str)
def test_what_differs_is_found(change):
    assert found(change) != []


@pytest.mark.parametrize("change", [
    ("seconds", 4.0), ("sentence", "Planned in 12 iterations and 4.2 ms."), ("gear", "ci95", 0, 249.9 + 1e-8),
    ("error", "min", 1e-6 + 1e-10), ("singular_values", 1, 1e-7 + 1e-9), ("tracking", "max", 1e-5 + 1e-10),
], ids=str)
def test_what_is_rounding_passes(change):
    assert found(change) == []
