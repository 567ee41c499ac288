"""Identification: frames, identifiability, measurement design, calibration, gears, dynamics."""
