"""The robot as a value: joints, links, frames, generic masses; URDF and makers' calibrations, robot files as
written. They are read by `exactarm.robot_file`, for they hold effects too.
"""
