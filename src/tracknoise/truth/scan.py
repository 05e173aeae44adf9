"""Truth from a single scan: features found in the key frame are associated with the scan points seen there."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import Anchor, AnchoredTruth
from tracknoise.truth.scan_points import ScanPoints
from tracknoise.truth.scan_rule import SCAN_RULE, ScanRule
from tracknoise.truth.sequence_geometry import SequenceGeometry
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.visibility import DepthMapSurface


@dataclass(frozen=True, slots=True)
class KeyFrameScan:
    """The scan point next to each feature in the key frame: (truth.scan).

    Parameters
    ----------
    rule
        How features are associated with the scan.
    """

    kind: ClassVar[str] = TruthKind.scan

    rule: ScanRule = SCAN_RULE

    def open(self, sequence: Sequence) -> "ScanTruth":
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If the sequence has no scan, its file is missing or damaged, or the key frame has no pose.
        """
        scan = sequence.scan
        if scan is None:
            raise DataError(sequence.source, "no scan", "one, as the sequence offers the truth 'scan'")
        geometry = SequenceGeometry(sequence)
        if 0 <= scan.key_frame < len(sequence) and not geometry.has_pose(scan.key_frame):
            found = f"no pose of the key frame {scan.key_frame}"
            raise DataError(sequence.source, found, "one, so that features can be associated with the scan")
        points = ScanPoints(geometry, scan.points_world, self.rule)
        return ScanTruth(geometry, points.anchor, scan.key_frame)


class ScanTruth(AnchoredTruth):
    """A truth that gives a world point to each track that is found in the key frame.

    Parameters
    ----------
    geometry
        Of the sequence.
    anchor
        Finds the world points of features.
    key_frame
        The frame in which features are anchored.
    """

    __slots__ = ("_key_frame",)

    def __init__(self, geometry: SequenceGeometry, anchor: Anchor, key_frame: int) -> None:
        super().__init__(TruthKind.scan, geometry, anchor, DepthMapSurface(geometry))
        self._key_frame = key_frame

    @property
    def key_frame(self) -> int:
        """The frame in which features are anchored."""
        return self._key_frame

    def start(self) -> "KeyFrameSession":
        """Start a session for one tracker setup."""
        return KeyFrameSession(self)


class KeyFrameSession:
    """The tracks of one tracker setup, anchored in the key frame where they are found there.

    Earlier observations wait for the key frame: only then are their true positions known.

    Parameters
    ----------
    truth
        Finds and projects the anchors.
    """

    __slots__ = ("_tracks", "_truth", "_waiting")

    def __init__(self, truth: ScanTruth) -> None:
        self._truth = truth
        self._tracks = truth.tracks()
        self._waiting: list[tuple[int, NDArray[np.uint32], NDArray[np.float64]]] = []

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Anchor tracks in the key frame, and locate them: see `tracknoise.truth.truth.TruthSession.observe`."""
        new = int(np.count_nonzero(born))
        self._tracks.begin(index, np.full((new, 3), np.nan), np.full(new, TruthStatus.no_depth, np.int8))
        is_anchored = index == self._truth.key_frame
        self._waiting.append((index, tracks, uv if is_anchored else np.full_like(uv, np.nan)))
        if is_anchored:
            self._tracks.anchor(tracks, *self._truth.anchor(index, uv))
        if index >= self._truth.key_frame:
            self._locate_waiting()

    def resolve(self) -> TruePositions:
        """True positions of all observations: see `tracknoise.truth.truth.TruthSession.resolve`."""
        self._locate_waiting()
        return self._tracks.positions()

    def _locate_waiting(self) -> None:
        for waiting in self._waiting:
            self._tracks.locate(*waiting)
        self._waiting = []
