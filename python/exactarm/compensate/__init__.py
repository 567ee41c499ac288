"""Compensation: robot programs whose numbers make the real arm go where the program says.

law              the command that reaches a target on the identified model, and its inverse
controller       the controller's own chain: poses of joint angles, joint angles of poses
approach         from which side each axis comes to its target
frames           what stands for the controller's base and flange on the identified chain
program          targets of a file, the bytes of their numbers, and the writer that changes nothing else
krl, rapid, ...  one file a dialect: reads targets, writes numbers
correction       all of it: programs in, corrected programs and what moved by how much out
"""
