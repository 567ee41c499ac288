"""Numbers as a person reads them: 0.382 mm, 1.20 ± 0.05 mrad.

A column of one unit shares one prefix, so that its numbers can be compared at a glance. A number with
an interval has the digits that the interval allows (two of the half-width); a number without has three.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from exactarm.report.sections import Cell, Estimate, Link, Quantity

DASH = "–"
SIGNIFICANT_DIGITS, INTERVAL_DIGITS, EXACT_DIGITS = 3, 2, 6
MOST_DECIMALS = 6
_LOPSIDED = 0.05  # of the half-width: what two digits of it show
_COMPARED = 1e-3  # of the largest of a sentence: below, its prefix would put three zeros before the digits
_UNCHANGED = 0.005  # share of an error below which two of them read alike: half a step of the third digit

# SI unit -> (unit to show, its size in SI), from large to small.
SCALES: dict[str, tuple[tuple[str, float], ...]] = {
    "m": (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)),
    "rad": (("rad", 1.0), ("mrad", 1e-3), ("µrad", 1e-6)),
    "rad/s": (("rad/s", 1.0), ("mrad/s", 1e-3), ("µrad/s", 1e-6)),
    "s": (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)),
    "Nm": (("Nm", 1.0),),
    "Nm/rad": (("MNm/rad", 1e6), ("kNm/rad", 1e3), ("Nm/rad", 1.0)),
    "rad/Nm": (("mrad/Nm", 1e-3), ("µrad/Nm", 1e-6), ("nrad/Nm", 1e-9)),
    "m/N": (("mm/N", 1e-3), ("µm/N", 1e-6), ("nm/N", 1e-9)),
    "Hz": (("kHz", 1e3), ("Hz", 1.0)),
}
# From which size a unit is used, in itself: 0.4 mm stays mm, but so does 2500 mm; and angles are rad only
# when large.
LEAST = {"m": 10.0, "mm": 0.1, "µm": 0.1, "rad": 0.1, "mrad": 0.1, "rad/s": 0.1, "mrad/s": 0.1, "s": 0.1,
         "rad/s²": 0.1}


@dataclass(frozen=True)
class Scale:
    """The unit to show and its size in SI units."""

    unit: str
    size: float


def _scales(unit: str) -> tuple[tuple[str, float], ...]:
    """Those of the unit, or of what stands above the stroke: m/h is shown as m/h, mm/h, ..."""
    above, stroke, below = unit.partition("/")
    if unit in SCALES or not stroke:
        return SCALES.get(unit, ((unit, 1.0),))
    return tuple((f"{shown}/{below}", size) for shown, size in SCALES.get(above, ((above, 1.0),)))


def choose_scale(values: Sequence[float], unit: str) -> Scale:
    """The prefix that suits the largest of `values`."""
    finite = [abs(value) for value in values if value is not None and math.isfinite(value)]
    largest = max(finite, default=0.0)
    scales = _scales(unit)
    if largest == 0.0:
        return Scale(*scales[min(1, len(scales) - 1)])
    for shown, size in scales[:-1]:
        if largest >= size * LEAST.get(shown, 1.0):
            return Scale(shown, size)
    return Scale(*scales[-1])


def decimals_for(value: float, digits: int = SIGNIFICANT_DIGITS) -> int:
    """Decimals that show `digits` significant digits of `value`, as it is rounded: 0.0996 is 0.10."""
    if value == 0.0 or not math.isfinite(value):
        return 0
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])
    return min(max(digits - 1 - exponent, 0), MOST_DECIMALS)


def fixed(value: float, decimals: int) -> str:
    """The number with so many decimals, a true minus sign, and no negative zero."""
    text = f"{value:.{decimals}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", "−")


def number(value: float | None, digits: int = SIGNIFICANT_DIGITS) -> str:
    """A bare number; very large and very small ones as powers of ten."""
    if value is None or not math.isfinite(value):
        return DASH
    if value != 0.0 and not 1e-4 <= abs(value) < 1e7:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}".replace("-", "−")
    return fixed(value, decimals_for(value, digits))


def quantity(value: float | None, unit: str = "") -> str:
    """A number with its unit, for sentences: quantity(0.000382, "m") is "0.382 mm"."""
    return format_cells([Quantity(value, unit)])[0]


def with_prefixes(words: str) -> str:
    """A sentence with its angles as a reader takes them: "1.32e-05 rad" is "13.2 µrad". Numbers that share
    one unit stay as they are."""
    angle = r"(?<![\w.-])(?<!\d, )(?<!\d and )(-?\d[\d.]*(?:e-?\d+)?) rad\b(?!/)"
    return re.sub(angle, lambda found: quantity(float(found[1]), "rad"), words)


def quantities(values: Sequence[float | None], unit: str = "") -> list[str]:
    """Numbers that one sentence compares, with the prefix of the largest: "0.176 mm" and "0.0784 mm". One
    that is smaller by more than `_COMPARED` has its own."""
    cells = [Quantity(value, unit) for value in values]
    return [format_cells([cell], beside=read_beside(cell, cells))[0] for cell in cells]


def change(before: float, after: float, unit: str = "") -> str:
    """What an error did, for sentences: "falls from 1.93 mm to 0.378 mm", "rises ...", "stays at ..."."""
    if not abs(after - before) > _UNCHANGED * before:
        return f"stays at {quantity(after, unit)}"
    was, now = quantities([before, after], unit)
    return f"{'falls' if after < before else 'rises'} from {was} to {now}"


def estimate(value: float | None, low: float | None, high: float | None, unit: str = "") -> str:
    """A number with its interval and unit, for sentences."""
    return format_cells([Estimate(value, low, high, unit)])[0]


def common_unit(cells: Sequence[Cell], beside: Sequence[Cell] = ()) -> str | None:
    """The unit to show in the header of a column: where all its numbers share one; else None. beside: as in
    `format_cells`."""
    units = {cell.unit for cell in cells if isinstance(cell, (Quantity, Estimate))}
    if len(units) != 1 or any(isinstance(cell, int) for cell in cells):
        return None
    (unit,) = units
    return _scale_of([*cells, *beside], unit).unit or None


def format_cells(cells: Sequence[Cell], with_unit: bool = True, beside: Sequence[Cell] = ()) -> list[str]:
    """The cells of one column as text; `with_unit` = False where the header has the unit. beside: of columns
    to compare with, which have the same prefix.

    Numbers of one unit share prefix and decimals. A column of several units is read row by row: numbers of
    one unit share their prefix as in a sentence (`_COMPARED`), and each has its own decimals.
    """
    units = {cell.unit for cell in cells if isinstance(cell, (Quantity, Estimate))}
    if len(units) > 1:
        return [text for cell in cells for text in format_cells([cell], with_unit, read_beside(cell, cells))]
    scale = _scale_of([*cells, *beside], units.pop() if units else "")
    decimals = _common_decimals(cells, scale)
    texts = []
    for cell in cells:
        if not isinstance(cell, (Quantity, Estimate)):
            texts.append(DASH if cell is None else cell.target if isinstance(cell, Link) else str(cell))
            continue
        text = _format(cell, scale, decimals)
        texts.append(f"{text} {scale.unit}" if with_unit and scale.unit and text != DASH else text)
    return texts


def read_beside(cell: Cell, cells: Sequence[Cell]) -> list[Cell]:
    """The largest number of the cell's unit among `cells`, where the cell is not far below it."""
    if not isinstance(cell, (Quantity, Estimate)) or not cell.value or not math.isfinite(cell.value):
        return []
    alike = [other for other in cells if isinstance(other, (Quantity, Estimate)) and other.unit == cell.unit
             and other.value is not None and math.isfinite(other.value)]
    largest = max(alike, key=lambda other: abs(other.value))
    return [largest] if abs(cell.value) >= _COMPARED * abs(largest.value) else []


def _scale_of(cells: Sequence[Cell], unit: str) -> Scale:
    numbers = [cell for cell in cells if isinstance(cell, (Quantity, Estimate))]
    halves = [_half_width(cell) for cell in numbers if isinstance(cell, Estimate)]
    return choose_scale([cell.value for cell in numbers] + halves, unit)


def _common_decimals(cells: Sequence[Cell], scale: Scale) -> int | None:
    """Decimals shared by the plain quantities of a column; None: each number has its own."""
    values = [abs(cell.value) / scale.size for cell in cells
              if isinstance(cell, Quantity) and not cell.exact and cell.value and math.isfinite(cell.value)]
    if not values or min(values) < 1e-4 or max(values) >= 1e7:
        return None
    return min(decimals_for(min(values)), decimals_for(max(values)) + 1)


def _format(cell: Quantity | Estimate, scale: Scale, decimals: int | None) -> str:
    if cell.value is None or not math.isfinite(cell.value):
        return DASH
    value = cell.value / scale.size
    if isinstance(cell, Estimate):
        half = _half_width(cell)
        if half is None:
            return number(value)
        half /= scale.size
        places = decimals_for(half, INTERVAL_DIGITS)
        if half < 10.0**-MOST_DECIMALS or half >= 1e7 or abs(value) >= 1e7:
            return f"{number(value)} ± {number(half, INTERVAL_DIGITS)}"
        low, high = cell.low / scale.size, cell.high / scale.size
        if abs(value - 0.5 * (low + high)) > _LOPSIDED * half:
            return f"{fixed(value, places)} ({fixed(low, places)} to {fixed(high, places)})"
        return f"{fixed(value, places)} ± {fixed(half, places)}"
    if cell.decimals is not None:
        return fixed(value, cell.decimals)
    if cell.exact:
        return f"{value + 0.0:.{EXACT_DIGITS}g}".replace("-", "−")
    return number(value) if decimals is None else fixed(value, decimals)


def interval_decimals(half_widths: Sequence[float]) -> int:
    """Decimals that a column needs for its narrowest interval."""
    finite = [half for half in half_widths if math.isfinite(half) and half > 0.0]
    return decimals_for(min(finite), INTERVAL_DIGITS) if finite else SIGNIFICANT_DIGITS


def _half_width(cell: Estimate) -> float | None:
    if cell.low is None or cell.high is None or not math.isfinite(cell.low) or not math.isfinite(cell.high):
        return None
    half = (cell.high - cell.low) / 2.0
    return half if half > 0.0 else None
