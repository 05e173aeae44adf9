"""Write a recording for the viewer Rerun: images, tracks coloured by error, true points and the path of the camera.

The package `rerun` is imported when a recording is written, because it is an extra.
"""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import StoreError, missing_extra
from tracknoise.experiments.view3d.scene import Scene, open_scene
from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.geometry.jacobians import projection_jacobian
from tracknoise.tables.store import RunFolder

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
    known = centres[np.isfinite(centres).all(axis=1)]
    recording.log("world/path", rerun.LineStrips3D([known], colors=[_UNKNOWN]), static=True)
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
    known = seen["error_px"].is_not_null().to_numpy()
    true_uv = seen.select("u_true_px", "v_true_px").to_numpy()
    errors = rerun.LineStrips2D(np.stack([true_uv, uv], axis=1)[known], colors=colours[known])
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
