"""Blind test of the diagnosis: data with effects that the robot file does not declare, and a scorer.

    arm, random_arms          serial arms in plain numpy: kinematics, gravity torques, gears, springs
    hidden, pose_effects, device_effects, foreign_effects, gear_effects, motion_effects, tracked_effects
                              the causes that are hidden, each with physics of its own
    conditions, noise, passage, pose_sets
                              what else a case may be like: noise, cut runs, reversals, still axes, the robot
                                  file
    poses, gear_runs, motion  measured data of one kind from an arm with hidden causes
    ..._scenario              one drawn case: robot file, data file, truth file
    scorer, marks, run        diagnosis of many scenarios against their truth

Nothing here but the scorer imports the package under test, and the scorer takes only its command line and
`result.json` (and the library of effects, to leave one out).
"""
