"""Design of measurements: which poses tell most, within limits, collisions and the tracker's line of sight.

design             poses for a tracker, by exchange (extended DETMAX) and a criterion
closure_design     touches of a fixture, and where to put it; camera_design: views of a board; gravity_design
"""
