"""Truth without depth: the depth of each feature's first frame, from other images of known poses."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.sequences.poses import require_some_poses
from tracknoise.sequences.sequence import SWEPT, Sequence, second_of
from tracknoise.tables.schema import TruthStatus
from tracknoise.text import significant
from tracknoise.truth.anchored import AnchoredTruth, Anchors, anchor_points
from tracknoise.truth.pair_unit import PairUnit, pair_unit
from tracknoise.truth.plane_sweep import PlaneSweep, Swept
from tracknoise.truth.sweep_views import Cameras
from tracknoise.truth.visibility import SequenceGeometry, UnknownSurface


@dataclass(frozen=True, slots=True)
class SweptDepth:
    """Depth at birth by a plane sweep (`tracknoise.truth.plane_sweep`), whatever the track does later.

    Nothing is known of what hides a point: one in the image and in front of the camera counts as visible. A second
    camera takes no part where depths by it show that poses are in another unit than its distance
    (`tracknoise.truth.pair_unit`).
    """

    kind: ClassVar[str] = SWEPT

    def open(self, sequence: Sequence) -> AnchoredTruth:
        """Make the truth of one sequence. Features whose depth the images do not determine get no true position.

        Raises
        ------
        DataError
            If fewer than two frames have a pose.
        """
        require_some_poses(sequence.world_from_camera, sequence.source)
        geometry = SequenceGeometry(sequence)
        births = _Births(geometry)
        return AnchoredTruth(
            self.kind, geometry, births.anchor, UnknownSurface(), depth_sigma=births.depth_sigma, note=births.note
        )


class _Births:
    """Depths of features in their first frame. Those of one frame are kept: several trackers and speeds share them."""

    __slots__ = ("_found", "_geometry", "_index", "_sweep", "_unit")

    def __init__(self, geometry: SequenceGeometry) -> None:
        self._geometry = geometry
        self._sweep: PlaneSweep | None = None
        self._unit: PairUnit | None = None  # known where there is a second camera, once depths were asked for
        self._index: int | None = None
        self._found: dict[tuple[float, ...], tuple[float, float, bool]] = {}

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchors:
        """World points of features; no_depth where the images determine none, and edge next to another surface."""
        swept = self._swept(index, uv)
        inverse, has_depth = swept.inverse_depth, np.isfinite(swept.inverse_depth)
        status = np.where(has_depth, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)
        status[swept.at_edge] = TruthStatus.edge
        return anchor_points(self._geometry, index, uv, 1.0 / np.where(has_depth, inverse, 1.0), status)

    def depth_sigma(self, index: int, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64, metres: standard deviation of the depth of features; NaN where there is no depth."""
        swept = self._swept(index, uv)
        return swept.sigma / np.square(swept.inverse_depth)

    def note(self) -> str | None:
        """What is to be said of the second camera; None where there is nothing to be said."""
        unit = self._unit
        if unit is None or unit.is_same:
            return None
        difference = f"depths by the poses are {significant(unit.ratio, 3)} times those by the second camera"
        return f"{difference}: its images are not used, as poses are not in metres, or its place is wrong"

    def _opened(self) -> PlaneSweep:
        if self._sweep is None:
            if second_of(self._geometry.sequence) is not None:
                self._unit = pair_unit(self._geometry)
            alone = self._unit is not None and not self._unit.is_same
            self._sweep = PlaneSweep(self._geometry, Cameras.first if alone else Cameras.both)
        return self._sweep

    def _swept(self, index: int, uv: NDArray[np.float64]) -> Swept:
        if index != self._index:
            self._index, self._found = index, {}
        keys = [tuple(position) for position in uv.tolist()]
        new = [key for key in dict.fromkeys(keys) if key not in self._found]
        if new:
            swept = self._opened().found(index, np.array(new))
            values = zip(swept.inverse_depth, swept.sigma, swept.at_edge, strict=True)
            self._found.update(zip(new, values, strict=True))
        inverse, sigma, at_edge = np.array([self._found[key] for key in keys]).reshape(-1, 3).T
        return Swept(inverse, sigma, at_edge > 0.0)
