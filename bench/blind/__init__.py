"""Blind test of the diagnosis: data with effects that the robot file does not declare, and a scorer.

    arm, random_arms          serial arms in plain numpy: kinematics, gravity torques, gears, springs
    hidden, pose_effects,
    foreign_effects           the causes that are hidden, each with physics of its own
    poses, gear_runs, motion  measured data of one kind from an arm with hidden causes
    scenario                  one drawn case: robot file, data file, truth file
    scorer, run               diagnosis of many scenarios against their truth

Nothing here but the scorer imports the package under test, and the scorer takes only its public front:
reading files and `diagnose`.
"""
