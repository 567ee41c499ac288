"""Verification of an arm that is calibrated: how good it is on rows never fitted, and whether it has stayed
so.

held_out      which rows judge, which find the frames, errors before and after
iso_9283      pose accuracy, repeatability, directions, drift, distances; iso_orientation, iso_path: the rest
uncertainty   a budget after GUM
"""
