"""What another package may hold: a reader of NumPy archives and a tracker of fixed points, both with files as options.

No file of tracknoise knows of it. `tests/test_plugins.py` installs it with entry points.
"""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.tracker import SequenceContext, Step

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
class Fixed:
    """Tracker that takes features to stay where a file says that they are."""

    kind: ClassVar[str] = "fixed"
    description: ClassVar[str] = "points that never move"

    points: Path

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
