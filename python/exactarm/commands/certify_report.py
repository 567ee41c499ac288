"""What `certify` says: keys of result.json and the page."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from exactarm.commands.about import EXPECTED_KEYS, KEYS
from exactarm.commands.result import estimate
from exactarm.data.dataset import Dataset
from exactarm.identify.statistics import ErrorSummary
from exactarm.report import Figure, Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import change, quantities, quantity
from exactarm.report.plots.errors import error_histogram
from exactarm.report.plots.style import figure_of_panel
from exactarm.report.plots.workspace_error import distance_error, error_over_workspace
from exactarm.robot.robot import Robot
from exactarm.verify.held_out import Judged, Rows
from exactarm.verify.iso_9283 import LEAST_VISITS, STANDARD_VISITS, Distances, Iso9283
from exactarm.verify.iso_orientation import AXES, Orientation
from exactarm.verify.iso_path import LEAST_CYCLES, STANDARD_CYCLES, PathTest
from exactarm.verify.uncertainty import MANY, Budget, mean_with_interval

FEW_VISITS = "the standard asks for {} visits of a pose; here are {} at the least"
SAME_M = 1e-9  # no measurement tells two models apart that agree to a nanometre
MANY_FREEDOM = 1000  # degrees of freedom beyond which a number says nothing


@dataclass(frozen=True)
class Certified:
    """What a certificate is written from. data, points: the judged rows; summaries: errors before, after."""

    robot: Robot
    earlier: Robot
    data: Dataset
    rows: Rows
    about: dict[str, Any]
    before: Judged
    after: Judged
    points: np.ndarray
    summaries: tuple[ErrorSummary, ErrorSummary]
    iso: Iso9283
    orientation: Orientation | None
    paths: tuple[PathTest, ...]
    budget: Budget
    regions: list[tuple[str, ErrorSummary, ErrorSummary]]

    @property
    def compared(self) -> bool:
        """Whether before and after differ: a file that was never calibrated is the controller's chain."""
        return not np.allclose(self.before.residual, self.after.residual, rtol=0.0, atol=SAME_M)

    @property
    def model_before(self) -> str:
        """What the error before is one of: its name, with what the robot file has and it has not."""
        has = lambda robot: {
            "springs": any(joint.spring_linear is not None for joint in robot.joints),
            "gear tables": any(joint.cw or joint.ccw for joint in robot.joints),
            "effects": bool(robot.effects)}
        there, here = has(self.robot), has(self.earlier)
        absent = [name for name in there if there[name] and not here[name]]
        if not absent:
            return self.earlier.name
        listed = " and ".join(filter(None, (", ".join(absent[:-1]), absent[-1])))
        return (f"{self.earlier.name}, without the {listed} of the robot file (`calibrate` begins with those "
                "that were declared, so its error before is another one; --before ROBOT, with the file from "
                "before the calibration, gives that)")

    @property
    def missing(self) -> dict[str, str]:
        """Measures of the standard that the rows do not allow, with the reason."""
        out = dict(self.iso.missing)
        if self.orientation is None:
            out["orientation accuracy and repeatability"] = "the data have no columns qw ... qz or rx, ry, rz"
        elif not self.orientation.poses:
            out["orientation accuracy and repeatability"] = (
                f"no judged pose was visited {LEAST_VISITS} times from one direction")
        if not self.paths:
            out["path accuracy AT and repeatability RT"] = "no path was given (--path)"
        elif not any(test.cycles >= LEAST_CYCLES for test in self.paths):
            out["path repeatability RT"] = f"no path was driven {LEAST_CYCLES} times"
        return out

    @property
    def warnings(self) -> tuple[str, ...]:
        out = list(self.rows.warnings)
        absent = [key for key in EXPECTED_KEYS if key not in self.about]
        if absent:
            options = ", ".join(f"--{key.replace('_', '-')}" for key in absent)
            out.append(f"not on this certificate: {'; '.join(KEYS[key] for key in absent)}. Give it by "
                       f"{options}, or in the file of --about")
        if not self.compared:
            out.append("before and after are one model: the robot file holds nothing that its controller "
                       "does not know. Give the calibrated file, or --before ROBOT to compare with another")
        if self.iso.poses and self.iso.visits < STANDARD_VISITS:
            out.append(FEW_VISITS.format(STANDARD_VISITS, self.iso.visits))
        if self.paths and min(test.cycles for test in self.paths) < STANDARD_CYCLES:
            least = min(test.cycles for test in self.paths)
            out.append(f"the standard asks for {STANDARD_CYCLES} cycles of a path; here are {least} at least")
        out += [f"path {number} lies {quantity(test.beside, 'm')} beside where the frames of the poses have "
                "it, as one body: was it measured in the same set-up?"
                for number, test in enumerate(self.paths, start=1) if test.beside]
        for when, judged in (("before", self.before), ("after", self.after)):
            if not judged.fit.fit.converged:
                out.append(f"the fit of the frames {when} did not converge ({judged.fit.fit.reason})")
        return tuple(out)


def results_of(c: Certified) -> dict[str, Any]:
    """The command's keys of result.json."""
    before, after = c.summaries
    return {
        "before": {"validation": before.to_json()},
        "model_before": c.model_before,
        "after": {"validation": after.to_json()},
        "mean_error_m": {"before": estimate(*mean_with_interval(c.data, c.before.error)),
                         "after": estimate(*mean_with_interval(c.data, c.after.error))},
        "rows": {"judged": int(c.rows.judged.sum()), "frames": int(c.rows.frames.sum()), "why": c.rows.why},
        "iso_9283": _iso_json(c.iso) | _orientation_json(c.orientation) | _path_json(c.paths)
        | {"missing": c.missing},
        "uncertainty": {
            "budget": [
                {"source": e.source, "type": e.kind, "u_m": e.u, "degrees_of_freedom": _freedom(e.freedom),
                 "how": e.how}
                for e in c.budget.entries],
            "u_m": c.budget.u,
            "degrees_of_freedom": _freedom(c.budget.freedom),
            "k": c.budget.coverage_factor,
            "expanded_m": c.budget.expanded,
            "radius95_m": c.budget.radius,
            "share_within_radius": c.budget.share_within},
        "regions": [{"region": name, "before": one.to_json(), "after": other.to_json()}
                    for name, one, other in c.regions],
        "about": c.about,
        "warnings": list(c.warnings)}


def _freedom(value: float) -> float | None:
    """None: taken as known."""
    return value if value < MANY else None


def _iso_json(iso: Iso9283) -> dict[str, Any]:
    out: dict[str, Any] = {}
    if iso.poses:
        out["pose_tests"] = [
            {"visits": t.visits, "AP_before_m": t.accuracy_before, "AP_after_m": t.accuracy_after,
             "RP_m": t.repeatability}
            for t in iso.poses]
        out |= {"AP_before_max_m": max(t.accuracy_before for t in iso.poses),
                "AP_after_max_m": max(t.accuracy_after for t in iso.poses),
                "RP_max_m": max(t.repeatability for t in iso.poses)}
    if iso.directions:
        out["vAP_before_m"], out["vAP_after_m"], out["vAP_poses"] = iso.directions
    if iso.drift:
        out["dAP_before_m"], out["dAP_after_m"], out["dRP_m"], out["drift_hours"] = iso.drift
    if iso.distances:
        for when, error in (("before", iso.distances.before), ("after", iso.distances.after)):
            out[f"AD_{when}_max_m"] = float(np.max(np.abs(error)))
            out[f"AD_{when}_mean_m"] = float(np.mean(np.abs(error)))
        out |= {"AD_pairs": len(iso.distances.length), "RD_max_m": iso.distances.repeatability}
    return out


def _orientation_json(found: Orientation | None) -> dict[str, Any]:
    if found is None:
        return {}
    out: dict[str, Any] = {"mean_error_rad": {"before": found.error[0], "after": found.error[1]},
                           "tested_poses": found.poses}
    if found.poses:
        out |= {"AP_before_max_rad": found.accuracy_before, "AP_after_max_rad": found.accuracy_after,
                "RP_max_rad": found.repeatability}
    if found.directions:
        out["vAP_before_rad"], out["vAP_after_rad"] = found.directions
    return {"orientation": out}


def _path_json(paths: tuple[PathTest, ...]) -> dict[str, Any]:
    return {} if not paths else {"paths": [
        {"session": t.session, "cycles": t.cycles, "length_m": t.length, "speed_m_s": t.speed,
         "AT_before_m": t.accuracy_before, "AT_after_m": t.accuracy_after, "RT_m": t.repeatability}
        for t in paths]}


def certificate(c: Certified) -> Report:
    """The page."""
    before, after = c.summaries
    who = f"{c.robot.name}" + (f", serial number {c.about['serial']}" if "serial" in c.about else "")
    largest = quantities([before.max, after.max], "m")
    error = (f"{change(before.mean, after.mean, 'm')} (largest: {' to '.join(largest)})" if c.compared else
             f"is {quantity(after.mean, 'm')} (largest: {largest[0]}), by one model alone")
    verdict = (f"{who}: at {after.n} measured positions that were never fitted the mean error {error}. The "
               f"model's position has an expanded uncertainty of {quantity(c.budget.expanded, 'm')} a "
               f"coordinate (k = {c.budget.coverage_factor:.2f}, 95 %).")
    if not c.rows.unseen:
        verdict = verdict.replace("that were never fitted ", "")
    tone = "bad" if after.mean > before.mean else "caution" if c.rows.warnings else "good"
    sections = (
        Warnings(c.warnings), Highlights(_highlights(c)), _about(c), _held_out(c), _iso(c.iso),
        *([_orientation(c.orientation)] if c.orientation is not None else []),
        *([_paths(c.paths)] if c.paths else []),
        *([Text("Not evaluated", tuple(f"{measure}: {why}." for measure, why in c.missing.items()))]
          if c.missing else []),
        _budget(c.budget, c.rows.word),
        Text("What was compared",
             (f"Before: {c.model_before}. After: the robot file as it is. Of both, base and tool frame alone "
              f"were fitted, with {int(c.rows.frames.sum())} rows. {c.rows.why}",)),
        figure_of_panel(
            "error_histogram", "Distribution of the position error",
            partial(error_histogram, c.before.error, c.after.error, "m", of="positions"), 3.0,
            f"Number of {c.rows.word} positions by their error.",
            "histogram of the position error before and after"),
        Figure(
            "error_over_workspace", "Position error over the work space",
            partial(error_over_workspace, c.points, c.before.error, c.after.error),
            f"{c.rows.word.capitalize()} positions of the target in the robot's base frame, coloured by "
            "their error; one scale for before and after, the largest errors on top.",
            "position errors before and after, seen from above and from the side", main=1),
        *([_distances(c.iso.distances)] if c.iso.distances else []))
    return Report(f"Certificate of {c.robot.name}", verdict, sections, tone)


def _highlights(c: Certified) -> tuple[Highlight, ...]:
    before, after = c.summaries
    earlier = lambda then: Quantity(then, "m") if c.compared else None
    items = [Highlight(f"{c.rows.word}, {name}", Quantity(now, "m"), earlier(then))
             for name, now, then in (("mean", after.mean, before.mean), ("maximum", after.max, before.max))]
    if c.iso.poses:
        items.append(
            Highlight("repeatability RP, largest", Quantity(max(t.repeatability for t in c.iso.poses), "m")))
    return (*items, Highlight("expanded uncertainty, 95 %", Quantity(c.budget.expanded, "m")))


def _about(c: Certified) -> Table:
    rows = [(KEYS[key], f"{value:g} mm a coordinate (k = 1)" if key == "instrument_u_mm" else str(value))
            for key, value in c.about.items()]
    for source in c.data.sources:
        rows += [("data", f"{source.path}, {source.rows} rows"), ("SHA-256 of the data", source.sha256)]
    return Table("Arm, instrument, data", ("", ""), tuple(rows))


def _held_out(c: Certified) -> Table:
    before, after = c.summaries
    row = lambda name, one, other: (
        name, one.n,
        *(Quantity(getattr(s, key), "m") for key in ("mean", "rms", "max") for s in (one, other)))
    rows = [row("all", before, after), *(row(*region) for region in c.regions)]
    return Table(f"{c.rows.word.capitalize()} position error",
                 ("where", "rows", "mean before", "mean after", "RMS before", "RMS after", "maximum before",
                  "maximum after"),
                 tuple(rows),
                 "Reach: distance of the target from the first axis; height: in the base frame.",
                 0)


def _iso(iso: Iso9283) -> Table:
    rows: list[tuple] = []
    add = lambda name, before, after, of: rows.append((name, Quantity(before, "m"), Quantity(after, "m"), of))
    if iso.poses:
        of = f"{len(iso.poses)} poses, {iso.visits} visits or more"
        for label, pick in (("largest", np.max), ("mean", np.mean)):
            add(f"pose accuracy AP, {label}", pick([t.accuracy_before for t in iso.poses]),
                pick([t.accuracy_after for t in iso.poses]), of)
        largest = max(t.repeatability for t in iso.poses)
        add("pose repeatability RP, largest", largest, largest, of)
    if iso.directions:
        add("variation between directions vAP", *iso.directions[:2], f"{iso.directions[2]} poses")
    if iso.drift:
        add("drift of pose accuracy dAP", *iso.drift[:2], f"{iso.drift[3]:.2g} h")
        add("drift of repeatability dRP", iso.drift[2], iso.drift[2], f"{iso.drift[3]:.2g} h")
    if iso.distances:
        of = f"{len(iso.distances.length)} pairs of poses"
        for label, pick in (("largest", np.max), ("mean", np.mean)):
            add(f"distance accuracy AD, {label}", pick(np.abs(iso.distances.before)),
                pick(np.abs(iso.distances.after)), of)
        if iso.distances.repeatability is not None:
            add("distance repeatability RD, largest", iso.distances.repeatability,
                iso.distances.repeatability, f"{iso.distances.repeated} pairs of repeated poses")
    note = (
        "In the terms of ISO 9283; poses, loads and speeds are those of the rows, not the standard's cube. "
        "AP and vAP: against the model, with base and tool frame fitted. RP, RD and dRP are the arm's own: "
        "no model changes them. AD needs no base frame.")
    return Table("Performance in the terms of ISO 9283", ("", "before", "after", "from"), tuple(rows), note)


def _orientation(found: Orientation) -> Table:
    angle = lambda value: Quantity(float(value), "rad")
    rows: list[tuple] = [("all rows, mean angle", *map(angle, found.error), "")]
    add = lambda name, before, after, of: rows.extend(
        (name.format(axis), angle(one), angle(other), of) for axis, one, other in zip(AXES, before, after))
    if found.poses:
        of = f"{found.poses} poses"
        add("orientation accuracy AP_{}, largest", found.accuracy_before, found.accuracy_after, of)
        add("orientation repeatability RP_{}, largest", found.repeatability, found.repeatability, of)
    if found.directions:
        add("variation between directions vAP_{}", *found.directions, "")
    note = ("About x (a), y (b) and z (c) of the robot's base, against the model with base and tool frame "
            "fitted. RP is the arm's own.")
    columns = 4 if any(row[3] for row in rows) else 3
    return Table("Orientation in the terms of ISO 9283", ("", "before", "after", "from")[:columns],
                 tuple(row[:columns] for row in rows), note)


def _paths(paths: tuple[PathTest, ...]) -> Table:
    rows = tuple((number, t.cycles, Quantity(t.length, "m"), Quantity(t.speed, "m/s"),
                  *(Quantity(value, "m") for value in (t.accuracy_before, t.accuracy_after, t.repeatability)))
                 for number, t in enumerate(paths, start=1))
    note = ("Against the path that the model at rest takes at the angles that the controller reports, with "
            "the frames of the poses: what speed does counts as an error. RT is the arm's own; the ends are "
            "left out.")
    header = ("path", "cycles", "length", "mean speed", "AT before", "AT after", "RT")
    return Table("Paths in the terms of ISO 9283", header, rows, note)


def _budget(b: Budget, word: str) -> Table:
    share = lambda u: f"{100.0 * u**2 / b.u**2:.0f} %" if b.u > 0.0 else ""
    freedom = lambda value: (
        "∞" if value >= MANY else f"> {MANY_FREEDOM}" if value > MANY_FREEDOM else f"{value:.0f}")
    rows = [(e.source, e.kind, Quantity(e.u, "m"), freedom(e.freedom), share(e.u), e.how) for e in b.entries]
    rows.append(("combined", "", Quantity(b.u, "m"), freedom(b.freedom), "100 %", ""))
    rows.append(("expanded, 95 %", "", Quantity(b.expanded, "m"), "", "", f"k = {b.coverage_factor:.3f}"))
    note = (
        "Of one coordinate of the position that the model predicts within the judged work space. In space, "
        f"95 % of the positions lie within {quantity(b.radius, 'm')} of it if errors are Gaussian; of the "
        f"{word} rows {100.0 * b.share_within:.1f} % do.")
    if not any(e.source == "instrument" for e in b.entries):
        note += " The instrument's own uncertainty was not given: what of it repeats is not in the budget."
    return Table("Uncertainty (GUM)", ("source", "type", "u", "degrees of freedom", "share", "how"),
                 tuple(rows), note, len(rows) - 1)


def _distances(d: Distances) -> Figure:
    return figure_of_panel("distance_error", "Distance accuracy",
                           partial(distance_error, d.length, d.before, d.after), 3.0,
                           "Error of the distance between two poses against that distance.",
                           "error of distances before and after")
