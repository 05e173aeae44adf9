"""What a view of one sequence shows: its images, and the tracks and true points of each tracker."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataWarning, SettingsError, StoreError, UnknownNameError
from tracknoise.experiments.frame_geometry import frame_geometry
from tracknoise.experiments.running.plan import Task, open_batch
from tracknoise.experiments.settings import parse_experiment
from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder


@dataclass(frozen=True, slots=True)
class TrackerScene:
    """What one tracker saw at the lowest speed.

    Attributes
    ----------
    observations
        Columns track, frame, u_px, v_px, u_true_px, v_true_px and error_px, in the order of frames and tracks. The true
        position and the length of the error are null where they are unknown.
    points
        Columns track, x_m, y_m and z_m: the true points in the world, of tracks whose depth is known.
    """

    observations: pl.DataFrame
    points: pl.DataFrame


@dataclass(frozen=True, slots=True)
class Scene:
    """One sequence.

    Attributes
    ----------
    sequence
        Its images.
    n_frames
        How many of them were measured.
    geometry
        Poses and cameras.
    trackers
        By name.
    """

    sequence: Sequence
    n_frames: int
    geometry: FrameGeometry
    trackers: Mapping[str, TrackerScene]

    def large_error_px(self) -> float:
        """Error that is larger than 95 % of the known ones; 1 where none is known."""
        errors = pl.concat([part.observations["error_px"] for part in self.trackers.values()]).drop_nulls()
        found = errors.quantile(0.95)
        return float(found) if found else 1.0


def open_scene(run: RunFolder, scene: str | None = None) -> Scene:
    """Open the data of a sequence of a run, and read what its trackers saw.

    Parameters
    ----------
    run
        A run that keeps its observations.
    scene
        Name of a scene. Its first sequence is used; by default the first of the run.

    Raises
    ------
    UnknownNameError
        If no sequence of such a scene was measured.
    SettingsError
        If the run was not measured from data that can be opened again.
    TracknoiseError
        If the run or its data cannot be read.
    """
    entry = _entry(run, scene)
    experiment = parse_experiment(run.experiment_toml(), place=str(run.path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the notes of the run contain the same text
        (sequence,) = open_batch([Task(experiment, entry.sequence, tuple(experiment.speeds))])
    geometry = frame_geometry(sequence, entry.n_frames)
    tables = {name: run.sequence_table(name, entry.key) for name in ("observations", "tracks")}
    slowest = {name: table.filter(pl.col("speed") == table["speed"].min()) for name, table in tables.items()}
    names = slowest["tracks"]["tracker"].unique(maintain_order=True)
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
    found = first.select("track", x_m=points[:, 0], y_m=points[:, 1], z_m=points[:, 2])
    return found.filter(pl.all_horizontal(pl.col("x_m", "y_m", "z_m").is_finite()))
