"""Observations that take part in an audit, with what the truth states about them, as arrays."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.motion import Paths
from tracknoise.geometry.intrinsics import Intrinsics
from tracknoise.tables.enumerations import Resampled


@dataclass(frozen=True, slots=True, eq=False)
class AuditSamples:
    """n observations of several trackers in several sequences.

    Attributes
    ----------
    trackers
        Names of the trackers.
    tracker, age : (n,) intp
        Place in `trackers`; frames since birth.
    cluster, block : (n,) intp
        Number of what is left out at a time: scenes, groups or blocks; and of the block of tracks within its scene.
        Both from 0, without gaps.
    resampled, n_scenes
        What the clusters are, and the number of scenes.
    birth, now : (n,) intp
        Frames, as places in `paths`.
    uv_at_birth, observed, stated : (n, 2) float64
        Position in the first frame, observed position, and true position as stated, px.
    depth : (n,) float64
        In the first frame, metres.
    paths
        Poses of all frames of all sequences.
    cameras, camera : (frames,) intp
        Different cameras, and the place of each frame's camera.
    readout_of : (frames,) float64
        Stated readout of each frame.
    axis_of : (frames,) intp
        Coordinate along which the shutter moves.
    interval_s
        Median time between frames, seconds: the unit of time. None where it is unknown.
    z_depth_from
        What depths that are along z by construction were computed from; None where their kind is only stated.
    """

    trackers: tuple[str, ...]
    tracker: NDArray[np.intp]
    age: NDArray[np.intp]
    cluster: NDArray[np.intp]
    block: NDArray[np.intp]
    resampled: Resampled
    n_scenes: int
    birth: NDArray[np.intp]
    now: NDArray[np.intp]
    uv_at_birth: NDArray[np.float64]
    observed: NDArray[np.float64]
    stated: NDArray[np.float64]
    depth: NDArray[np.float64]
    paths: Paths
    cameras: tuple[Intrinsics, ...]
    camera: NDArray[np.intp]
    readout_of: NDArray[np.float64]
    axis_of: NDArray[np.intp]
    interval_s: float | None
    z_depth_from: str | None = None

    @property
    def n_clusters(self) -> int:
        """How many clusters there are."""
        return int(self.cluster.max(initial=-1)) + 1

    @property
    def by_blocks(self) -> "AuditSamples":
        """The same observations, with blocks of tracks as clusters."""
        return replace(self, cluster=self.block, resampled=Resampled.blocks)

    @property
    def group(self) -> NDArray[np.intp]:
        """Number of the tracker and age of each observation, (n,): those with a scale of their own."""
        return np.asarray(self.tracker * (self.age.max(initial=0) + 1) + self.age)

    @property
    def readout(self) -> NDArray[np.float64]:
        """Stated readout of each observation, (n,), in frame intervals."""
        return self.readout_of[self.now]

    @property
    def axis(self) -> NDArray[np.intp]:
        """Coordinate along which the shutter of each observation moves, (n,)."""
        return self.axis_of[self.now]

    @property
    def side(self) -> NDArray[np.float64]:
        """Size of the image along which the shutter moves, (n,), px."""
        sizes = np.array([(camera.width, camera.height) for camera in self.cameras], dtype=np.float64)
        sides: NDArray[np.float64] = sizes[self.camera[self.now], self.axis]
        return sides

    def along_shutter(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates of vectors (n, 2) along which the shutter moves, (n,)."""
        return np.take_along_axis(vectors, self.axis[:, None], axis=1)[:, 0]

    def phase(self, row: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time of rows after that of their frame, in units of the readout, (n,): from -0.5 to 0.5."""
        phase: NDArray[np.float64] = (row + 0.5) / self.side - 0.5
        return phase

    @property
    def phase_at_birth(self) -> NDArray[np.float64]:
        """`phase` of the position in the first frame, (n,)."""
        return self.phase(self.along_shutter(self.uv_at_birth))

    def chosen(self, rows: NDArray[np.intp]) -> "AuditSamples":
        """Some of the observations, whose clusters and blocks are numbered again without gaps."""
        names = ("tracker", "age", "birth", "now", "uv_at_birth", "observed", "stated", "depth")
        some = {name: getattr(self, name)[rows] for name in names}
        cluster, block = _numbered(self.cluster[rows]), _numbered(self.block[rows])
        return replace(self, cluster=cluster, block=block, **some)


def _numbered(labels: NDArray[np.intp]) -> NDArray[np.intp]:
    """The same labels from 0, without gaps."""
    return np.unique(labels, return_inverse=True)[1].astype(np.intp)
