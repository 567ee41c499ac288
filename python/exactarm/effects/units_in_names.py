"""Units at the end of parameters' names, as reports and messages write them."""

from __future__ import annotations


def unit_of(name: str) -> str:
    """The unit at the end of a parameter's name, as the report writes it: `growth_1_per_h` is in 1/h."""
    head, per, below = name.rpartition("_per_")
    if per and below in _BELOW:
        return f"{unit_of(head) or '1'}/{_BELOW[below]}"
    for ending, unit in _UNITS.items():
        if ("_" + name).endswith(ending):
            return unit
    return ""


def words_of(name: str) -> str:
    """`x_rad_s` -> x, `width_rad` -> width, `my_2_kg_m` -> my 2: the unit stands beside the number."""
    head, per, _ = name.partition("_per_")
    head = head.removesuffix("_1") if per else head
    ending = next((ending for ending in _UNITS if ("_" + head).endswith(ending)), "")
    return ("_" + head).removesuffix(ending).strip("_").replace("_", " ")


_BELOW = {"Nm": "Nm", "Nm3": "Nm³", "N": "N", "N3": "N³", "rad": "rad", "m": "m", "g": "g", "h": "h",
          "row": "row", "degC": "°C"}
_UNITS = {
    "_rad_s": "rad/s", "_Nm_s": "Nm s", "_Nm_sqrt_s": "Nm √s", "_kg_m2": "kg m²", "_kg_m": "kg m",
    "_N_s": "N s", "_m_s2": "m/s²", "_m_s": "m/s", "_N": "N",
    "_rad": "rad", "_Nm": "Nm", "_kg": "kg", "_m": "m", "_s": "s",
}
