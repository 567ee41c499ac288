"""Exports: the identified arm in the formats of other programs, each with the accuracy that the format loses.

chain             the part of the model that a rigid chain with constant offsets can carry
urdf              a URDF patched in place; ur_description, mjcf, offsets: one file a format
"""
