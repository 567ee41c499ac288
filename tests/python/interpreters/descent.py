"""Recursive descent over tokens (kind, text, ...): what the grammars of KRL and RAPID share.

A language sets its tokens, its `levels` of left-associative operators from the loosest to the tightest,
`folded` (how it writes what it does not tell apart by case), and what lies below the operators, `unary`.
"""

from __future__ import annotations

from collections.abc import Callable

from .motion import Unknown


class Descent:
    levels: tuple[tuple[str, ...], ...]
    folded: Callable[[str], str]

    def __init__(self, tokens: list[tuple]):
        self.tokens, self.place = tokens, 0

    @property
    def where(self) -> str:
        """Before a message."""
        return ""

    def ahead(self, more: int = 0) -> str:
        at = self.place + more
        return self.folded(self.tokens[at][1]) if at < len(self.tokens) else ""

    def take(self, wanted: str = "") -> str:
        if wanted and self.ahead() != wanted:
            raise Unknown(f"{self.where}expected {wanted}, found {self.ahead()!r}")
        self.place += 1
        return self.folded(self.tokens[self.place - 1][1])

    def accept(self, *wanted: str) -> bool:
        found = self.ahead() in wanted
        self.place += found
        return found

    def expression(self, level: int = 0):
        if level == len(self.levels):
            return self.unary()
        left = self.expression(level + 1)
        while self.ahead() in self.levels[level]:
            left = (self.take(), left, self.expression(level + 1))
        return left

    def unary(self):
        raise NotImplementedError
