"""Covariance and bias of each observation of tracks, by a noise model."""

from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.noise_models.exports.noise import invertible
from tracknoise.tables.schema import QUALITY_PREFIX

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

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
