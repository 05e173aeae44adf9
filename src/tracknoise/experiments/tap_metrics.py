"""Metrics of point trackers of a measurement, for comparison with results that are stated in them."""

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.statistics.tracks.tap import PointTracks, expected_feature_age, tap_vid
from tracknoise.tables.schema import ORIGIN, POINT_TRACKING, TruthStatus
from tracknoise.truth.registry import make_truth

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement

RASTER_PX = 256
"""Side of the images to which TAP-Vid scales positions."""
_METRICS = (*POINT_TRACKING,)[list(POINT_TRACKING).index("delta_avg") :]


@runtime_checkable
class LocatingTruth(Protocol):
    """A truth that knows where points are, and whether they are visible, in frames in which nothing observed them."""

    def anchor(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """World points (n, 3) of features in a frame, and their status."""
        ...

    def locate(self, index: int, points_world: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """Positions (n, 2) of world points in a frame, and their status."""
        ...


def tap_metrics(measurement: "Measurement") -> pl.DataFrame:
    """Metrics of TAP-Vid and expected feature age of every tracker and speed of a measured sequence.

    Parameters
    ----------
    measurement
        Of one sequence, whose truth is from depth maps (``birth``) or the exact surface (``raycast``).

    Returns
    -------
    polars.DataFrame
        Schema `POINT_TRACKING`, two rows per tracker and speed. `delta_avg`, `average_jaccard` and `occlusion_accuracy`
        are those of `tracknoise.statistics.tracks.tap.tap_vid`, followed by `expected_feature_age` and the values of
        each threshold. Benchmarks report means over sequences.

    Raises
    ------
    SettingsError
        If the truth cannot locate points in frames in which they were not observed.
    DataError
        If a depth map cannot be read.
    """
    truth = make_truth(measurement.sequence, measurement.truth)
    if not isinstance(truth, LocatingTruth):
        expected = "birth or raycast, which locate points where they were not observed"
        raise SettingsError(f"{measurement.sequence.source}: found truth = {measurement.truth!r}, expected {expected}")
    camera = measurement.sequence.camera
    scales = {"256x256": (RASTER_PX / camera.width, RASTER_PX / camera.height), "image": (1.0, 1.0)}
    rows = []
    for condition, seen in measurement.observations.group_by(list(ORIGIN), maintain_order=True):
        labels = dict(zip(ORIGIN, condition, strict=True))
        points = point_tracks(truth, seen, speed=int(labels["speed"]), n_frames=measurement.n_frames)
        rows += [labels | {"raster": name} | _metrics(points, scale) for name, scale in scales.items()]
    return pl.DataFrame(rows, schema=dict(POINT_TRACKING)).with_columns(pl.col(_METRICS).fill_nan(None))


def point_tracks(truth: LocatingTruth, seen: pl.DataFrame, *, speed: int, n_frames: int) -> PointTracks:
    """True positions of all tracks with a known point, in every frame that the tracker saw.

    Parameters
    ----------
    truth
        Of the sequence.
    seen
        The observations of one tracker and speed.
    speed
        Of the tracker.
    n_frames
        Number of frames that were read.

    Raises
    ------
    DataError
        If a depth map cannot be read.
    """
    track, column = (seen[name].to_numpy().astype(np.int64) for name in ("track", "frame"))
    column //= speed
    shape = int(track.max(initial=-1)) + 1, -(-n_frames // speed)
    reported = np.full((*shape, 2), np.nan)
    reported[track, column] = seen.select("u_px", "v_px").to_numpy()
    first = np.isfinite(reported[..., 0]).argmax(axis=1)
    world, true_px = np.full((shape[0], 3), np.nan), np.full((*shape, 2), np.nan)
    status = np.full(shape, TruthStatus.no_pose, dtype=np.int8)
    anchored = np.zeros(shape[0], dtype=np.bool_)
    for place in range(shape[1]):
        new = np.flatnonzero(first == place)
        world[new], found = truth.anchor(place * speed, reported[new, place])
        anchored[new] = found == TruthStatus.valid
        begun = np.flatnonzero(anchored & (first <= place))
        true_px[begun, place], status[begun, place] = truth.locate(place * speed, world[begun])
    return PointTracks(
        reported[anchored],
        true_px[anchored],
        (status == TruthStatus.valid)[anchored],
        (status != TruthStatus.no_pose)[anchored],
        first[anchored],
    )


def _metrics(points: PointTracks, scale: tuple[float, float]) -> dict[str, Any]:
    age = expected_feature_age(points, scale)
    return {"n_points": len(points.first), "expected_feature_age": age, **tap_vid(points, scale)}
