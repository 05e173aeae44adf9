"""Tables of a sequence that need its poses and cameras beside its observations."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.pose_errors.rigid import rigid_tables
from tracknoise.experiments.audit_inputs import audit_samples, cameras_table
from tracknoise.experiments.frame_geometry import frame_geometry
from tracknoise.experiments.settings import SYNTHETIC, Experiment
from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.geometry.pose import position_rows
from tracknoise.sequences.other_times import path_between_frames
from tracknoise.sequences.sequence import TRIANGULATED, Sequence
from tracknoise.statistics.noise.noise_tables import noise_tables
from tracknoise.statistics.noise.noise_tracks import noise_tracks
from tracknoise.statistics.noise.window_noise import window_noise
from tracknoise.statistics.places.image_map import image_map
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.audit_schema import PATH
from tracknoise.tables.schema import POSES, SEQUENCE, Schema

_POSITION = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")


def geometry_tables(
    experiment: Experiment, sequence: Sequence, prepared: PreparedSequence, n_frames: int, truth: str
) -> dict[str, pl.DataFrame]:
    """Poses, cameras, samples for the audit, pose errors, noise of windows, and the map of the image, by name.

    Parameters
    ----------
    experiment
        Names the trackers, and the population of the errors.
    sequence
        What was measured.
    prepared
        Its trimmed observations; `slowest` is the speed at which the map is made.
    n_frames
        Number of frames that were read.
    truth
        Kind of truth.
    """
    geometry = frame_geometry(sequence, n_frames)
    of_images = [choice.label for choice in experiment.trackers if choice.kind not in SYNTHETIC]
    population, with_depth = experiment.truth.population, truth != TRIANGULATED
    camera = sequence.camera
    return {
        "poses": poses_table(sequence, n_frames),
        **_path(sequence, n_frames),
        "cameras": cameras_table(sequence, n_frames),
        "audit_samples": audit_samples(sequence, prepared, truth),
        "image_map": image_map(prepared, width=camera.width, height=camera.height),
        **rigid_tables(prepared, geometry, witnesses=of_images),
        **window_noise(prepared, geometry, population=population, with_depth=with_depth),
        **(_of_depth(prepared, geometry, population) if with_depth else {}),
    }


def _of_depth(prepared: PreparedSequence, geometry: FrameGeometry, population: str) -> dict[str, pl.DataFrame]:
    """Tables that need the depths of points."""
    tracks = noise_tracks(prepared, geometry, population=population)
    return {**noise_tables(prepared, geometry), "noise_tracks": tracks}


def poses_table(sequence: Sequence, n_frames: int) -> pl.DataFrame:
    """Table `POSES` of the frames that were read."""
    frames = pl.Series("frame", np.arange(n_frames))
    return _posed(sequence, frames, sequence.world_from_camera[:n_frames], POSES)


def _path(sequence: Sequence, n_frames: int) -> dict[str, pl.DataFrame]:
    """Table `PATH`, where the recording has poses at other times than those of the frames that were read."""
    path = path_between_frames(sequence, n_frames)
    return {} if path is None else {"path": _posed(sequence, pl.Series("time_s", path.times), path.poses, PATH)}


def _posed(sequence: Sequence, at: pl.Series, poses: NDArray[np.float64], columns: Schema) -> pl.DataFrame:
    """A table of poses (n, 4, 4) of a sequence at frames or times."""
    rows = zip(_POSITION, position_rows(poses).T, strict=True)
    values = {name: pl.Series(row, nan_to_null=True) for name, row in rows}
    labels = {column: [getattr(sequence.id, column)] * len(at) for column in SEQUENCE}
    return pl.DataFrame({**labels, at.name: at, **values}, schema=dict(columns))
