"""Covariance and bias of each observation of tracks of a run or of a file, by a noise model."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.estimators.exports import invertible
from tracknoise.estimators.training import reference_view
from tracknoise.exceptions import DataError
from tracknoise.tables.schema import QUALITY_PREFIX
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.imported_rows import Rows
from tracknoise.trackers.track_files import detected, read_rows

if TYPE_CHECKING:
    from tracknoise.estimators.noise_model import NoiseModel


COLUMNS = ("sequence", "track", "frame", "cov_uu", "cov_uv", "cov_vv", "bias_u", "bias_v")
_TRACK = ["sequence", "track"]
_MOTION = "motion_px"


def observation_noise(model: "NoiseModel", tracks: pl.DataFrame) -> pl.DataFrame:
    """Covariance and bias of each observation by itself, for estimators that solve for the point.

    The first observation of a track has the covariance of a first position, later ones those of white noise and walk.
    Where the model has no noise of a first position, the first observation has the covariance of the next frame, and
    no standard deviation is below `LEAST_PX` in any direction: an estimator that takes observations as independent must
    not take one of them as exact.

    Parameters
    ----------
    model
        Of the tracker that made the tracks, in px of their images.
    tracks
        Columns sequence, track, frame (of the recording), u_px and v_px, and the conditions of the model that are
        known, as ``quality_<name>``. The motion of the image in one frame of the tracker is computed from the tracks.

    Returns
    -------
    polars.DataFrame
        Columns `COLUMNS`, one row per observation, by sequence, track and frame. Covariances in px^2, bias in px: it is
        to be subtracted.
    """
    ordered = tracks.sort(*_TRACK, "frame")
    since = ordered.select(
        age=(pl.col("frame") - pl.col("frame").first()).over(_TRACK).cast(pl.Float64),
        u=(pl.col("u_px").diff() / pl.col("frame").diff()).over(_TRACK),
        v=(pl.col("v_px").diff() / pl.col("frame").diff()).over(_TRACK),
    )
    age = since["age"].to_numpy()
    flow = model.training.speed * since.select("u", "v").to_numpy().astype(np.float64)
    covariance = _covariances(model, age, _conditions(model, ordered, flow))
    uv = ordered.select("u_px", "v_px").to_numpy().astype(np.float64)
    bias = uv - model.correct(uv, age, flow=np.nan_to_num(flow))
    values = [covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1], bias[:, 0], bias[:, 1]]
    columns = [pl.Series(name, column) for name, column in zip(COLUMNS[3:], values, strict=True)]
    return ordered.select("sequence", "track", "frame").with_columns(columns)


def _covariances(
    model: "NoiseModel", age: NDArray[np.float64], at: dict[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """(n, 2, 2): about the true positions, without the error of the first position in later ones."""
    first = model.first.covariance
    found = model.covariance(age=np.maximum(age, model.training.speed), **at) - first
    if first.any():
        found[age == 0.0] = first
    return invertible(found)


def _conditions(model: "NoiseModel", tracks: pl.DataFrame, flow: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """What is known at run time, by the names of the conditions of the model; NaN where it is not known."""
    named = {QUALITY_PREFIX + factor.of: factor.of for factor in model.conditions}
    known = {of: tracks[name].cast(pl.Float64).to_numpy() for name, of in named.items() if name in tracks.columns}
    return {**known, _MOTION: np.hypot(*flow.T)} if any(factor.of == _MOTION for factor in model.conditions) else known


_NAMES = ("sequence", "track", "frame", "u_px", "v_px")
_VIEW = ("rotation", "direction")


def read_tracks(path: Path, model: "NoiseModel") -> pl.DataFrame:
    """Read the tracks of the tracker of a model.

    Parameters
    ----------
    path
        The folder of a run that keeps observations, or a file of tracks. Of a run, the view is that which models are
        fitted to (`tracknoise.estimators.training`): noise of turned images has other axes.
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
        of_model = pl.col("tracker") == training.tracker, pl.col("speed") == training.speed
        mine = run.rows("observations", key, *of_model)
        quality = [name for name in mine.columns if name.startswith(QUALITY_PREFIX)]
        found.append(mine.with_columns(pl.lit(key).alias("sequence")).select(*_NAMES, *_VIEW, *quality))
    tracks = pl.concat(found, how="diagonal") if found else pl.DataFrame()
    if tracks.is_empty():
        raise DataError(path, f"no track of {training.tracker} at speed {training.speed:g}", "those of the model")
    return tracks.filter(**reference_view(tracks)).drop(_VIEW)


def _of_file(path: Path, model: "NoiseModel") -> pl.DataFrame:
    rows = read_rows(path, detected(path), n_frames=None).observed
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
    if rows.time_s is None and rows.time_ns is None:
        raise DataError(rows.path, "names of images", "frames or times")
    if model.camera.rate_hz is None:
        raise DataError(rows.path, "times, and a model that does not know the rate of its recordings", "frames")
    time, per_second = (rows.time_s, 1.0) if rows.time_ns is None else (rows.time_ns, 1e9)
    assert time is not None
    frames: NDArray[np.int64] = np.rint((time - time.min()) / per_second * model.camera.rate_hz).astype(np.int64)
    return frames
