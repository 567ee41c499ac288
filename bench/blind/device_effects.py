"""The causes of docs/effects.md in the measuring device of static poses, with physics of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind.hidden import Hidden, Setting


@dataclass(frozen=True)
class TrackerScale(Hidden):
    """The device reads one or two of its axes too long."""

    name: str = "tracker_scale"
    axes: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @classmethod
    def draw(cls, random, setting: Setting):
        axes = np.zeros(3)
        axes[random.permutation(3)[: 1 + int(random.random() < 0.4)]] = random.uniform(0.5, 1.0, 1)
        if np.count_nonzero(axes) == 2:
            axes *= random.choice((-1.0, 1.0), 3)
        return cls(size=2e-4, axes=tuple(axes), detail={"axes": list(axes)})

    def device(self, measured, rows):
        return self.size * measured * np.array(self.axes)

    def parameters(self):
        """Of one axis; two are told up to a scale that is the same on all three."""
        alone = np.count_nonzero(self.axes) == 1
        return {f"{axis}_scale": self.size * own for axis, own in zip("xyz", self.axes) if own and alone}


@dataclass(frozen=True)
class TrackerDrift(Hidden):
    """The device moves off while it measures, more or less evenly."""

    name: str = "tracker_drift"
    way: tuple[float, float, float] = (0.0, 0.0, 1.0)
    bend: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        way = random.normal(size=3)
        return cls(size=2e-4, way=tuple(way / np.linalg.norm(way)), bend=random.uniform(-0.2, 0.2))

    def device(self, measured, rows):
        elapsed = rows.time if "time" in rows.has else rows.order
        out = np.zeros(len(rows))
        for session in np.unique(rows.session):
            own = rows.session == session
            x = elapsed[own] - elapsed[own].min()
            x = x / max(np.ptp(elapsed), 1e-9)
            out[own] = x + self.bend * x * (1.0 - x)
        return self.size * out[:, None] * np.array(self.way)


@dataclass(frozen=True)
class TrackerStep(Hidden):
    """Someone bumps the tripod once: from then on the device stands elsewhere, mostly turned a little too."""

    name: str = "tracker_step"
    share: float = 0.5
    way: tuple[float, float, float] = (0.0, 0.0, 1.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def draw(cls, random, setting: Setting):
        way, turned = random.normal(size=3), random.normal(size=3) * random.choice((0.0, 0.3, 1.0))
        return cls(
            size=3e-4,
            share=random.uniform(0.2, 0.8),
            way=tuple(way / np.linalg.norm(way)),
            turn=tuple(turned),
        )

    def device(self, measured, rows):
        session = rows.session[np.argsort(rows.order)[int(self.share * len(rows))]]
        own = rows.session == session
        later = own & (rows.order > np.quantile(rows.order[own], self.share))
        return self.size * later[:, None] * (np.array(self.way) + np.cross(np.array(self.turn), measured))

    def parameters(self):
        turned = (
            {f"turn_{axis}_rad": self.size * own for axis, own in zip("xyz", self.turn)}
            if any(self.turn)
            else {}
        )
        return {f"{axis}_m": self.size * own for axis, own in zip("xyz", self.way)} | turned


@dataclass(frozen=True)
class Outliers(Hidden):
    """Readings that are plainly wrong: hundredths of all rows, 5 to 25 or 200 times the noise (`size`)."""

    name: str = "outliers"
    errors: tuple = ()

    @classmethod
    def draw(cls, random, setting: Setting):
        rows = len(setting.rows)
        wrong = random.random(rows) < random.uniform(0.015, 0.05)
        wrong[random.integers(rows, size=2)] = True
        errors = random.normal(size=(rows, 3)) * wrong[:, None]
        far = random.choice((25.0, 25.0, 200.0))
        errors *= np.exp(random.uniform(np.log(5.0), np.log(far), (rows, 1))) / np.maximum(
            np.linalg.norm(errors, axis=1, keepdims=True), 1e-12
        )
        return cls(size=1.0, errors=tuple(map(tuple, errors)), detail={"rows": int(wrong.sum())})

    def device(self, measured, rows):
        return self.size * np.array(self.errors)

    def spoiled(self, rows):
        return np.any(np.array(self.errors) != 0.0, axis=1)
