"""Formulas: a small language for one number from named ones, with exact derivatives. Nothing of it is ever
run as code.

    sum      = product (("+" | "-") product)*
    product  = power (("*" | "/") power)*
    power    = ("-" | "+") power | atom ("^" power)?
    atom     = number | name | function "(" sum ")" | "(" sum ")"

Functions: sin cos tan exp log sqrt abs sign tanh atan step (0 below zero, 1 above). Values are arrays (N,);
the derivative by every name is carried along (forward differentiation). What is not in the language raises
FormulaError, which says where.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

LONGEST, DEEPEST = 1000, 50  # characters, nested brackets
_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|([-+*/^()]))")
_FUNCTIONS = {
    "sin": (np.sin, np.cos),
    "cos": (np.cos, lambda x: -np.sin(x)),
    "tan": (np.tan, lambda x: 1.0 / np.cos(x) ** 2),
    "exp": (np.exp, np.exp),
    "log": (np.log, lambda x: 1.0 / x),
    "sqrt": (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    "abs": (np.abs, np.sign),
    "sign": (np.sign, np.zeros_like),
    "tanh": (np.tanh, lambda x: 1.0 - np.tanh(x) ** 2),
    "atan": (np.arctan, lambda x: 1.0 / (1.0 + x**2)),
    "step": (lambda x: np.heaviside(x, 0.5), np.zeros_like),
}


class FormulaError(ValueError):
    """A text that is no formula; the message says what was expected, and where."""


@dataclass(frozen=True)
class Formula:
    """The text and its names, in the order of their first use."""

    text: str
    names: tuple[str, ...]
    tree: tuple

    @staticmethod
    def of(text: str) -> Formula:
        tokens = _tokens(text)
        tree, at = _sum(tokens, 0, 0)
        if at < len(tokens):
            raise FormulaError(f"{tokens[at][1]!r} is not expected after "
                               f"{' '.join(t for _, t in tokens[:at])!r}")
        names: dict[str, None] = {}
        _collect(tree, names)
        return Formula(text, tuple(names), tree)

    def __call__(self, values: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Value (N,) and its derivative (N,) by every name."""
        missing = [name for name in self.names if name not in values]
        if missing:
            raise FormulaError(f"{missing[0]} has no value")
        return _evaluate(self.tree, values)


def linear_names(formula: Formula, of: Iterable[str]) -> tuple[str, ...]:
    """Those of the names `of` in which the formula is linear, all of them together: a of a*tanh(x/w), not
    w."""
    found: list[str] = []
    for name in of:
        if _degree(formula.tree, frozenset([*found, name])) <= 1:
            found.append(name)
    return tuple(found)


def divisors(formula: Formula) -> frozenset[str]:
    """Names that something is divided by: they cannot pass through zero."""
    found: set[str] = set()
    _collect_divisors(formula.tree, found)
    return frozenset(found)


def _degree(tree: tuple, names: frozenset[str]) -> float:
    """Of the tree as a polynomial in the names; inf where it is none."""
    kind = tree[0]
    if kind in ("number", "name"):
        return float(kind == "name" and tree[1] in names)
    if kind == "call":
        return np.inf if _degree(tree[2], names) else 0.0
    left, right = _degree(tree[1], names), _degree(tree[2], names)
    if kind in "+-":
        return max(left, right)
    if kind == "*":
        return left + right
    return np.inf if right or (kind == "^" and left) else left


def _collect_divisors(tree: tuple, found: set[str]) -> None:
    if tree[0] == "/":
        names: dict[str, None] = {}
        _collect(tree[2], names)
        found.update(names)
    for part in tree[1:]:
        if isinstance(part, tuple):
            _collect_divisors(part, found)


def _tokens(text: str) -> list[tuple[str, str]]:
    if len(text) > LONGEST:
        raise FormulaError(f"{len(text)} characters; expected at most {LONGEST}")
    found, at = [], 0
    text = text.rstrip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise FormulaError(f"{text[at]!r} at character {at + 1}; expected a number, a name, an operator "
                               "or a bracket")
        number, name, operator = match.groups()
        kind = "number" if number else "name" if name else "operator"
        found.append((kind, number or name or operator))
        at = match.end()
    if not found:
        raise FormulaError("an empty formula; expected one such as a*(q_4 + q_6)^2")
    return found


def _is(tokens, at: int, texts: str) -> bool:
    return at < len(tokens) and tokens[at][0] == "operator" and tokens[at][1] in texts


def _sum(tokens, at: int, depth: int):
    return _chain(tokens, at, depth, "+-", _product)


def _product(tokens, at: int, depth: int):
    return _chain(tokens, at, depth, "*/", _power)


def _chain(tokens, at: int, depth: int, signs: str, part):
    """Parts with operators of one rank between them, from left to right."""
    left, at = part(tokens, at, depth)
    while _is(tokens, at, signs):
        right, after = part(tokens, at + 1, depth)
        left, at = (tokens[at][1], left, right), after
    return left, at


def _power(tokens, at: int, depth: int):
    if depth > DEEPEST:
        raise FormulaError(f"more than {DEEPEST} nested brackets, signs or powers")
    if _is(tokens, at, "+-"):
        inner, after = _power(tokens, at + 1, depth + 1)
        return (inner if tokens[at][1] == "+" else ("-", ("number", 0.0), inner)), after
    base, at = _atom(tokens, at, depth)
    if _is(tokens, at, "^"):
        exponent, at = _power(tokens, at + 1, depth + 1)
        return ("^", base, exponent), at
    return base, at


def _atom(tokens, at: int, depth: int):
    if at >= len(tokens):
        raise FormulaError("the formula ends where a number, a name or a bracket is expected")
    kind, text = tokens[at]
    if kind == "number":
        return ("number", float(text)), at + 1
    if kind == "name" and not _is(tokens, at + 1, "("):
        return ("name", text), at + 1
    if kind == "name" and text not in _FUNCTIONS:
        raise FormulaError(f"{text!r} is no function; expected one of {', '.join(_FUNCTIONS)}")
    start = at + 1 if kind == "name" else at
    if not _is(tokens, start, "("):
        raise FormulaError(f"{text!r} stands where a number, a name or a bracket is expected")
    inner, after = _sum(tokens, start + 1, depth + 1)
    if not _is(tokens, after, ")"):
        raise FormulaError("a bracket is not closed")
    return (("call", text, inner) if kind == "name" else inner), after + 1


def _collect(tree: tuple, names: dict) -> None:
    if tree[0] == "name":
        names[tree[1]] = None
    for part in tree[1:]:
        if isinstance(part, tuple):
            _collect(part, names)


def _evaluate(tree: tuple, values) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    kind = tree[0]
    if kind == "number":
        return np.asarray(tree[1]), {}
    if kind == "name":
        value = np.asarray(values[tree[1]], float)
        return value, {tree[1]: np.ones_like(value)}
    if kind == "call":
        inner, slopes = _evaluate(tree[2], values)
        function, derivative = _FUNCTIONS[tree[1]]
        slope = derivative(inner)
        return function(inner), {name: slope * by for name, by in slopes.items()}
    left, by_left = _evaluate(tree[1], values)
    right, by_right = _evaluate(tree[2], values)
    if kind in "+-":
        sign = 1.0 if kind == "+" else -1.0
        return left + sign * right, _linear(by_left, 1.0, by_right, sign)
    if kind == "*":
        return left * right, _linear(by_left, right, by_right, left)
    if kind == "/":
        return left / right, _linear(by_left, 1.0 / right, by_right, -left / right**2)
    value = left**right
    by_exponent = value * np.log(np.where(left > 0.0, left, 1.0)) if by_right else 0.0
    return value, _linear(by_left, right * left ** (right - 1.0), by_right, by_exponent)


def _linear(one: dict, factor, other: dict, weight) -> dict:
    """factor * one + weight * other, name by name."""
    return {name: factor * one.get(name, 0.0) + weight * other.get(name, 0.0) for name in {**one, **other}}
