"""Expressions and lines of KRL (KUKA System Software, programming manuals): tokens, aggregates, operators.

An expression becomes nested tuples: ("number", v), ("name", path), ("aggregate", {..}), ("call", name, args),
(operator, left, right). Operators from the tightest: unary sign and NOT, the geometric `:`, * /, + -,
comparisons, AND, EXOR, OR.
"""

from __future__ import annotations

import re

from .descent import Descent
from .motion import Unknown

TOKEN = re.compile(r"""\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
    |(?P<bits>'[BbHh]\s*[0-9A-Fa-f]+')|(?P<text>"[^"]*")|(?P<name>\#?[$A-Za-z_][\w$]*)
    |(?P<sign>==|<>|<=|>=|[-+*/:=<>(){}\[\],.]))""", re.X)
LEVELS = (("OR",), ("EXOR",), ("AND",), ("==", "<>", "<=", ">=", "<", ">"), ("+", "-"), ("*", "/"), (":",))


def without_comment(line: str) -> str:
    return re.match(r'(?:[^;"]|"[^"]*"?)*', line).group().strip()


def tokens(text: str) -> list[tuple[str, str]]:
    found, place = [], 0
    while text[place:].strip():
        match = TOKEN.match(text, place)
        if not match:
            raise Unknown(f"cannot read {text[place:]!r}")
        found.append((match.lastgroup, match[match.lastgroup]))
        place = match.end()
    return found


class Reader(Descent):
    """Of one line, in capital letters: KRL does not tell them apart."""

    levels, folded = LEVELS, staticmethod(str.upper)

    def __init__(self, text: str):
        super().__init__(tokens(text))

    def unary(self):
        if self.ahead() in ("-", "+", "NOT"):
            return ("unary", self.take(), self.unary())
        return self.primary()

    def primary(self):
        kind, text = self.tokens[self.place] if self.place < len(self.tokens) else ("", "")
        self.place += 1
        if kind == "number":
            return ("number", float(text) if re.search(r"[.eE]", text) else int(text))
        if kind == "bits":
            return ("number", int(text[2:-1].strip(), 2 if text[1] in "Bb" else 16))
        if kind == "text":
            return ("text", text[1:-1])
        if text == "(":
            inner = self.expression()
            self.take(")")
            return inner
        if text == "{":
            return self.aggregate()
        if kind == "name" and text.startswith("#"):
            return ("enum", text.upper())
        if kind == "name" and text.upper() in ("TRUE", "FALSE"):
            return ("number", text.upper() == "TRUE")
        if kind == "name":
            self.place -= 1
            return self.path_or_call()
        raise Unknown(f"cannot read an expression at {text!r}")

    def aggregate(self):
        if self.ahead(1) == ":":  # {FRAME: X 1, ...}
            self.take(), self.take()
        fields = {}
        while not self.accept("}"):
            name = self.take()
            if self.accept("["):
                name += f"[{'' if self.ahead() == ']' else self.take()}]"
                self.take("]")
            fields[name] = self.expression()
            self.accept(",")
        return ("aggregate", fields)

    def path_or_call(self):
        name = self.take()
        if self.accept("("):
            arguments = []
            while not self.accept(")"):
                arguments.append(self.expression())
                self.accept(",")
            return ("call", name, arguments)
        return ("name", self.path(name))

    def path(self, name: str):
        """A variable with its elements and components: [name, ("[", expression), (".", component), ...]."""
        steps = [name]
        while self.ahead() in ("[", "."):
            if self.take() == ".":
                steps.append((".", self.take()))
            else:
                steps.append(("[", None if self.ahead() == "]" else self.expression()))
                self.take("]")
        return steps
