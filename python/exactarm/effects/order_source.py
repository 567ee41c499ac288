"""What usually turns at an order: the likely source of an angle error that repeats so many times per output
revolution.

A guess for a reader, from the gear ratio alone, not a finding: the orders of motor and output are certain,
names of parts are what gearboxes of robots have there (wave generator of a strain-wave gear, input shaft of a
cycloidal one).
"""

_OUTPUT_ORDERS = 10.0  # below it a part on the output side, with few waves a turn, is likely
_NEAR = 0.02  # of a motor revolution


def likely_source(order: float, ratio: float | None) -> str:
    """In a few words; `ratio` None where no gear is declared."""
    if ratio is not None and abs(ratio) > 1.0:
        turns = order / abs(ratio)
        if round(turns) >= 1 and abs(turns - round(turns)) < _NEAR * round(turns):
            return {1: "motor: its encoder or input shaft",
                    2: "motor, twice a turn: wave generator or input shaft"}.get(
                round(turns), f"motor, {round(turns)} times a turn: teeth or poles")
    if abs(order - 1.0) < 0.1:
        return "output: run-out of bearing or encoder disc"
    if abs(order - 2.0) < 0.1:
        return "output: ovality, tilt of the encoder disc"
    return ("output side: bearing or encoder disc" if order < _OUTPUT_ORDERS
            else "gear: teeth or rolling elements")
