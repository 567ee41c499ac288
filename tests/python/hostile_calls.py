"""Calls everything that the compiled core offers with wrong values: a program for a subprocess.

    python hostile_calls.py SEED CALLS LOG

The signatures are read from the core itself, so that a new function is attacked as soon as it exists. Most
arguments are right or nearly so, one or more are not: other shapes, types and strides, NaN, empty and huge
arrays, huge numbers. Python exceptions are what is expected; a crash, or more than the memory and time given
here, is not. Each call is written to LOG before it is made, so that the last line names what crashed.
"""

from __future__ import annotations

import re
import resource
import sys
import types
import warnings

import numpy as np

from exactarm import _core

MEMORY_BYTES = 6 << 30
PROCESSOR_S = 600
AXES = (1, 2, 6, 7, 18)
HUGE = 10**9


def split_arguments(text: str) -> list[str]:
    """Comma-separated parts of a signature's inside, commas in brackets and quotes left alone."""
    parts, depth, quoted, start = [], 0, False, 0
    for at, letter in enumerate(text):
        quoted ^= letter == '"'
        depth += 0 if quoted else (letter in "([{<") - (letter in ")]}>")
        if letter == "," and depth == 0 and not quoted:
            parts.append(text[start:at])
            start = at + 1
    return [part.strip() for part in (*parts, text[start:]) if part.strip()]


def signatures(document: str) -> list[list[tuple[str, str]]]:
    """(name, type) of the arguments of every overload that a docstring of pybind11 names."""
    found = []
    for line in document.replace("->", "\0").splitlines():
        match = re.match(r"(?:\d+\. )?\w*\((.*)\) \0", line)
        if match:
            pairs = [part.split(" = ")[0].partition(": ") for part in split_arguments(match[1])]
            found.append([(name, kind) for name, _, kind in pairs
                          if name not in ("self", "*args", "**kwargs")])
    return found


def targets() -> dict[str, list[list[tuple[str, str]]]]:
    """Everything that can be called: functions, constructors, methods and setters ("Class.member")."""
    found = {}
    for name, value in vars(_core).items():
        if isinstance(value, types.BuiltinFunctionType):
            found[name] = signatures(value.__doc__)
        if not isinstance(value, type) or issubclass(value, Exception) or hasattr(value, "__members__"):
            continue
        for member, attribute in vars(value).items():
            document = getattr(attribute, "__doc__", None)
            if isinstance(attribute, property):
                if attribute.fset:
                    found[f"{name}.{member}="] = [pairs[-1:] for pairs in signatures(attribute.fset.__doc__)]
            elif callable(attribute) and document and not member.startswith("_pybind11"):
                found[f"{name}.{member}"] = signatures(document)
    return {name: overloads for name, overloads in found.items() if overloads}


class Hostile:
    """Values for arguments, right and wrong, from a seeded generator."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)
        self.axes = 6

    def pick(self, choices):
        return choices[self.rng.integers(len(choices))]

    def number(self) -> object:
        return self.pick([0.0, 1.0, -1.0, 50.0, 1e-3, np.nan, np.inf, -np.inf, 1e300, -1e300, 5e-324,
                          2**31, -(2**63), 2**80,
                          None, "1", 1j, [1.0]])

    def whole(self) -> object:
        return self.pick([0, 1, 2, 3, -1, 7, 1000, 2**31 - 1, -(2**31), 2**63, 1.5, None, "two", True])

    def shape(self) -> tuple[int, ...]:
        n = self.axes
        return self.pick([(n,), (4 * n,), (20, n), (20, n), (20, n), (1, n), (0, n), (n, 20), (20, n + 1),
                          (20, 3), (20, 9), (20,),
                          (10,), (), (0,), (0, 0), (n, n), (20, n, n), (3,), (3, 3), (300, n), (40, 9),
                          (40, 3), (1, 1, 1, 1)])

    def array(self) -> object:
        size = self.pick([0.1, 1.0, 1.0, 1.0, 100.0, 1e6, 1e160, 0.0])
        values = self.rng.normal(size=self.shape()) * size
        if values.size and self.rng.random() < 0.2:
            values.flat[self.rng.integers(values.size)] = self.pick([np.nan, np.inf, -np.inf, 1e308])
        changes = (
            lambda v: v, lambda v: v, lambda v: v, np.asfortranarray, lambda v: v[::-1] if v.ndim else v,
            lambda v: v[..., ::-1] if v.ndim else v, lambda v: v[::2] if v.ndim else v, lambda v: v.T,
            lambda v: v.astype(np.float32),
            lambda v: np.nan_to_num(v, posinf=0, neginf=0).clip(-9, 9).astype(int), lambda v: v > 0,
            lambda v: v.astype(complex), lambda v: v.astype(object), lambda v: v.astype(str),
            lambda v: v.tolist(),
            lambda v: np.broadcast_to(0.5, v.shape), lambda v: v.astype(">f8"),
        )
        if self.rng.random() < 0.02:
            return np.broadcast_to(0.5, self.pick([(HUGE, 6), (HUGE,), (6, HUGE), (2**40,), (3, 2**50)]))
        return self.pick(changes)(values)

    def right_array(self, name: str) -> np.ndarray:
        """What the argument wants, by its name."""
        n = self.axes
        if name in ("order", "a", "b"):
            return np.abs(self.rng.normal(size=2)) * (50.0 if name == "order" else 1e-2)
        if name in ("x", "torques", "start", "q_offset", "parameters"):
            return self.rng.normal(size={"x": 4 * n, "torques": 2 * n, "parameters": 10}.get(name, n))
        if name == "positions":
            return self.rng.normal(size=(20, 3))
        if name == "rotations":
            return np.tile(np.eye(3).ravel(), (20, 1))
        if name in ("time", "angle", "value", "weight", "motion", "phi", "theta", "factor"):
            return np.sort(np.abs(self.rng.normal(size=20)))
        if name in ("rotation", "inertia"):
            return np.eye(3)
        if name in ("position", "centre_of_mass", "gravity", "squares"):
            return self.rng.normal(size=3)
        if name in ("gram", "diagonal", "last", "before_last", "right"):
            return self.rng.normal(size=(20, n, n))
        return self.rng.normal(size=(20, n))

    def robot(self) -> _core.Robot:
        table = _core.GearTable([1.0, 30.0], [1e-3, 1e-3], [1e-3, 0.0])
        link = _core.LinkInertia(2.0, np.full(3, 0.1), np.eye(3)) if self.rng.random() < 0.8 else None
        joints = [
            _core.Joint(
                _core.Frame(self.pick([_core.JointType.revolute, _core.JointType.prismatic]),
                            alpha=1.57 * self.rng.integers(-1, 2),
                            a=0.3, d=0.1),
                gear=_core.Gear(60.0, table, table), spring=_core.Spring(self.pick([0.0, 1e4, 1e4, 1e4])),
                drive=_core.Drive(self.pick([0.0, 1e-3, 1e-3])), limits=_core.Limits(-3.0, 3.0), link=link,
            )
            for _ in range(self.axes)
        ]
        return _core.Robot(joints)

    def problem(self) -> _core.PlanProblem:
        problem = _core.PlanProblem(self.robot())
        knots = self.pick([0, 1, 11, 12, 13, 40, 300])
        problem.q_desired = np.tile(np.linspace(0.0, 0.1, knots)[:, None], (1, self.axes))
        for name in ("direction", "phi_shift", "q_offset", "step", "weight"):
            if self.rng.random() < 0.15:
                self.try_to_set(problem, name, self.array() if name in ("direction", "phi_shift", "q_offset")
                                else self.number())
        if self.rng.random() < 0.15:
            self.try_to_set(problem.bounds, self.pick(["q_min", "q_max", "q_dot", "theta_min", "theta_ddot"]),
                            self.array())
        if self.rng.random() < 0.15:
            problem.springs = [_core.Spring(self.pick([0.0, 1.0, -1.0, np.nan]))] * int(
                self.rng.integers(0, 30)
            )
        if self.rng.random() < 0.1:
            problem.gears = [_core.Gear(self.pick([0.0, 1.0, np.nan]))] * int(self.rng.integers(0, 30))
        return problem

    @staticmethod
    def try_to_set(owner: object, name: str, value: object) -> None:
        try:
            setattr(owner, name, value)
        except Exception:  # refused: the value of before stays
            pass

    def instance(self, kind: str) -> object:
        if kind == "Robot":
            return self.robot()
        if kind == "PlanProblem":
            return self.problem()
        if kind == "GearTable":
            amplitude = self.pick([1e-3, 1e-3, 0.6, 2.0, np.nan, 1e300])
            return _core.GearTable(self.pick([[1.0, 2.0], [1e9, 2e9], [0.0, -1.0], [np.nan, 1.0]]),
                                   [amplitude] * 2, [0.0, amplitude])
        if kind == "Gear":
            return _core.Gear(50.0, self.instance("GearTable"), self.instance("GearTable"))
        if kind in ("ElasticJointModel", "ElasticJointDynamics"):
            joints = [_core.Joint(spring=_core.Spring(1e4), drive=_core.Drive(1e-3),
                                  link=_core.LinkInertia(1.0, np.ones(3), np.eye(3)))]
            model = _core.ElasticJointModel(_core.Robot(joints * self.axes), self.rng.random() < 0.5)
            return model if kind == "ElasticJointModel" else _core.ElasticJointDynamics(model)
        if kind == "PlanOptions":
            options = _core.PlanOptions()
            options.method = self.pick([_core.PlanMethod.stagewise, _core.PlanMethod.stagewise,
                                        _core.PlanMethod.ipopt])
            options.iterations, options.threads = self.pick([-1, 0, 3, 20]), self.pick([-1, 0, 1, 2, 10**6])
            options.seconds = self.pick([-1.0, 0.0, 5.0])
            return options
        if kind == "InverseKinematicsOptions":
            options = _core.InverseKinematicsOptions()
            options.iterations, options.tolerance = self.pick([-1, 0, 60]), self.pick([np.nan, 0.0, 1e-12])
            return options
        if kind == "PlanBounds":
            return _core.PlanProblem(self.robot()).bounds
        if kind == "LinkInertia":
            return _core.LinkInertia(1.0, np.zeros(3), np.eye(3))
        value = getattr(_core, kind)
        if hasattr(value, "__members__"):
            return self.pick(list(value.__members__.values()))
        return value()

    def argument(self, name: str, kind: str) -> object:
        wrong = self.rng.random() < 0.25
        if wrong and self.rng.random() < 0.2:
            return self.pick([None, "text", object(), 3, [], {}, b"bytes", self.array(), self.number()])
        own = re.fullmatch(r"(?:exactarm\._core\.)?(\w+)(?: \| None)?", kind)
        if own and hasattr(_core, own[1]):
            return self.instance(own[1])
        listed = re.fullmatch(r"collections\.abc\.Sequence\[exactarm\._core\.(\w+)\]", kind)
        if listed:
            return [self.instance(listed[1]) for _ in range(self.pick([0, 1, 6, 65, 200]))]
        if kind.startswith("collections.abc.Sequence"):
            return self.pick([[0], [0], [], [0, 10], [5], [0, 10, 3], [0, 2**40], [-1], [0, -5], [0, 0, 20],
                              [0, 21], ["a"]])
        if "numpy" in kind:
            vector = '"[m, 1]"' in kind and name in ("q", "q_dot", "arg0", "arg1")
            return (
                self.array() if wrong else self.rng.normal(size=self.axes)
                if vector else self.right_array(name)
            )
        if "SupportsFloat" in kind:
            return self.number() if wrong else float(self.rng.uniform(0.1, 2.0))
        if "SupportsInt" in kind:
            return self.whole() if wrong else int(self.rng.integers(0, 4))
        return self.pick([True, False, "name", 1.0, None])


def describe(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape} {value.dtype} strides {value.strides}"
    return repr(value)[:120]


def attack(hostile: Hostile, name: str, overloads: list[list[tuple[str, str]]], log) -> bool:
    """One call; whether it came through without an exception."""
    hostile.axes = hostile.pick(AXES)
    signature = hostile.pick(overloads)
    try:
        owner = None
        if "." in name:
            kind, member = name.split(".")
            owner = getattr(_core, kind) if member == "__init__" else hostile.instance(kind)
        values = [hostile.argument(*pair) for pair in signature]
    except (_core.InvalidArgument, TypeError, AttributeError):
        return False  # this robot or value was refused when it was made
    log.write(f"{name}({', '.join(describe(value) for value in values)}) with {hostile.axes} axes\n")
    log.flush()
    try:
        if owner is None:
            result = getattr(_core, name)(*values)
        elif member.endswith("="):
            result = setattr(owner, member[:-1], *values)
        else:
            result = owner(*values) if member == "__init__" else getattr(owner, member)(*values)
        repr(result)
        return True
    except Exception as error:
        if isinstance(error, SystemError):
            raise
        return False


def main() -> None:
    seed, calls, log_file = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S))
    np.seterr(all="ignore")
    warnings.simplefilter("ignore")
    hostile, found = Hostile(seed), targets()
    came_through = dict.fromkeys(found, 0)
    with open(log_file, "w", encoding="utf-8", errors="replace") as log:
        for call in range(calls):
            name = list(found)[call % len(found)]
            came_through[name] += attack(hostile, name, found[name], log)
        # a right call is rare where a whole model is an argument: those without one get a tenth of all more
        for name in [name for name, count in came_through.items() if count == 0]:
            came_through[name] += any(attack(hostile, name, found[name], log) for _ in range(calls // 10))
    never = [name for name, count in came_through.items() if count == 0]
    print(f"{calls} calls of {len(found)} targets, seed {seed}; never came through: "
          f"{', '.join(never) or 'none'}")


if __name__ == "__main__":
    main()
