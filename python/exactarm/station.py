"""Stations of the measurement chain.

    theta --MOTOR, GEAR--> phi --LOAD--> torque --SPRING--> q --GEOMETRY--> target --DEVICE--> measured
                              |                      torque --DRIVE--> motor torque
                              at rest: flange_load --FLANGE--> torque, bending of bearings and base
"""

from enum import IntEnum


class Station(IntEnum):
    """Where an effect acts, in the order in which a signal passes."""

    MOTOR = 1
    GEAR = 2
    FLANGE = 3
    LOAD = 4
    SPRING = 5
    GEOMETRY = 6
    DEVICE = 7
    DRIVE = 8
