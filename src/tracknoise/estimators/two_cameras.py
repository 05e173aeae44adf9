"""What positions in two cameras are to an estimator that has one sigma for both.

The estimator takes all positions as independent. Let C be the mean products of the errors of sampled tracks of a scene
in both cameras, C_2 those in the second alone, and M(C) the actual over the claimed mean square of a purpose with 1 px
(benchmark.covariances). With gates g of Gaussian errors for 1 px, and sigma_2 and gate_2 of the second camera alone,

    sigma^2 = mean over scenes of M(C),    gate = gate_2 (g(C) / sigma^2) / (g(C_2) / sigma_2^2)    (pair.sigma)

Intervals are over scenes; with too few of them, as wide as those of sigma_2. A first direction that is a state has its
sigma in the same ratio to sigma_2 as a free landmark. Errors of both cameras may grow apart over the life of a track.
What it carries into a window is no shift of its point then: tracks that began before it have their errors from any age
on. Windows of more frames than sampled tracks have get the ratio of the longest ones. In one pose from known points,
both positions of a point are of one frame:

    sigma: sqrt(E |e_1 + e_2|^2 / (2 E |e_2|^2))    (pair.known)

What the second camera gains is in the errors of the newest pose with both, over those with the first alone, where the
scale is known.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.estimators.equivalents import LEVELS
from tracknoise.estimators.kernels import SampledErrors, sampled_scenes
from tracknoise.estimators.linear_window import (
    EXACT,
    Covariances,
    LinearTracks,
    TrackGates,
    consistencies,
    determines_poses,
    outcome,
    scalar_variances,
)
from tracknoise.estimators.model import Equivalent, Interval, KnownPoints, Landmark, OfBoth, Purpose
from tracknoise.estimators.pose_trials import over_scenes
from tracknoise.estimators.training import Windows
from tracknoise.inference.units import SceneGroups

Array = NDArray[np.float64]

_MOST_SCENES, _MOST_WINDOWS = 48, 48
_OF_GATES = 4
"""Windows that gates are compared on."""
_MOST_CORRELATED = 0.99
"""Largest correlation that an estimator is given."""
_FIRST: Mapping[Landmark, float | None] = {Landmark.FREE: None, Landmark.EXACT: EXACT}
"""Standard deviation of first positions in the first camera, over that of others, by the kind of landmark."""


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """A window of a scene in both cameras, with mean products of errors."""

    scene: str
    tracks: Sequence[LinearTracks]
    moments: Covariances  # of both cameras, (tracks, 4 n, 4 n) px^2

    @property
    def both(self) -> list[LinearTracks]:
        """Its tracks in both cameras."""
        return [one.of_both for one in self.tracks]

    def newest_squares(self, correlation: float) -> tuple[float, float]:
        """M(C) of the newest pose, px^2: with positions taken as independent, and with this correlation of both."""
        both = self.both
        assumed = [np.kron([[1.0, correlation], [correlation, 1.0]], np.eye(one.shape[1] // 2)) for one in self.moments]
        spread = [np.broadcast_to(one, own.shape) for one, own in zip(assumed, self.moments, strict=True)]
        squares = (consistencies(both, [self.moments], one)[0] for one in (scalar_variances(both, 1.0), spread))
        independent, correlated = (own[Purpose.NEWEST_POSE] for own in squares)
        return independent, correlated

    def alone(self, camera: int) -> list[Array]:
        """Mean products of errors in one camera, (tracks, 2 n, 2 n) px^2."""
        halves = (one.shape[1] // 2 for one in self.moments)
        parts = [slice(camera * half, (camera + 1) * half) for half in halves]
        return [one[:, part, part] for one, part in zip(self.moments, parts, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class TwoCameras:
    """What positions in both cameras are to estimators, by windows and sampled tracks."""

    tracks: pl.DataFrame  # schema `PAIR_TRACKS`, of one tracker, speed and view, without long errors
    windows: Mapping[int, Sequence[_Window]]  # by their length, from the shortest on

    @classmethod
    def of(cls, tracks: pl.DataFrame, by_length: Mapping[int, Windows], most_px: float) -> "TwoCameras | None":
        """By windows in both cameras; None without such windows, with too few tracks, or where one has no errors.

        `tracks`: schema `PAIR_TRACKS`, of one tracker, speed and view. Errors beyond `most_px` are left out.
        """
        if tracks.is_empty():
            return None
        names = tracks["scene"].unique().sort().to_list()
        scenes = {names[place]: one for place, one in sampled_scenes(tracks, most_px, _MOST_SCENES).items()}
        longest = max((int(one.length.max(initial=0)) for one in scenes.values()), default=0)
        found = {length: list(_windows(scenes, by_length[length])) for length in sorted(by_length) if length <= longest}
        known = {length: windows for length, windows in found.items() if windows}
        small = [pl.col(f"{name}du_px") ** 2 + pl.col(f"{name}dv_px") ** 2 <= most_px**2 for name in ("first_", "")]
        pair = cls(tracks.filter(*small), known)
        squares = pair.products(longest)
        return pair if known and min(squares["first"], squares["second"]) > 0.0 else None

    def equivalents(self, alone: Sequence[Equivalent], groups: SceneGroups, level: float) -> tuple[Equivalent, ...]:
        """Sigmas and gates for both cameras, by (pair.sigma). `alone`: those for the second one."""
        lengths = sorted({one.window for one in alone})
        return tuple(one for length in lengths for one in self._of_length(length, alone, groups, level))

    def _of_length(
        self, length: int, alone: Sequence[Equivalent], groups: SceneGroups, level: float
    ) -> Iterator[Equivalent]:
        nearest = self._nearest(length)
        of = {(one.landmark, one.purpose): one for one in alone if one.window == nearest}
        ratios: dict[tuple[Landmark, Purpose], Interval] = {}
        gates: dict[Landmark, tuple[float, ...]] = {}
        for landmark, first in _FIRST.items():
            squares = self._squares(nearest, first, groups, level)
            ratios |= {
                (landmark, purpose): square.root().times(1.0 / of[landmark, purpose].sigma.value)
                for purpose, square in squares.items()
                if of[landmark, purpose].sigma.value > 0.0
            }
            gates[landmark] = _gates(self.windows[nearest], first)
        for one in alone:
            kind = Landmark.FREE if one.landmark is Landmark.STATE else one.landmark
            if one.window == length and (kind, one.purpose) in ratios:
                yield _of_both(one, ratios[kind, one.purpose], gates[kind])
            elif one.window == length:
                yield one

    def _nearest(self, length: int) -> int:
        """The length of its windows that is nearest."""
        return min(self.windows, key=lambda known: abs(known - length))

    def _squares(self, length: int, first: float | None, groups: SceneGroups, level: float) -> dict[Purpose, Interval]:
        """Means over scenes of M(C), px^2."""
        rows = []
        for one in self.windows[length]:
            found = consistencies(one.both, [one.moments], scalar_variances(one.both, 1.0, first=first))[0]
            of_window = {str(purpose): square for purpose, square in found.items()}
            rows.append({"dataset": self.tracks["dataset"][0], "scene": one.scene, "n": 1.0, **of_window})
        of_scenes = pl.DataFrame(rows).group_by("dataset", "scene", maintain_order=True).agg(pl.all().mean())
        return {purpose: over_scenes(of_scenes, purpose, "n", "log", groups, level) for purpose in Purpose}

    def known_points(self, alone: Sequence[KnownPoints]) -> tuple[KnownPoints, ...]:
        """Sigmas for one pose from known points, from those for the second camera, by (pair.known)."""
        return tuple(self._known_point(one) for one in alone)

    def _known_point(self, one: KnownPoints) -> KnownPoints:
        squares = self.products(one.window)
        ratio = (squares["first"] + 2.0 * squares["both"] + squares["second"]) / (2.0 * squares["second"])
        root = float(np.sqrt(max(ratio, 0.0)))
        return replace(one, sigma=one.sigma.times(root), per_feature=_times(one.per_feature, root**2))

    def trial(self, length: int, groups: SceneGroups, level: float) -> OfBoth:
        """What is said of both cameras, for a free landmark and the newest pose in windows of a length."""
        windows = self.windows[self._nearest(length)]
        rows = [{"dataset": self.tracks["dataset"][0], "scene": one.scene, "n": 1.0, **_gains(one)} for one in windows]
        table = pl.DataFrame(rows)
        errors = {name: over_scenes(table, name, "n", "log", groups, level) for name in ("position", "rotation")}
        squares = self.products(length)
        correlation = squares["both"] / np.sqrt(squares["first"] * squares["second"])
        known = float(np.clip(correlation, -_MOST_CORRELATED, _MOST_CORRELATED))
        found = np.array([one.newest_squares(known) for one in windows]).mean(axis=0)
        return OfBoth(
            correlation=float(np.clip(correlation, -1.0, 1.0)),
            correlated_ratio=float(np.sqrt(found[1] / found[0])),
            position_ratio=errors["position"],
            rotation_ratio=errors["rotation"],
            windows=len(windows),
        )

    def products(self, oldest: int) -> dict[str, float]:
        """Mean products of errors, px^2, of u and v together, at ages from 1 on; tracks count as they stand for."""
        some = self.tracks.filter(pl.col("age").is_between(1, oldest))
        if some.is_empty():
            return dict.fromkeys(("first", "second", "both"), 0.0)
        first, second = (
            some.select(f"{name}du_px", f"{name}dv_px").to_numpy().astype(np.float64) for name in ("first_", "")
        )
        weight = some["stands_for"].to_numpy().astype(np.float64)
        pairs = {"first": first * first, "second": second * second, "both": first * second}
        return {name: float(np.average(products.sum(axis=1), weights=weight)) for name, products in pairs.items()}


def _windows(scenes: Mapping[str, SampledErrors], windows: Windows) -> Iterator[_Window]:
    """Windows of scenes with tracks in both cameras, at most `_MOST_WINDOWS`."""
    places = [(name, place) for name in scenes for place in windows.of_scene(name)]
    chosen = np.unique(np.linspace(0, len(places) - 1, min(_MOST_WINDOWS, len(places))).round().astype(int))
    for name, place in (places[one] for one in chosen):
        found = [
            (group, moments)
            for group in windows.each[place]
            if group.beside is not None
            and (moments := scenes[name].moments(group.frames.shape[1], group.born)) is not None
        ]
        tracks = [group for group, _ in found]
        if sum(len(one.rays) for one in tracks) > 0 and determines_poses(tracks):
            yield _Window(name, tracks, [moments for _, moments in found])


def _gates(windows: Sequence[_Window], first: float | None) -> tuple[float, ...]:
    """g(C) / g(C_2) at `LEVELS`."""
    some = windows[:: -(-len(windows) // _OF_GATES)]
    both = [(group, own) for one in some for group, own in zip(one.both, one.moments, strict=True)]
    alone = [(group, own) for one in some for group, own in zip(one.tracks, one.alone(1), strict=True)]
    of_each = (TrackGates.of_covariances(*zip(*pairs, strict=True)) for pairs in (both, alone))
    factors = (one.factors(LEVELS, sigma=1.0, first=first) for one in of_each)
    return tuple(own / other if other > 0.0 else 1.0 for own, other in zip(*factors, strict=True))


def _of_both(alone: Equivalent, ratio: Interval, gates: tuple[float, ...]) -> Equivalent:
    """Sigma and gates from those of the second camera, by ratios of sigmas and of gates for 1 px."""
    gate_80, gate_95, gate_99 = (one / ratio.value**2 for one in gates)
    sigma = alone.sigma.times(ratio.value)
    if ratio.low is not None and ratio.high is not None:
        sigma = replace(sigma, low=alone.sigma.value * ratio.low, high=alone.sigma.value * ratio.high)
    return replace(
        alone,
        sigma=sigma,
        per_feature=_times(alone.per_feature, ratio.value**2),
        gate_80=None if alone.gate_80 is None else alone.gate_80 * gate_80,
        gate_95=alone.gate_95 * gate_95,
        gate_99=alone.gate_99 * gate_99,
    )


def _gains(one: _Window) -> dict[str, float]:
    """Errors of the newest pose with both cameras over those with the first one alone."""
    both = outcome(one.both, one.moments, scalar_variances(one.both, 1.0))
    first = outcome(one.tracks, one.alone(0), scalar_variances(one.tracks, 1.0))
    return {"position": both.position_m / first.position_m, "rotation": both.rotation_rad / first.rotation_rad}


def _times(interval: Interval | None, factor: float) -> Interval | None:
    return None if interval is None else interval.times(factor)
