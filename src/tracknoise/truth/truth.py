"""Where features really are in every frame of a sequence."""

from collections.abc import Callable
from collections.abc import Sequence as Items
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.truth.anchor import Anchored, BirthDepth, RayCast, fix
from tracknoise.truth.frames import Frames
from tracknoise.truth.scan import ScanPoints, ScanRule
from tracknoise.truth.visibility import Measured, MeasuredDepth, MeasuredSurface, visibility

SCAN_RULE = ScanRule()
"""How features are associated with a scan unless said otherwise."""

Fix = Callable[[int, NDArray[np.float64]], Anchored]
"""Takes a frame and pixels (n, 2) of it; gives world points (n, 3) and their status (n,)."""


class Truth:
    """True positions of features: a `tracknoise.trackers.tracker.TruePositions`.

    All methods accept any count of features, 0 included, and treat each for itself. Nothing grows with the count of
    frames; calls about one frame are best made together, as the depth of the latest frame alone is kept.

    Parameters
    ----------
    kind
        Which kind of truth this is.
    frames
        The sequence.
    fix
        How features are fixed in the world.
    measured
        What hides points behind it.
    key_frame
        The one frame in which features are fixed; None where each is in its first.
    """

    __slots__ = ("_fix", "_frames", "_measured", "key_frame", "kind")

    def __init__(
        self, kind: TruthKind, frames: Frames, fix: Fix, measured: Measured, *, key_frame: int | None = None
    ) -> None:
        self.kind = kind
        self.key_frame = key_frame
        self._frames = frames
        self._fix = fix
        self._measured = measured

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """World points of features by where they are in a frame: X_w = world_from_camera pi^-1(x, Z).

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        points_world : (n, 3) float64
            Metres; NaN where the status is not valid.
        status : (n,) int8
            `tracknoise.tables.schema.TruthStatus`: valid, no_depth or edge.

        Raises
        ------
        DataError
            If the frame's depth cannot be read.
        """
        return self._fix(index, uv)

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """True positions of world points in a frame: x_true = pi(camera_from_world X_w).

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.

        Returns
        -------
        (n, 2) float64
            px; NaN behind the camera, and where its distortion has no image. Points outside the image are projected
            all the same.
        """
        return self._frames.camera.project(self._frames.to_camera(index, points_world))

    def visibility(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.int8]:
        """Whether anchored points can be seen in a frame.

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres, finite: of features whose anchor is valid.

        Returns
        -------
        (n,) int8
            `tracknoise.tables.schema.TruthStatus`: behind_camera, out_of_image, occluded or valid.

        Raises
        ------
        DataError
            If the frame's depth cannot be read.
        """
        return visibility(self._frames, self._measured, index, points_world)


def make_truth(sequence: Sequence, kind: TruthKind | None = None, *, scan_rule: ScanRule = SCAN_RULE) -> Truth:
    """The truth of a sequence.

    Parameters
    ----------
    sequence
        The sequence.
    kind
        How features are fixed in the world; by default the best that the sequence offers.
    scan_rule
        How features are associated with a scan, where that fixes them.

    Raises
    ------
    DataError
        If the sequence offers no truth at all.
    SettingsError
        If it does not offer this kind.
    """
    place, offered = sequence.source, sequence.truths
    if not offered:
        raise DataError(place, "no depth, scan or exact surface", "one of them, to know where features really are")
    kind = offered[0] if kind is None else kind
    if kind not in offered:
        raise SettingsError(f"{place}: found truth = {kind.value!r}, expected one of: {', '.join(offered)}")
    frames = Frames(sequence)
    if kind is TruthKind.raycast and (surface := sequence.surface) is not None:
        return Truth(kind, frames, partial(fix, frames, RayCast(frames, surface)), MeasuredSurface(frames, surface))
    if kind is TruthKind.scan and (scan := sequence.scan) is not None:
        points = ScanPoints(frames, scan, scan_rule)
        return Truth(kind, frames, points.points, MeasuredDepth(frames), key_frame=scan.key_frame)
    return Truth(kind, frames, partial(fix, frames, BirthDepth(frames)), MeasuredDepth(frames))


def make_truths(sequences: Items[Sequence], kind: TruthKind | None = None, *, scan_rule: ScanRule) -> list[Truth]:
    """The truth of each sequence; one for all that share a scan and are seen from the same places.

    Raises
    ------
    DataError, SettingsError
        As `make_truth`.
    """
    truths: list[Truth] = []
    for place, sequence in enumerate(sequences):
        twins = (truths[before] for before in range(place) if _is_same_scan(sequences[before], sequence))
        truths.append(next(twins, None) or make_truth(sequence, kind, scan_rule=scan_rule))
    return truths


def _is_same_scan(one: Sequence, other: Sequence) -> bool:
    """Whether all that truth knows of two sequences is the same scan from the same places."""
    if one.truths != (TruthKind.scan,) or other.truths != one.truths or one.camera != other.camera:
        return False
    scan, scanned = one.scan, other.scan
    if scan is None or scanned is None or scan.points_world is not scanned.points_world:
        return False
    return scan.key_frame == scanned.key_frame and np.array_equal(one.world_from_camera, other.world_from_camera)
