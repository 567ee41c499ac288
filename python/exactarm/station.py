"""Stations of the measurement chain.

    theta --MOTOR, GEAR--> phi --LOAD--> torque --SPRING--> q --GEOMETRY--> target --DEVICE--> measured
                                                     torque --DRIVE--> motor torque
"""

from enum import IntEnum


class Station(IntEnum):
    """Where an effect acts, in the order in which a signal passes."""

    MOTOR = 1
    GEAR = 2
    LOAD = 3
    SPRING = 4
    GEOMETRY = 5
    DEVICE = 6
    DRIVE = 7
