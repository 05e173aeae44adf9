"""Tracks of a run or of a file, as `observation_noise` takes them."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.noise_models.reference_view import reference_view
from tracknoise.tables.schema import QUALITY_PREFIX
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.imports.formats import detected, read_rows
from tracknoise.trackers.imports.rows import Rows

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

_NAMES = ("sequence", "track", "frame", "u_px", "v_px")
_VIEW = ("rotation", "direction")


def read_tracks(path: Path, model: "NoiseModel") -> pl.DataFrame:
    """Read the tracks of the tracker of a model.

    Parameters
    ----------
    path
        The folder of a run that keeps observations, or a file of tracks. Of a run, the view is that which models are
        fitted to (`tracknoise.noise_models.reference_view`): noise of turned images has other axes.
    model
        Its tracker and speed are those that are taken from a run. Its rate turns times of a file into frames.

    Raises
    ------
    DataError, StoreError
        If there are no such tracks, or they cannot be read.
    """
    return _of_run(path, model) if path.is_dir() else _of_file(path, model)


def _of_run(path: Path, model: "NoiseModel") -> pl.DataFrame:
    """Sequences of the reference view of a run, named by their keys."""
    run, training = RunFolder(path), model.training
    found = []
    for key in sorted(run.manifest().sequences):
        table = run.sequence_table("observations", key)
        mine = table.filter((pl.col("tracker") == training.tracker) & (pl.col("speed") == training.speed))
        quality = [name for name in mine.columns if name.startswith(QUALITY_PREFIX)]
        found.append(mine.with_columns(pl.lit(key).alias("sequence")).select(*_NAMES, *_VIEW, *quality))
    tracks = pl.concat(found, how="diagonal") if found else pl.DataFrame()
    if tracks.is_empty():
        raise DataError(path, f"no track of {training.tracker} at speed {training.speed:g}", "those of the model")
    return tracks.filter(**reference_view(tracks)).drop(_VIEW)


def _of_file(path: Path, model: "NoiseModel") -> pl.DataFrame:
    rows = read_rows(path, detected(path), n_frames=None)
    columns = {"sequence": path.stem, "track": rows.track, "frame": _frames(rows, model)}
    places = {"u_px": rows.uv[:, 0], "v_px": rows.uv[:, 1]}
    quality = {QUALITY_PREFIX + name: values for name, values in rows.quality.items()}
    table = pl.DataFrame({**columns, **places, **quality})
    if table.select("track", "frame").is_duplicated().any():
        raise DataError(path, "two rows of one track in one frame", "one row per track and frame")
    return table


def _frames(rows: Rows, model: "NoiseModel") -> NDArray[np.int64]:
    """Frames of the recording, from times where the file has no frames."""
    if rows.frame is not None:
        return rows.frame
    if model.camera.rate_hz is None:
        raise DataError(rows.path, "times, and a model that does not know the rate of its recordings", "frames")
    time, per_second = (rows.time_s, 1.0) if rows.time_ns is None else (rows.time_ns, 1e9)
    assert time is not None
    frames: NDArray[np.int64] = np.rint((time - time.min()) / per_second * model.camera.rate_hz).astype(np.int64)
    return frames
