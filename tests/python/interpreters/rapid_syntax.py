"""The grammar of ABB RAPID as far as programs of motions need it: text to statements, nested tuples.

    ("declare", where, name, value)   ("assign", where, path, value)   ("call", where, name, arguments)
    ("if", where, branches)  ("for", ...)  ("while", ...)  ("test", ...)  ("return", where, value)

Arguments are (option or None, expression or None). Names are in small letters: RAPID does not tell them
apart.
"""

from __future__ import annotations

import re

from .descent import Descent
from .motion import Unknown

TOKEN = re.compile(r"""(?P<blank>\s+|![^\r\n]*)|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
    |(?P<text>"(?:[^"]|"")*")|(?P<name>[A-Za-z_]\w*)|(?P<sign>:=|<>|<=|>=|[-+*/=<>(){}\[\],.;:\\?])""", re.X)
LEVELS = (("or", "xor"), ("and",), ("=", "<>", "<=", ">=", "<", ">"), ("+", "-"), ("*", "/", "div", "mod"))


class Reader(Descent):
    levels, folded = LEVELS, staticmethod(str.lower)

    def __init__(self, file: str, text: str):
        self.file, tokens = file, []
        at, line = 0, 1
        while at < len(text):
            match = TOKEN.match(text, at)
            if not match:
                raise Unknown(f"{file}:{line}: cannot read {text[at:at + 20]!r}")
            if match.lastgroup != "blank":
                tokens.append((match.lastgroup, match[0], line))
            line += match[0].count("\n")
            at = match.end()
        super().__init__(tokens)

    @property
    def line(self) -> str:
        return f"{self.file}:{self.tokens[min(self.place, len(self.tokens) - 1)][2]}"

    @property
    def where(self) -> str:
        return f"{self.line}: "

    def unary(self):
        if self.accept("not"):
            return ("not", self.unary())
        if self.accept("-"):
            return ("minus", self.unary())
        if self.accept("+"):
            return self.unary()
        kind, text, _ = self.tokens[self.place]
        if kind == "number":
            self.place += 1
            return ("value", float(text) if re.search(r"[.eE]", text) else int(text))
        if kind == "text":
            self.place += 1
            return ("value", text[1:-1])
        if self.accept("("):
            inner = self.expression()
            self.take(")")
            return inner
        if self.accept("["):
            items = []
            while not self.accept("]"):
                items.append(self.expression())
                self.accept(",")
            return ("list", items)
        if kind != "name":
            raise Unknown(f"{self.where}cannot read {text!r}")
        if self.ahead(1) == "(":
            name = self.take()
            self.take("(")
            return ("function", name, self.arguments(")"))
        return ("name", self.path())

    def path(self):
        steps = [self.take()]
        while self.ahead() in (".", "{"):
            if self.take() == ".":
                steps.append((".", self.take()))
            else:
                steps.append(("{", self.expression()))
                self.take("}")
        return steps

    def arguments(self, end: str):
        found = []
        while not self.accept(end):
            if self.accept(","):
                continue
            if self.accept("\\"):
                option = self.take()
                found.append((option, self.expression() if self.accept(":=") else None))
            else:
                found.append((None, self.expression()))
        return found

    # -- statements ----------------------------------------------------------------------------------
    def block(self, *ends: str):
        statements = []
        while self.ahead() not in ends:
            found = self.statement()
            if found is not None:
                statements.append(found)
        return statements

    def statement(self):
        where, word = self.line, self.ahead()
        if word in ("local", "task", "var", "pers", "const"):
            while self.accept("local", "task"):
                pass
            self.take(), self.take()
            name = self.take()
            if self.accept("{"):
                while not self.accept("}"):
                    self.take()
            value = self.expression() if self.accept(":=") else None
            self.take(";")
            return ("declare", where, name, value)
        if word in ("if", "for", "while", "test"):
            self.take()
            return getattr(self, f"read_{word}")(where)
        if word == "return":
            self.take()
            value = None if self.ahead() == ";" else self.expression()
            self.take(";")
            return ("return", where, value)
        if word == "goto" or self.ahead(1) == ":":
            raise Unknown(f"{where}: jumps are not followed")
        path = self.path()
        if self.accept(":="):
            value = self.expression()
            self.take(";")
            return ("assign", where, path, value)
        return ("call", where, path[0], self.arguments(";"))

    def read_if(self, where):
        condition = self.expression()
        if not self.accept("then"):
            return ("if", where, [(condition, [self.statement()])])
        branches = [(condition, self.block("elseif", "else", "endif"))]
        while self.accept("elseif"):
            condition = self.expression()
            self.take("then")
            branches.append((condition, self.block("elseif", "else", "endif")))
        if self.accept("else"):
            branches.append((None, self.block("endif")))
        self.take("endif")
        return ("if", where, branches)

    def read_for(self, where):
        name = self.take()
        self.take("from")
        first = self.expression()
        self.take("to")
        last = self.expression()
        step = self.expression() if self.accept("step") else None
        self.take("do")
        body = self.block("endfor")
        self.take()
        return ("for", where, name, first, last, step, body)

    def read_while(self, where):
        condition = self.expression()
        self.take("do")
        body = self.block("endwhile")
        self.take()
        return ("while", where, condition, body)

    def read_test(self, where):
        chosen, cases = self.expression(), []
        while not self.accept("endtest"):
            if self.accept("default"):
                values = None
            else:
                self.take("case")
                values = [self.expression()]
                while self.accept(","):
                    values.append(self.expression())
            self.take(":")
            cases.append((values, self.block("case", "default", "endtest")))
        return ("test", where, chosen, cases)


def modules(file: str, text: str):
    """(declarations, routines: name -> (parameters, statements)) of a file."""
    reader, data, routines = Reader(file, re.sub(r"(?m)^%%%[\s\S]*?%%%", "", text)), [], {}
    while reader.ahead():
        if reader.accept("module"):
            reader.take()
            if reader.accept("("):
                while not reader.accept(")"):
                    reader.take()
        elif reader.accept("endmodule"):
            continue
        elif reader.ahead() in ("proc", "func", "trap") or reader.ahead(1) in ("proc", "func"):
            reader.accept("local")
            kind = reader.take()
            if kind == "func":
                reader.take()
            name, parameters = reader.take(), []
            if reader.accept("("):
                while not reader.accept(")"):
                    while reader.ahead(1) not in (",", ")", "{"):
                        reader.take()
                    parameters.append(reader.take())
                    while reader.ahead() not in (",", ")"):
                        reader.take()
                    reader.accept(",")
            body = reader.block(f"end{kind}", "error")
            while reader.take() != f"end{kind}":
                pass
            routines[name] = (parameters, body)
        else:
            data.append(reader.statement())
    return data, routines
