"""How wrong the poses, depths, clock and camera of a recording may be, as somebody stated or measured it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from math import isfinite
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.text import constructed


@dataclass(frozen=True, slots=True)
class PoseAccuracy:
    """Standard deviations of the error of a pose, the same for every axis, independent from frame to frame.

    Errors that grow with the time between two frames are stated by a `TruthAccuracy`.

    Parameters
    ----------
    position_m
        Of each coordinate of the position, metres; 0 where it is exact, None where it is unknown.
    rotation_rad
        Of the rotation about each axis, radians; 0 where it is exact, None where it is unknown.
    """

    position_m: float | None
    rotation_rad: float | None


@dataclass(frozen=True, slots=True)
class DepthAccuracy:
    """Standard deviation of the error of a depth Z; 0 where it is exact.

    It is sqrt(constant_m^2 + (relative Z)^2 + (quadratic_per_m Z^2)^2).

    Parameters
    ----------
    constant_m
        The part that does not depend on the depth, metres.
    relative
        The part that is proportional to the depth, no unit.
    quadratic_per_m
        The part that is proportional to the square of the depth, as that of stereo, 1/m.
    """

    constant_m: float
    relative: float
    quadratic_per_m: float = 0.0

    def sigma_m(self, depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) float64: the standard deviation at depths, metres."""
        varying = np.hypot(self.relative * depth_m, self.quadratic_per_m * depth_m * depth_m)
        return np.hypot(self.constant_m, varying)


EXACT_POSE = PoseAccuracy(0.0, 0.0)
EXACT_DEPTH = DepthAccuracy(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class GrowthLaw:
    """Standard deviation of one component of the relative pose error of two frames that are k frames apart.

    Its square is 2 white^2 + walk^2 k + drift^2 k^2 (accuracy.growth).
    """

    # Error of each single pose, independent from frame to frame. A relative pose has that of both frames.
    white: float = 0.0
    walk: float = 0.0  # error that each step adds, independent from step to step: a random walk
    drift: float = 0.0  # error that each step adds, the same in all steps

    def variance(self, lag: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) float64: the square of the standard deviation over `lag` frames; 0 for 0 frames."""
        return np.where(lag > 0, 2.0 * self.white**2, 0.0) + self.walk**2 * lag + (self.drift * lag) ** 2


class AccuracyKind(StrEnum):
    """Where a figure comes from.

    stated: by those who made the data, or by the user. measured: from the tracks or another instrument. disagreement:
    from the difference of two truths of the same images.
    """

    stated = "stated"
    measured = "measured"
    disagreement = "disagreement"


TOPICS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "rotation": ("rotation_white_deg", "rotation_deg_per_sqrt_frame", "rotation_deg_per_frame"),
        "translation": ("translation_white_m", "translation_m_per_sqrt_frame", "translation_m_per_frame"),
        "depth": ("depth_m", "depth_relative", "depth_per_m"),
        "clock": ("clock_ms",),
        "readout": ("readout_ms",),
        "focal": ("focal_relative",),
    }
)
"""What can be wrong with a truth, and the figures of `TruthAccuracy` that say by how much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthAccuracy:
    """Standard deviations of the errors of a truth, from one source. None is unknown, 0 is exact.

    Only the relative error of the poses of two frames moves a true position. Laws of its growth are stated, not
    absolute figures (accuracy.growth). Frames are those of the recording, rotations and translations are per axis.

    Parameters
    ----------
    rotation_white_deg, translation_white_m
        Error of each pose, independent from frame to frame; two frames differ by sqrt(2) times as much.
    rotation_deg_per_sqrt_frame, translation_m_per_sqrt_frame
        Error of the relative pose of two successive frames, where it grows as a random walk.
    rotation_deg_per_frame, translation_m_per_frame
        The same, where it grows in proportion to the time, as by a wrong velocity.
    depth_m, depth_relative, depth_per_m
        Error of a depth Z: sqrt(depth_m^2 + (depth_relative Z)^2 + (depth_per_m Z^2)^2).
    clock_ms
        Offset between the clocks of images and poses, milliseconds.
    readout_ms
        Readout time of a rolling shutter that the truth does not account for, milliseconds.
    focal_relative
        Error of the focal length as a share of it; that of both axes is the same.
    source
        Where the figures are published, or who states them.
    kind
        How they were found.

    Raises
    ------
    ValueError
        If a figure is negative or not finite.
    """

    rotation_white_deg: float | None = None
    rotation_deg_per_sqrt_frame: float | None = None
    rotation_deg_per_frame: float | None = None
    translation_white_m: float | None = None
    translation_m_per_sqrt_frame: float | None = None
    translation_m_per_frame: float | None = None
    depth_m: float | None = None
    depth_relative: float | None = None
    depth_per_m: float | None = None
    clock_ms: float | None = None
    readout_ms: float | None = None
    focal_relative: float | None = None
    source: str = ""
    kind: AccuracyKind = AccuracyKind.stated

    def __post_init__(self) -> None:
        for names in TOPICS.values():
            for name, value in self.figures(names).items():
                if not isfinite(value) or value < 0.0:
                    raise ValueError(f"{name} = {value}, expected a finite number of at least 0")

    def __repr__(self) -> str:
        return constructed(self)

    @classmethod
    def of(cls, pose: PoseAccuracy | None, depth: DepthAccuracy | None, *, source: str) -> "TruthAccuracy":
        """What is stated about poses and depths of a recording; None where nothing is."""
        moved_m, turned_rad = (None, None) if pose is None else (pose.position_m, pose.rotation_rad)
        return cls(
            translation_white_m=moved_m,
            rotation_white_deg=None if turned_rad is None else float(np.degrees(turned_rad)),
            depth_m=None if depth is None else depth.constant_m,
            depth_relative=None if depth is None else depth.relative,
            depth_per_m=None if depth is None else depth.quadratic_per_m,
            source=source,
        )

    def figures(self, names: tuple[str, ...]) -> dict[str, float]:
        """The figures of these names that are known."""
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def topics(self) -> frozenset[str]:
        """Names of `TOPICS` of which any figure is known."""
        return frozenset(topic for topic, names in TOPICS.items() if self.figures(names))

    @property
    def is_exact(self) -> bool:
        """Whether no figure is above 0."""
        return not any(value for names in TOPICS.values() for value in self.figures(names).values())

    @property
    def rotation(self) -> GrowthLaw:
        """Growth of the relative error of rotation, rad."""
        return GrowthLaw(*(float(np.radians(getattr(self, name) or 0.0)) for name in TOPICS["rotation"]))

    @property
    def translation(self) -> GrowthLaw:
        """Growth of the relative error of translation, metres."""
        return GrowthLaw(*(getattr(self, name) or 0.0 for name in TOPICS["translation"]))

    @property
    def depth(self) -> DepthAccuracy:
        """Error of a depth."""
        return DepthAccuracy(*(getattr(self, name) or 0.0 for name in TOPICS["depth"]))

    def over(self, other: "TruthAccuracy") -> "TruthAccuracy":
        """Figures of this one, and those of the other on topics of which this one knows nothing; source of this one."""
        taken = [name for topic in other.topics - self.topics for name in TOPICS[topic]]
        figures: dict[str, Any] = {name: getattr(other, name) for name in taken}
        return replace(self, **figures)

    def without(self, topics: Iterable[str]) -> "TruthAccuracy":
        """The same, as if nothing were known on these topics."""
        unknown: dict[str, Any] = dict.fromkeys(name for topic in topics for name in TOPICS[topic])
        return replace(self, **unknown)
