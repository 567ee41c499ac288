"""Offline planning: from a path of the flange to the motor motion that puts it there (thesis chapter 4)."""

from exactarm.plan.many import PathFailure, plan_many
from exactarm.plan.optimal import Plan, PlanOptions, plan_path
from exactarm.plan.path_file import PlannedPath, load_path, shipped_paths
from exactarm.plan.reference import Line, Points, Reference, Spiral, sample_reference

__all__ = [
    "Line", "PathFailure", "Plan", "PlanOptions", "PlannedPath", "Points", "Reference", "Spiral",
    "load_path", "plan_many", "plan_path", "sample_reference", "shipped_paths",
]
