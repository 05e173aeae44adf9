"""Where features really are in every frame of a sequence."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.truth.anchor import Anchor, Anchored, BirthDepth, RayCast, fix
from tracknoise.truth.frames import Frames
from tracknoise.truth.visibility import Measured, MeasuredDepth, MeasuredSurface, visibility


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
    anchor
        How features are fixed in the world.
    measured
        What hides points behind it.
    """

    __slots__ = ("_anchor", "_frames", "_measured", "kind")

    def __init__(self, kind: TruthKind, frames: Frames, anchor: Anchor, measured: Measured) -> None:
        self.kind = kind
        self._frames = frames
        self._anchor = anchor
        self._measured = measured

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """World points of features first seen in a frame: X_w = world_from_camera pi^-1(x, Z).

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
        return fix(self._frames, self._anchor, index, uv)

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


def make_truth(sequence: Sequence, kind: TruthKind | None = None) -> Truth:
    """The truth of a sequence.

    Parameters
    ----------
    sequence
        The sequence.
    kind
        How features are fixed in the world; by default the best that the sequence offers.

    Raises
    ------
    DataError
        If the sequence offers no truth at all.
    SettingsError
        If it does not offer this kind.
    """
    place, offered = sequence.source, sequence.truths
    if not offered:
        raise DataError(place, "neither depth nor an exact surface", "one of them, to know where features really are")
    kind = offered[0] if kind is None else kind
    if kind not in offered:
        raise SettingsError(f"{place}: found truth = {kind.value!r}, expected one of: {', '.join(offered)}")
    frames, surface = Frames(sequence), sequence.surface
    if kind is TruthKind.raycast and surface is not None:
        return Truth(kind, frames, RayCast(frames, surface), MeasuredSurface(frames, surface))
    return Truth(kind, frames, BirthDepth(frames), MeasuredDepth(frames))
