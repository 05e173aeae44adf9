"""True positions in a second camera, of points that are fixed in the first."""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.sequences.second_camera import Beside
from tracknoise.sequences.sequence import SecondCamera, Sequence, second_of
from tracknoise.truth.anchored import AnchoredTracks, AnchoredTruth, BirthSession
from tracknoise.truth.truth import TruePositions, Truth, TruthSession
from tracknoise.truth.visibility import SequenceGeometry, UnknownSurface, locate


def beside(sequence: Sequence) -> Beside:
    """A sequence as its second camera sees it.

    Raises
    ------
    DataError
        If it has none.
    """
    return Beside(sequence, require_second_camera(sequence))


def require_second_camera(sequence: Sequence) -> SecondCamera:
    """The second camera of a sequence.

    Raises
    ------
    DataError
        If it has none.
    """
    second = second_of(sequence)
    if second is None:
        raise DataError(sequence.source, "one camera", "a second one, for trackers that find features there")
    return second


def beside_session(truth: Truth, sequence: Sequence) -> TruthSession:
    """A session for a tracker of the second camera, which receives its positions in the first.

    Raises
    ------
    DataError
        If the sequence has one camera.
    SettingsError
        If the truth fixes no point in the first frame of a track.
    """
    if not isinstance(truth, AnchoredTruth):
        expected = "one that fixes points in the first frame of a track, such as 'birth'"
        raise SettingsError(f"truth = {truth.kind!r} for trackers of a second camera, expected {expected}")
    return BesideSession(truth, SequenceGeometry(beside(sequence)))


class BesideSession:
    """The tracks of one tracker setup in a second camera. What hides a point from it is not known."""

    __slots__ = ("_first", "_side")

    def __init__(self, truth: AnchoredTruth, side: SequenceGeometry) -> None:
        self._first = BirthSession(truth)
        self._side = AnchoredTracks(side, partial(locate, side, UnknownSurface()))

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """See `tracknoise.truth.truth.TruthSession.observe`; positions (n, 2) are those in the first camera."""
        self._first.observe(index, tracks, uv, born)
        self._side.begin(index, *self._first.anchors(tracks[born]))
        self._side.locate(index, tracks, np.full(uv.shape, np.nan))

    def resolve(self) -> TruePositions:
        """True positions of all observations in the second camera, with those in the first."""
        first, side = self._first.resolve(), self._side.positions()
        return replace(side, surroundings=first.surroundings, depth_sigma_m=first.depth_sigma_m, first_uv=first.uv)
