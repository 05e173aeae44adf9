"""One sequence of a run for the viewer Rerun: images, tracks with their errors, true points and path of the camera.

The package `rerun` is imported when a recording is written, because it is an extra.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataWarning, SettingsError, StoreError, UnknownNameError, missing_extra
from tracknoise.experiments.geometry_tables import frame_geometry
from tracknoise.experiments.measured_poses import with_measured_poses
from tracknoise.experiments.plan import Task, open_batch
from tracknoise.experiments.settings import parse_experiment
from tracknoise.geometry.projection import FrameGeometry, projection_jacobian
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import of_second_camera
from tracknoise.tables.store import RunFolder


@dataclass(frozen=True, slots=True)
class TrackerScene:
    """What one tracker saw at the lowest speed."""

    # Columns track, frame, u_px, v_px, u_true_px, v_true_px and error_px, in the order of frames and tracks. The true
    # position and the length of the error are null where they are unknown.
    observations: pl.DataFrame
    # columns track, x_m, y_m and z_m: the true points in the world, of tracks whose depth is known
    points: pl.DataFrame


@dataclass(frozen=True, slots=True)
class Scene:
    """One sequence."""

    sequence: Sequence  # its images
    n_frames: int  # how many of them were measured
    geometry: FrameGeometry  # poses and cameras
    trackers: Mapping[str, TrackerScene]  # by name

    def large_error_px(self) -> float:
        """Error that is larger than 95 % of the known ones; 1 where none is known."""
        errors = pl.concat([part.observations["error_px"] for part in self.trackers.values()]).drop_nulls()
        large_px = errors.quantile(0.95)
        return float(large_px) if large_px else 1.0


def open_scene(run: RunFolder, scene: str | None = None) -> Scene:
    """Open the data of a sequence of a run, and read what its trackers saw."""
    entry = _entry(run, scene)
    experiment = parse_experiment(run.experiment_toml(), place=str(run.path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the notes of the run contain the same text
        (opened,) = open_batch([Task(experiment, entry.sequence, tuple(experiment.speeds))])
    sequence = with_measured_poses(opened, [(run, entry, 0)])
    geometry = frame_geometry(sequence, entry.n_frames)
    tables = {name: run.sequence_table(name, entry.key) for name in ("observations", "tracks")}
    slowest = {name: table.filter(pl.col("speed") == table["speed"].min()) for name, table in tables.items()}
    beside = of_second_camera(slowest["observations"])
    names = [name for name in slowest["tracks"]["tracker"].unique(maintain_order=True) if name not in beside]
    trackers = {name: _tracker(slowest, name, geometry) for name in names}
    if not trackers:
        raise StoreError(f"{run.path}: {entry.key} has no track, expected at least one")
    return Scene(sequence, entry.n_frames, geometry, trackers)


def _entry(run: RunFolder, scene: str | None) -> SequenceEntry:
    entries = [entry for _, entry in sorted(run.manifest().sequences.items())]
    if not entries:
        raise SettingsError(f"{run.path}: no measured sequence, expected a finished run")
    chosen = [entry for entry in entries if scene is None or entry.sequence.scene == scene]
    if not chosen:
        raise UnknownNameError("scene", str(scene), {entry.sequence.scene for entry in entries})
    return chosen[0]


def _tracker(tables: Mapping[str, pl.DataFrame], name: str, geometry: FrameGeometry) -> TrackerScene:
    error = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt()
    columns = ("track", "frame", "u_px", "v_px", "u_true_px", "v_true_px")
    seen = tables["observations"].filter(tracker=name)
    observations = seen.select(*columns, error_px=error).sort("frame", "track")
    return TrackerScene(observations, _points(seen, tables["tracks"].filter(tracker=name), geometry))


def _points(observations: pl.DataFrame, tracks: pl.DataFrame, geometry: FrameGeometry) -> pl.DataFrame:
    """True points of tracks whose depth is known, from their first observations."""
    depths = tracks.select("track", "depth_m").drop_nulls()
    first = observations.filter(age=0).drop_nulls("u_true_px").join(depths, on="track", how="inner").sort("track")
    uv = first.select("u_true_px", "v_true_px").to_numpy()
    points: NDArray[np.float64] = geometry.unproject(
        first["frame"].to_numpy().astype(np.int64), uv, first["depth_m"].to_numpy()
    )
    table = first.select("track", x_m=points[:, 0], y_m=points[:, 1], z_m=points[:, 2])
    return table.filter(pl.all_horizontal(pl.col("x_m", "y_m", "z_m").is_finite()))


_JPEG_QUALITY = 80
_UNKNOWN = (150, 150, 150)
_SMALL, _LARGE = np.array([0.0, 114.0, 178.0]), np.array([213.0, 94.0, 0.0])
"""Colours of no error and of large ones."""
_IMAGE = ("world", "camera", "image")


def write_recording(run: RunFolder, path: Path, *, scene: str | None = None) -> None:
    """Write a recording of one sequence.

    Parameters
    ----------
    run
        A run that keeps its observations, whose data are still where they were.
    path
        Of the file, usually ``*.rrd``.
    scene
        Name of a scene; by default the first.

    Raises
    ------
    SettingsError
        If the extra `rerun` is not installed.
    StoreError
        If the file cannot be written.
    TracknoiseError
        If the run or its data cannot be read.
    """
    rerun = _imported()
    shown = open_scene(run, scene)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror}), expected a writable file") from error
    recording = rerun.RecordingStream("tracknoise", recording_id=str(shown.sequence.id.key))
    recording.save(path, default_blueprint=_blueprint(rerun))
    _log_still(rerun, recording, shown)
    for index in range(shown.n_frames):
        recording.set_time("frame", sequence=index)
        _log_frame(rerun, recording, shown, index)
    recording.flush()
    recording.disconnect()


def _imported() -> Any:
    try:
        import rerun
        import rerun.blueprint
    except ImportError as error:
        raise missing_extra("a recording for Rerun", "rerun") from error
    return rerun


def _blueprint(rerun: Any) -> Any:
    """Three views: the world, the image, and errors by frame."""
    views = rerun.blueprint
    right = views.Vertical(
        views.Spatial2DView(origin="/".join(_IMAGE), name="tracks and errors"),
        views.TimeSeriesView(origin="errors", name="median error, px"),
        row_shares=[2, 1],
    )
    return views.Blueprint(views.Horizontal(views.Spatial3DView(origin="world", name="true points and camera"), right))


def _log_still(rerun: Any, recording: Any, scene: Scene) -> None:
    """What does not change: true points and the path of the camera."""
    centres = scene.geometry.world_from_camera[:, :3, 3]
    placed = centres[np.isfinite(centres).all(axis=1)]
    recording.log("world/path", rerun.LineStrips3D([placed], colors=[_UNKNOWN]), static=True)
    for name, tracker in scene.trackers.items():
        worst = tracker.observations.group_by("track").agg(pl.col("error_px").max())
        points = tracker.points.join(worst, on="track", how="left", maintain_order="left")
        shown = rerun.Points3D(
            points.select("x_m", "y_m", "z_m").to_numpy(), colors=_colours(points, scene.large_error_px())
        )
        recording.log(["world", "points", name], shown, static=True)


def _log_frame(rerun: Any, recording: Any, scene: Scene, index: int) -> None:
    """Camera, image, and what every tracker reports in a frame."""
    pose = scene.geometry.world_from_camera[index]
    if np.isfinite(pose).all():
        recording.log([*_IMAGE[:-1]], rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
    image = scene.sequence.image(index)
    recording.log([*_IMAGE], _pinhole(rerun, scene.geometry, index, image.shape))
    recording.log([*_IMAGE], rerun.Image(image).compress(jpeg_quality=_JPEG_QUALITY))
    for name, tracker in scene.trackers.items():
        _log_tracker(rerun, recording, name, tracker.observations.filter(frame=index), scene.large_error_px())


def _log_tracker(rerun: Any, recording: Any, name: str, seen: pl.DataFrame, large_px: float) -> None:
    if seen.is_empty():
        return
    uv, colours = seen.select("u_px", "v_px").to_numpy(), _colours(seen, large_px)
    recording.log([*_IMAGE, name, "tracks"], rerun.Points2D(uv, colors=colours, radii=2.0))
    with_truth = seen["error_px"].is_not_null().to_numpy()
    true_uv = seen.select("u_true_px", "v_true_px").to_numpy()
    errors = rerun.LineStrips2D(np.stack([true_uv, uv], axis=1)[with_truth], colors=colours[with_truth])
    recording.log([*_IMAGE, name, "errors"], errors)
    median = seen["error_px"].median()
    if median is not None:
        recording.log(["errors", name], rerun.Scalars(median))


def _pinhole(rerun: Any, geometry: FrameGeometry, index: int, shape: tuple[int, ...]) -> Any:
    """The pinhole camera that is closest to that of a frame in the middle of its image."""
    camera = geometry.cameras[geometry.which[index]]
    centre = np.array([[shape[1] / 2.0, shape[0] / 2.0]])
    by_point = projection_jacobian(camera, camera.unproject(centre, np.ones(1)))[0]
    axis = camera.project(np.array([[0.0, 0.0, 1.0]]))[0]
    return rerun.Pinhole(
        focal_length=[by_point[0, 0], by_point[1, 1]], principal_point=axis, width=shape[1], height=shape[0]
    )


def _colours(table: pl.DataFrame, large_px: float) -> NDArray[np.uint8]:
    """(rows, 3): from blue for no error to orange for large ones; grey where it is unknown."""
    errors = table["error_px"].to_numpy().astype(np.float64)
    share = np.clip(np.nan_to_num(errors) / large_px, 0.0, 1.0)[:, None]
    mixed = _SMALL + share * (_LARGE - _SMALL)
    return np.where(np.isnan(errors)[:, None], _UNKNOWN, mixed).astype(np.uint8)
