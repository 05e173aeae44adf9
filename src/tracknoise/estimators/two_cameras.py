"""What positions in two cameras are to an estimator that has one sigma for both.

The estimator takes all positions as independent. Let C be the mean products of the errors of sampled tracks of a scene
in both cameras, C_1 and C_2 those of one camera alone, and M(C) the actual over the claimed mean square of a purpose
with 1 px (benchmark.covariances). Over that of the second camera alone, sigma for both, and gates, are

    sigma: sqrt(mean M(C) / mean M(C_2)),    gate: g(C) / g(C_2) mean M(C_2) / mean M(C)    (pair.sigma)

with means over windows of scenes, and gates g of Gaussian errors for 1 px. Windows of more frames than sampled tracks
have get those of the longest ones. In one pose from known points, both positions of a point are of one frame:

    sigma: sqrt(E |e_1 + e_2|^2 / (2 E |e_2|^2))    (pair.known)

What the second camera gains is in the errors of the newest pose with both, over those with the first alone, where the
scale is known. Intervals of sigmas are as wide, relative to them, as those for the second camera alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

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

_MOST_WINDOWS = 24
_OF_GATES = 4
"""Windows that gates are compared on."""


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

    def alone(self, camera: int) -> list[Array]:
        """Mean products of errors in one camera, (tracks, 2 n, 2 n) px^2."""
        halves = (one.shape[1] // 2 for one in self.moments)
        parts = [slice(camera * half, (camera + 1) * half) for half in halves]
        return [one[:, part, part] for one, part in zip(self.moments, parts, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class _Ratios:
    """By purpose and kind of landmark: ratios of sigmas, and of gates at `LEVELS`, for windows of one length."""

    sigma: Mapping[tuple[Landmark, Purpose], float]
    gates: Mapping[Landmark, tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class TwoCameras:
    """What positions in both cameras are to estimators, by windows and sampled tracks."""

    tracks: pl.DataFrame  # schema `PAIR_TRACKS`, of one tracker, speed and view, without long errors
    scenes: Mapping[str, SampledErrors]
    windows: Mapping[int, Sequence[_Window]]  # by their length, from the shortest on

    @classmethod
    def of(cls, tracks: pl.DataFrame, by_length: Mapping[int, Windows], most_px: float) -> "TwoCameras | None":
        """By windows in both cameras; None without such windows, with too few tracks, or where one has no errors.

        `tracks`: schema `PAIR_TRACKS`, of one tracker, speed and view. Errors beyond `most_px` are left out.
        """
        if tracks.is_empty():
            return None
        names = tracks["scene"].unique().sort().to_list()
        scenes = {names[place]: one for place, one in sampled_scenes(tracks, most_px).items()}
        longest = max((int(one.length.max(initial=0)) for one in scenes.values()), default=0)
        found = {length: list(_windows(scenes, by_length[length])) for length in sorted(by_length) if length <= longest}
        known = {length: windows for length, windows in found.items() if windows}
        small = [pl.col(f"{name}du_px") ** 2 + pl.col(f"{name}dv_px") ** 2 <= most_px**2 for name in ("first_", "")]
        pair = cls(tracks.filter(*small), scenes, known)
        return pair if known and min(pair.squares["first"], pair.squares["second"]) > 0.0 else None

    def equivalents(self, alone: Sequence[Equivalent]) -> tuple[Equivalent, ...]:
        """Sigmas and gates for both cameras, from those for the second one, by (pair.sigma)."""
        lengths = sorted({one.window for one in alone})
        nearest = {length: min(self.windows, key=lambda known: abs(known - length)) for length in lengths}
        ratios = {length: _ratios(self.windows[length]) for length in {*nearest.values()}}
        return tuple(_of_both(one, ratios[nearest[one.window]]) for one in alone)

    def known_points(self, alone: Sequence[KnownPoints]) -> tuple[KnownPoints, ...]:
        """Sigmas for one pose from known points, from those for the second camera, by (pair.known)."""
        squares = self.squares
        ratio = (squares["first"] + 2.0 * squares["both"] + squares["second"]) / (2.0 * squares["second"])
        root = float(np.sqrt(max(ratio, 0.0)))
        return tuple(
            replace(one, sigma=one.sigma.times(root), per_feature=_times(one.per_feature, root**2)) for one in alone
        )

    def trial(
        self, length: int, alone: Sequence[Equivalent], both: Sequence[Equivalent], groups: SceneGroups, level: float
    ) -> OfBoth:
        """What is said of both cameras, for a free landmark and the newest pose in windows of a length."""
        windows = self.windows[min(self.windows, key=lambda known: abs(known - length))]
        rows = [{"dataset": self.tracks["dataset"][0], "scene": one.scene, "n": 1.0, **_gains(one)} for one in windows]
        table = pl.DataFrame(rows)
        errors = {name: over_scenes(table, name, "n", "log", groups, level) for name in ("position", "rotation")}
        sigmas = [
            next(
                one.sigma.value
                for one in of
                if (one.landmark, one.purpose, one.window) == (Landmark.FREE, Purpose.NEWEST_POSE, length)
            )
            for of in (both, alone)
        ]
        correlation = self.squares["both"] / np.sqrt(self.squares["first"] * self.squares["second"])
        return OfBoth(
            correlation=float(np.clip(correlation, -1.0, 1.0)),
            sigma_ratio=sigmas[0] / sigmas[1],
            position_ratio=errors["position"],
            rotation_ratio=errors["rotation"],
            windows=len(windows),
        )

    @cached_property
    def squares(self) -> dict[str, float]:
        """Mean products of errors older than 0 frames, px^2, of u and v together; tracks count as they stand for."""
        some = self.tracks.filter(pl.col("age") > 0)
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


def _ratios(windows: Sequence[_Window]) -> _Ratios:
    """(pair.sigma) of windows of one length. A state counts as a free landmark."""
    sigma: dict[tuple[Landmark, Purpose], float] = {}
    gates: dict[Landmark, tuple[float, ...]] = {}
    for landmark, first in ((Landmark.FREE, None), (Landmark.EXACT, EXACT)):
        squares = dict.fromkeys(Purpose, np.zeros(2))
        for one in windows:
            found = [
                consistencies(tracks, [moments], scalar_variances(tracks, 1.0, first=first))[0]
                for tracks, moments in ((one.both, one.moments), (one.tracks, one.alone(1)))
            ]
            squares = {purpose: squares[purpose] + [own[purpose] for own in found] for purpose in Purpose}
        sigma |= {(landmark, purpose): float(np.sqrt(of[0] / of[1])) for purpose, of in squares.items()}
        some = windows[:: -(-len(windows) // _OF_GATES)]
        both = [(group, own) for one in some for group, own in zip(one.both, one.moments, strict=True)]
        alone = [(group, own) for one in some for group, own in zip(one.tracks, one.alone(1), strict=True)]
        of_each = (TrackGates.of_covariances(*zip(*pairs, strict=True)) for pairs in (both, alone))
        factors = (one.factors(LEVELS, sigma=1.0, first=first) for one in of_each)
        gates[landmark] = tuple(own / other if other > 0.0 else 1.0 for own, other in zip(*factors, strict=True))
    sigma |= {(Landmark.STATE, purpose): sigma[Landmark.FREE, purpose] for purpose in Purpose}
    return _Ratios(sigma, {**gates, Landmark.STATE: gates[Landmark.FREE]})


def _of_both(alone: Equivalent, ratios: _Ratios) -> Equivalent:
    ratio = ratios.sigma[alone.landmark, alone.purpose]
    gate_80, gate_95, gate_99 = (one / ratio**2 for one in ratios.gates[alone.landmark])
    return replace(
        alone,
        sigma=alone.sigma.times(ratio),
        per_feature=_times(alone.per_feature, ratio**2),
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
