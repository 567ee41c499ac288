"""What a command hands back, on the command line and in Python alike: a value that speaks.

    result = exactarm.calibrate("ur10", "poses.csv")
    print(result)              the verdict in ten lines
    result.summary()           the whole text, as on a terminal
    result["after"]["validation"]["mean"]    any key of result.json
    result.parameters          estimates with their 95 % intervals, a pandas table
    result.to_dataframe()      residuals, poses or trajectory as a pandas table
    result.plot(axes)          matplotlib axes in, axes out
    result.save("folder")      report.html, result.json, robot.toml, tables, plots
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from exactarm.commands.outcome import Asked, Column, Outcome
from exactarm.commands.plain import plain
from exactarm.commands.publish import save
from exactarm.errors import InputError
from exactarm.identify.statistics import ErrorSummary
from exactarm.report.numbers import change, quantity
from exactarm.report.sections import Figure, Warnings

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

WORSE = 1.05  # RMS of held-out rows, after over before: chance moves it by less
PRINTED_LINES = 10
PRINTED_WIDTH = 100


class _Shown(str):
    """Text that a prompt and a notebook show as lines, not quoted."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


@dataclass(frozen=True, eq=False)
class CommandResult(Outcome):
    """All results of one command."""

    # -- what it says -------------------------------------------------------------------------------
    @property
    def verdict(self) -> str:
        """The verdict in a sentence."""
        return self.report.verdict

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.report.warnings

    def __getitem__(self, key: str) -> Any:
        """A key of result.json."""
        if key not in self.json:
            raise KeyError(f"{key!r}: a result of {self.command} has {', '.join(self.json)}")
        return plain(self.json[key])

    def __iter__(self) -> Iterator[str]:
        return iter(self.json)

    def __contains__(self, key: str) -> bool:
        return key in self.json

    def keys(self) -> tuple[str, ...]:
        """The keys of result.json that this command writes."""
        return tuple(self.json)

    @property
    def before(self) -> dict[str, ErrorSummary]:
        """Errors of the declared model on "identification" and "validation" rows, SI units."""
        return self._errors("before")

    @property
    def after(self) -> dict[str, ErrorSummary]:
        """Errors of the new model on "identification" and "validation" rows, SI units."""
        return self._errors("after")

    def _errors(self, when: str) -> dict[str, ErrorSummary]:
        sets = self.json.get(when)
        if not isinstance(sets, Mapping):
            raise AttributeError(f"a result of {self.command} has no errors {when}; its keys are "
                                 f"{', '.join(self.json)}")
        names = ErrorSummary.__dataclass_fields__
        nan = float("nan")
        return {
            name: ErrorSummary(**{  # type: ignore[arg-type]
                key: nan if s[key] is None else s[key] for key in names
            })
            for name, s in plain(sets).items()
        }

    @property
    def command(self) -> str:
        return self.asked.command if self.asked else "computed"

    def __str__(self) -> str:
        from exactarm.report.terminal import render_verdict

        return render_verdict(self.report, PRINTED_LINES, PRINTED_WIDTH)

    def __repr__(self) -> str:
        return f"<{self.report.title}: {self.report.verdict}>"

    def _repr_html_(self) -> str:
        from exactarm.report.html import render_verdict_html

        return render_verdict_html(self.report)

    def summary(self) -> str:
        """The whole report as text, without its figures; at a prompt it shows as it is."""
        from exactarm.report.terminal import render_text

        return _Shown(render_text(self.report))

    @property
    def parameters(self) -> pandas.DataFrame:
        """Estimates in SI units: a row a parameter, columns value, low and high (95 %)."""
        import pandas

        estimates = {name: value for name, value in plain(_estimates(self.json)).items()
                     if isinstance(value, Mapping) and "ci95" in value}
        if not estimates and self.command != "diagnose":
            raise AttributeError(f"a result of {self.command} has no estimated parameters; its keys are "
                                 f"{', '.join(self.json)}")
        rows = [(value["value"], *(value["ci95"] or (None, None))) for value in estimates.values()]
        return pandas.DataFrame(rows, index=list(estimates), columns=["value", "low", "high"], dtype=float)

    # -- tables and figures ---------------------------------------------------------------------------
    def to_dataframe(self, name: str | None = None) -> pandas.DataFrame:
        """A table by its file name ("residuals.csv" or "residuals"); the first one without a name."""
        import pandas

        if not self.tables:
            raise InputError(f"a result of {self.command} holds no table")
        named = {Path(file).stem: file for file in self.tables} | {file: file for file in self.tables}
        if name is not None and name not in named:
            raise InputError(f"no table {name!r}; expected one of {', '.join(self.tables)}")
        return pandas.DataFrame(dict(self.tables[named[name] if name else next(iter(self.tables))]))

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures that `plot` draws."""
        return tuple(figure.name for figure in self.report.figures)

    def plot(self, ax: Axes | None = None, what: str | None = None) -> Axes | list[Axes]:
        """Draws the figure `what` (default: the first); returns its axes.

        ax: where to draw. Of a figure of several panels it takes the most telling one: of a robot's axes the
        one with the largest residual or rate, of before and after the latter, of two views that from above.
        Without `what` it takes the first figure of one panel, if there is one. Without `ax` a figure of
        pyplot is made.
        """
        from exactarm.report.plots.interactive import draw_figure

        return draw_figure(self._figure(ax, what), ax)

    def _figure(self, ax: Axes | None, what: str | None) -> Figure:
        if isinstance(ax, str):
            raise InputError(f"ax={ax!r}; expected matplotlib axes; a figure is named by what={ax!r}")
        if ax is not None and not hasattr(ax, "plot"):
            raise InputError(f"ax is of the type {type(ax).__name__}; expected matplotlib axes")
        drawn = {figure.name: figure for figure in self.report.figures}
        if not drawn:
            raise InputError(f"a result of {self.command} holds no figure")
        if what is None:
            figures = list(drawn.values())
            return next((each for each in figures if ax is not None and each.panel is not None), figures[0])
        if what not in drawn:
            raise InputError(f"no figure {what!r}; expected one of {', '.join(drawn)}")
        return drawn[what]

    def save(self, folder: str | Path) -> Path:
        """Writes everything into `folder` as the command line does; returns the path of the report."""
        return save(self, folder)

    def warned(self, found: Sequence[str]) -> CommandResult:
        """The same with more warnings, before its own: in result.json, in the report, and in its colour; and
        with one more where the new model errs more on held-out rows than the declared one."""
        said = self.json.get("warnings", ())
        worse = _worse(self.json, self.tables.get("residuals.csv", {}))
        found = [*found, *(line for line in worse if line not in said)]
        if not found:
            return self
        report, json = self.report, dict(self.json)
        json["warnings"] = [*found, *json.get("warnings", ())]
        tone = "caution" if report.tone == "good" else report.tone
        report = replace(report, sections=(Warnings(tuple(found)), *report.sections), tone=tone)
        return replace(self, report=report, json=json)

    # -- as a value -------------------------------------------------------------------------------------
    def asked_as(self, asked: Asked) -> CommandResult:
        return replace(self, asked=asked)

    def __eq__(self, other: object) -> bool:
        """Equal results: the same numbers, tables and robot, whenever and however they were computed."""
        if not isinstance(other, CommandResult):
            return NotImplemented
        return (self._numbers() == other._numbers() and self.robot == other.robot
                and self.tables.keys() == other.tables.keys()
                and all(_same_table(self.tables[name], other.tables[name]) for name in self.tables))

    def __hash__(self) -> int:
        return hash((self._numbers(), self.robot))

    def _numbers(self) -> str:
        return json.dumps(plain(self.json), sort_keys=True)


def _estimates(result: Mapping[str, Any]) -> dict[str, Any]:
    """Name -> estimate: parameters of a fit, of the effects of a diagnosis, of gears."""
    found = dict(result.get("parameters") or {})
    for each in result.get("effects") or ():
        if isinstance(each, Mapping) and isinstance(each.get("parameters"), Mapping):
            place = "" if each["joint"] is None else f"_{each['joint']}"
            found |= {f"{each['effect']}{place}.{name}": value for name, value in each["parameters"].items()}
    for gear in result.get("gears") or ():
        name = f"gear_{gear['joint']}_{gear['direction']}"
        found[f"{name}.ratio"] = gear["ratio"]
        found |= {f"{name}.{key}_{k}": wave[key] for k, wave in enumerate(gear["harmonics"], start=1)
                  for key in ("order", "a", "b")}
    return found


def _worse(result: Mapping[str, Any], residuals: Mapping[str, Column]) -> list[str]:
    """Whether a result is worse than what it began with: no estimate is to be used then, whatever it
    converged to. And the row that makes it so, where one alone does."""
    sets = [plain(result.get(when)) for when in ("before", "after")]
    if not all(isinstance(each, Mapping) and isinstance(each.get("validation"), Mapping) for each in sets):
        return []
    before, after = (each["validation"].get("rms") for each in sets)
    if before is None or after is None or after <= WORSE * before:
        return []
    return [f"on rows that were never fitted the RMS error {change(before, after, result.get('unit', ''))}: "
            "the new model is worse than the declared one, do not use it before the data are checked"
            + _one_row(residuals)]


def _one_row(residuals: Mapping[str, Column]) -> str:
    """The row without which a model that errs more would err less, as an end of a sentence; else nothing."""
    if not {"file", "row", "set", "error_before_m", "error_after_m"} <= residuals.keys():
        return ""
    held_out = np.flatnonzero(np.asarray(residuals["set"]) == "validation")
    before, after = (np.asarray(residuals[f"error_{when}_m"])[held_out] for when in ("before", "after"))
    if len(held_out) < 2:
        return ""
    worst = int(np.argmax(after))
    was, now = (float(np.sqrt(np.mean(np.delete(each, worst) ** 2))) for each in (before, after))
    if not now < was:
        return ""
    place, row = held_out[worst], residuals["row"]
    return (f"; row {row[place]} of {Path(str(residuals['file'][place])).name} makes it so, by "
            f"{quantity(float(after[worst]), 'm')}: without it the error {change(was, now, 'm')}")


def _same_table(one: Mapping[str, Column], other: Mapping[str, Column]) -> bool:
    if list(one) != list(other):
        return False
    pairs = ((np.asarray(one[name]), np.asarray(other[name])) for name in one)
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f" == b.dtype.kind) for a, b in pairs)


def estimate(value: float, low: float, high: float) -> dict[str, Any]:
    """An estimated number with its 95 % interval."""
    return {"value": value, "ci95": [low, high]}
Result = CommandResult  # its name in the package
