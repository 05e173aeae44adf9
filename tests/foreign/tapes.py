"""What another package may hold: a reader of NumPy archives, a tracker of fixed points and a truth with a covariance.

No file of tracknoise knows of it. `tests/test_plugins.py` installs it with entry points.
"""

from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId
from tracknoise.trackers.tracker import Frame, SequenceContext, Step
from tracknoise.truth.birth import BirthDepth
from tracknoise.truth.truth import TruePositions, Truth, TruthSession

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


@dataclass(frozen=True, slots=True)
class Images:
    """Frames of an archive, of which one is in memory at a time."""

    path: Path
    grey_offset: int

    def __call__(self, index: int) -> np.ndarray:
        with np.load(self.path) as tape:
            return tape[f"image{index}"] + np.uint8(self.grey_offset)


@dataclass(frozen=True, slots=True)
class Depths:
    """Depths of an archive; 0 is none."""

    path: Path

    def __call__(self, index: int) -> DepthMap:
        with np.load(self.path) as tape:
            depth_m = tape[f"depth{index}"]
        return DepthMap(depth_m, depth_m > 0)


@dataclass(frozen=True, slots=True)
class Tape:
    """Reader of archives ``NAME.npz`` with poses, times, image0, image1, ..., depth0, depth1, ..."""

    name: ClassVar[str] = "tape"
    description: ClassVar[str] = "NumPy archives"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    brightness: Path | None = None

    def sequences(self) -> list[SequenceId]:
        found = sorted(path.stem for path in self.root.glob("*.npz"))
        if not found:
            raise DataError(self.root, "no tape", "files such as a.npz")
        return [SequenceId(self.name, scene) for scene in found]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        scenes = {item.scene for item in self.sequences()}
        if sequence.scene not in scenes:
            raise UnknownNameError("scene", sequence.scene, scenes)
        if sequence.lighting != DEFAULT_LIGHTING:
            raise UnknownNameError("lighting", sequence.lighting, [DEFAULT_LIGHTING])
        path = self.root / f"{sequence.scene}.npz"
        grey_offset = 0 if self.brightness is None else int(self.brightness.read_text())
        with np.load(path) as tape:
            return RecordedSequence(
                id=sequence,
                source=str(path),
                camera=CAMERA,
                world_from_camera=tape["poses"],
                images=Images(path, grey_offset),
                depths=Depths(path),
                timestamps_s=tape["times"],
                notes=("frames come from an archive",),
            )


@dataclass(frozen=True, slots=True)
class Limits:
    """Settings within settings."""

    most: int | None = None
    least: int = 1


@dataclass(frozen=True, slots=True)
class Fixed:
    """Tracker that takes features to stay where a file says that they are."""

    kind: ClassVar[str] = "fixed"
    description: ClassVar[str] = "points that never move"

    points: Path
    limits: Limits = Limits()

    def start(self, context: SequenceContext) -> "FixedTracker":
        return FixedTracker(np.loadtxt(self.points, ndmin=2))


class FixedTracker:
    def __init__(self, uv: np.ndarray) -> None:
        self._uv, self._alive = uv, 0

    def step(self, frame: Frame) -> Step:
        n, offered = len(self._uv), self._alive
        self._alive = n
        return Step(
            ids=np.arange(n),
            uv=self._uv,
            born=np.full(n, not offered),
            response=np.full(n, np.nan, np.float32),
            ended_ids=np.empty(0, np.int64),
            ended=np.empty(0, np.int8),
            offered=offered,
            matched=offered,
            outliers=0,
            alive=n,
        )


@dataclass(frozen=True, slots=True)
class Stated:
    """Truth from depth whose uncertainty is known."""

    kind: ClassVar[str] = "stated"

    sigma_px: float = 0.5

    def open(self, sequence: Sequence) -> Truth:
        return StatedTruth(BirthDepth().open(sequence), self.sigma_px)


@dataclass(frozen=True, slots=True)
class StatedTruth:
    depth: Truth
    sigma_px: float
    kind: str = "stated"
    key_frame: None = None

    def start(self) -> TruthSession:
        return StatedSession(self.depth.start(), self.sigma_px)


class StatedSession:
    def __init__(self, depth: TruthSession, sigma_px: float) -> None:
        self.observe, self._depth, self._sigma_px = depth.observe, depth, sigma_px

    def resolve(self) -> TruePositions:
        found = self._depth.resolve()
        return replace(found, covariance=np.tile(self._sigma_px**2 * np.eye(2), (len(found.uv), 1, 1)))
