"""Truth from the exact surface of a simulated world."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import EXACT_DEPTH
from tracknoise.geometry.surroundings import Surroundings, around, find_surroundings
from tracknoise.sequences.sequence import Sequence, Surface, TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import AnchoredTruth, Anchors, anchor_points
from tracknoise.truth.visibility import Depths, SequenceGeometry


@dataclass(frozen=True, slots=True)
class RayCast:
    """The exact surface point under each feature in its first frame."""

    kind: ClassVar[str] = TruthKind.raycast

    def open(self, sequence: Sequence) -> AnchoredTruth:
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If the sequence has no exact surface.
        """
        surface = sequence.surface
        if surface is None:
            raise DataError(sequence.source, "no exact surface", "one, as the sequence offers the truth 'raycast'")
        geometry = SequenceGeometry(sequence)
        exact = ExactSurface(geometry, surface)
        return AnchoredTruth(self.kind, geometry, exact.anchor, exact, exact.surroundings)


class ExactSurface:
    """The exact surface of a simulated world: where features are anchored, and what occludes points."""

    __slots__ = ("_geometry", "_surface")

    def __init__(self, geometry: SequenceGeometry, surface: Surface) -> None:
        self._geometry = geometry
        self._surface = surface

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """Exact depth: see `tracknoise.truth.visibility.VisibleSurface.depths`. Unknown where the ray hits nothing.

        Only the depth of the point that was hit is used: the direction of the ray is known more accurately than the
        ray caster computes it.
        """
        points_world, hit = self._surface.cast(index, uv)
        depth_m = self._geometry.to_camera(index, uv, np.where(hit[:, None], points_world, 0.0))[:, 2]
        return np.where(hit, depth_m, 1.0), hit

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchors:
        """World points of features; no_depth where the ray hits nothing."""
        depth_m, hit = self.depths(index, uv)
        status = np.where(hit, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)
        return anchor_points(self._geometry, index, uv, depth_m, status)

    def surroundings(self, index: int, uv: NDArray[np.float64]) -> Surroundings:
        """Surroundings of features by the depth of the exact surface around them, infinite where a ray hits nothing."""
        camera, pixels = self._geometry.camera_at(index), around(uv)
        depth_m, hit = self.depths(index, pixels)
        return find_surroundings(camera, uv, np.where(hit, depth_m, np.inf), camera.contains(pixels), EXACT_DEPTH)
