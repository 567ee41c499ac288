"""Dictionary: short formulas that a draft is made of, and series where none of them fits.

Of one signal s (c a place, w a width, both searched):

    a*s   a*s^2   a*s^3   a*s + b*s^2   a*step(s - number)
    a*abs(s - c)   a*tanh((s - c)/w)   a*exp(-((s - c)/w)^2)   a*exp(s/w)   a*exp(-s/w)
    a*sin(k*s) + b*cos(k*s), k = 1 ... 6 (angles)

of two, s and t:

    a*s*t   a*s^2*t   a*s*t^2   a*sin(s)*sin(t)   a*cos(s)*cos(t)   a*sin(s)*cos(t)   a*cos(s)*sin(t)
    a*u^2   a*abs(u)   with u = s + t or s - t
    a*sin(k*s + n*t) + b*cos(k*s + n*t), k = 1, 2, n = -2, -1, 1, 2 (angles)

and series of cosines over the range of one signal, or products of them over two, whose sizes fall as those
of a Gaussian process do (unknown.py). Every coefficient has the same plausible size at the joint, whatever
its signal's unit: `AMPLITUDE` over the standard deviation of what it multiplies.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from exactarm.diagnose.unknown import AMPLITUDE, LENGTHS, sizes_of
from exactarm.effects.expression import Expression
from exactarm.numerics.formula import LONGEST, Formula, linear_names

_HARMONICS, _HARMONICS_OF_TWO = range(1, 7), (1, 2)  # the latter: of the waves of two (unknown.py)
# quantiles of the signal at which a kink or step is tried
_PLACES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
# of half the signal's range; between two of them a curve moves by a few per cent
_WIDTHS = (0.1, 0.16, 0.25, 0.4, 0.63, 1.0, 1.6)
# of a place that is worn: nearer to each other than its width, and narrow
_SPOTS, _SPOT_WIDTHS = tuple(np.linspace(0.04, 0.96, 24)), (0.063, 0.1, 0.16, 0.25, 0.4)
_TERMS, _TERMS_OF_TWO = 8, 3  # of a series: half a wave is then an eighth of the range
_SERIES_LENGTH = LENGTHS[1]
_SERIES = "series"  # heading of what is no short formula


def forms_of(joint: int, signals: dict[str, np.ndarray], term: int = 0) -> list[Expression]:
    """Every formula of the dictionary in `signals` (name -> (N,)); term: number behind its parameters'
    names."""
    found: list[Expression] = []
    for name, values in signals.items():
        found += _of_one(joint, name, values, term)
    for (s, x), (t, y) in combinations(signals.items(), 2):
        found += _of_two(joint, s, x, t, y, term)
    return [form for form in found if len(form.form) <= LONGEST]


def is_series(effect: Expression) -> bool:
    return effect.heading == _SERIES


def sum_of(one: Expression, other: Expression) -> Expression:
    """The two formulas added up; their parameters have different names."""
    return replace(one, form=f"{one.form} + {other.form}", of=tuple(dict.fromkeys((*one.of, *other.of))),
                   names=one.names + other.names, values=one.values + other.values,
                   plausible=one.plausible + other.plausible, searched=one.searched + other.searched)


def _of_one(joint: int, name: str, values: np.ndarray, term: int) -> list[Expression]:
    low, high = float(values.min()), float(values.max())
    half = max(0.5 * (high - low), 1e-12)
    s = _centred(name, low, high)
    places = tuple(dict.fromkeys(_short(v) for v in np.quantile(values, _PLACES)))
    spots = tuple(dict.fromkeys(_short(v) for v in np.quantile(values, _SPOTS)))
    widths, narrow = (tuple(_short(half * w) for w in each) for each in (_WIDTHS, _SPOT_WIDTHS))
    texts = [f"a*{s}", f"a*{s}^2", f"a*{s}^3", f"a*{s} + b*{s}^2"]
    texts += [f"a*step({_less(name, place)})" for place in places]
    if name.startswith("q_"):
        texts += [f"a*sin({_times(k, name)}) + b*cos({_times(k, name)})" for k in _HARMONICS]
    made = [_expression(joint, text, {name: values}, {}, term) for text in texts]
    for text, grids in ((f"a*abs({name} - c)", {"c": places}),
                        (f"a*tanh(({name} - c)/w)", {"c": places, "w": widths}),
                        (f"a*exp(-(({name} - c)/w)^2)", {"c": spots, "w": narrow}),
                        (f"a*exp({s}/w)", {"w": widths[2:]}), (f"a*exp(-{s}/w)", {"w": widths[2:]})):
        made.append(_expression(joint, text, {name: values}, grids, term))
    return [effect for effect in made if effect is not None] + [_series(joint, {name: values}, term)]


def _of_two(joint: int, s: str, x: np.ndarray, t: str, y: np.ndarray, term: int) -> list[Expression]:
    both = {s: x, t: y}
    u, v = (_centred(name, float(values.min()), float(values.max())) for name, values in both.items())
    texts = [f"a*{u}*{v}", f"a*{u}^2*{v}", f"a*{u}*{v}^2"]
    if s.startswith("q_") and t.startswith("q_"):
        texts += [f"a*{f}({s})*{g}({t})" for f in ("sin", "cos") for g in ("sin", "cos")]
        for w in (f"({s} + {t})", f"({s} - {t})"):
            texts += [f"a*{w}^2", f"a*abs{w}"]
        for k, n, sign in product(_HARMONICS_OF_TWO, _HARMONICS_OF_TWO, "+-"):
            w = f"({_times(k, s)} {sign} {_times(n, t)})"
            texts.append(f"a*sin{w} + b*cos{w}")
    made = [_expression(joint, text, both, {}, term) for text in texts]
    return [effect for effect in made if effect is not None] + [_series(joint, both, term)]


def _expression(joint, text: str, signals: dict, grids: dict, term: int) -> Expression | None:
    """The formula at zero size with the plausible sizes of its coefficients; None where the signals never
    move it."""
    if len(text) > LONGEST:
        return None  # names of signals that no formula can hold
    start = {name: grid[len(grid) // 2] for name, grid in grids.items()}
    formula = Formula.of(text)
    names = tuple(name for name in formula.names if name not in signals)
    linear = linear_names(formula, names)
    rows = len(next(iter(signals.values())))
    numbers = {name: np.full(rows, start.get(name, 1.0)) for name in names}
    with np.errstate(all="ignore"):
        slopes = formula({**signals, **numbers})[1]
    plausible = []
    for name in names:
        spread = float(np.std(slopes[name])) if name in linear else 0.0
        if name in linear and not (np.isfinite(spread) and spread > 0.0):
            return None
        plausible.append(AMPLITUDE / spread if name in linear else abs(start[name]) or 1.0)
    effect = Expression(joint, tuple(start.get(name, 0.0) for name in names), form=text, of=tuple(signals),
                        names=names, plausible=tuple(plausible), searched=tuple(grids.items()))
    return _numbered(effect, term) if term else effect


def _series(joint: int, signals: dict[str, np.ndarray], term: int) -> Expression:
    """Cosines of half waves over the range of the signals; products where there are two, fewer where their
    names are too long for a formula."""
    if len(signals) == 1:
        return _series_of(joint, signals, term, _TERMS)
    series = _series_of(joint, signals, term, _TERMS_OF_TWO)
    return series if len(series.form) <= LONGEST else _series_of(joint, signals, term, _TERMS_OF_TWO - 1)


def _series_of(joint: int, signals: dict[str, np.ndarray], term: int, count: int) -> Expression:
    factors = []
    for name, values in signals.items():
        low, high = float(values.min()), float(values.max())
        wave = np.pi / max(high - low, 1e-12)
        factors.append([f"cos({_short(k * wave)}*({_less(name, _short(low))}))" for k in range(1, count + 1)])
    size = AMPLITUDE * sizes_of(_SERIES_LENGTH, count)
    if len(factors) == 1:
        terms = list(zip(factors[0], size))
    else:
        terms = [(f"{f}*{g}", a * b) for f, a in zip(factors[0], size)
                 for g, b in zip(factors[1], size / AMPLITUDE)]
        terms += [(f, a) for part in factors for f, a in zip(part, size)]
    names = tuple(f"a{term or ''}_{k}" for k in range(1, len(terms) + 1))
    form = " + ".join(f"{name}*{text}" for name, (text, _) in zip(names, terms))
    return Expression(joint, (0.0,) * len(names), form=form, of=tuple(signals), names=names,
                      plausible=tuple(float(each) for _, each in terms), heading=_SERIES)


def _numbered(effect: Expression, term: int) -> Expression:
    """With the number of the term behind every parameter: a2, w2."""
    numbered = {name: f"{name}{term}" for name in effect.names}
    names = tuple(numbered.values())
    form = re.sub(r"[A-Za-z_]\w*", lambda match: numbered.get(match[0], match[0]), effect.form)
    return replace(effect, form=form, names=names,
                   searched=tuple((numbered[name], grid) for name, grid in effect.searched))


def _centred(name: str, low: float, high: float) -> str:
    """Angles from zero, other signals from the middle of their range: squares far from zero are nearly
    straight."""
    middle = _short(0.5 * (low + high))
    return name if name.startswith("q_") or middle == 0.0 else f"({_less(name, middle)})"


def _less(name: str, number: float) -> str:
    return f"{name} - {number:g}" if number >= 0.0 else f"{name} + {-number:g}"


def _times(k: int, name: str) -> str:
    return name if k == 1 else f"{k}*{name}"


def _short(value: float) -> float:
    """Three digits: what a reader takes in."""
    return float(f"{value:.3g}")
