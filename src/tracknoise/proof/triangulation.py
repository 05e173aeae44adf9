"""The cheap proof: how far triangulated points err, and how far their claimed uncertainty says they may.

Each track is triangulated with the true poses, to first order, by least squares that are weighted with a covariance.
Four covariances are compared: 1 px; the sigma for which residuals look right; the sigma for which distances are as
certain as claimed; and that of whole tracks. The two sigmas are learned from training scenes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from tracknoise.findings.sampling.bounds import Method, column_means, pooled
from tracknoise.findings.sampling.units import units_of
from tracknoise.noise_models.linear_window import PointTracks, linear_tracks
from tracknoise.noise_models.point_fit import fit_points
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.proof.arms import one_sigma, whole_tracks
from tracknoise.proof.problem import Problem, errors_of

_LEVELS = (0.5, 0.9, 0.95, 0.99)
_HALF = float(stats.norm.ppf(0.75))
_QUANTITIES: Mapping[str, str] = MappingProxyType(
    {"error_ratio": "linear", "z_square": "log", **{f"coverage_{100 * level:.0f}": "logit" for level in _LEVELS}}
)
_ONE_PX = "1 px"
Covariances = Callable[[Problem], Sequence[NDArray[np.float64]]]


@dataclass(frozen=True, slots=True)
class Sigmas:
    """Standard deviations of training tracks, px: for which residuals, and for which distances, are right."""

    residual_px: float
    consistent_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Triangulated:
    """Of every track: relative error of its distance, that error over what was claimed, and residuals."""

    error: NDArray[np.float64]
    z: NDArray[np.float64]
    squares: float
    freedom: int


def learn_sigmas(problems: Sequence[Problem]) -> Sigmas:
    """Both standard deviations of windows of training scenes."""
    found = [_triangulated(problem, one_sigma(problem, 1.0)) for problem in problems]
    residual = sum(part.squares for part in found) / sum(part.freedom for part in found)
    consistent = np.median(np.abs(np.concatenate([part.z for part in found]))) / _HALF
    return Sigmas(float(np.sqrt(residual)), float(consistent))


def triangulate(problems: Sequence[Problem], sigmas: Sigmas, noise: TrackNoise) -> pl.DataFrame:
    """Errors and coverage of distances under each covariance, with intervals over scenes.

    Parameters
    ----------
    problems
        Windows of scenes that nothing was learned from.
    sigmas
        Of training scenes.
    noise
        Components of the noise model.

    Returns
    -------
    polars.DataFrame
        One row per covariance and quantity: covariance, quantity, value, low, high, tracks, scenes. The error ratio is
        the geometric mean of errors over those with 1 px; z_square is the mean square error over the claimed one;
        coverage is the share of distances inside their claimed interval.
    """
    tried: Mapping[str, Covariances] = {
        _ONE_PX: lambda problem: one_sigma(problem, 1.0),
        "residual sigma": lambda problem: one_sigma(problem, sigmas.residual_px),
        "consistent sigma": lambda problem: one_sigma(problem, sigmas.consistent_px),
        "whole tracks": lambda problem: whole_tracks(problem, noise),
    }
    table = pl.concat([_rows(problem, tried) for problem in problems])
    sums = table.group_by("scene", "covariance").agg(pl.len().alias("n"), pl.exclude("scene", "covariance").sum())
    columns = [name for name in sums.columns if name not in ("scene", "covariance")]
    units = units_of(sums, points=["covariance"], columns=columns)
    found = pooled(units, np.empty((0, len(units.sums))), column_means, Method(), scales=list(_QUANTITIES.values()))
    labels = pl.DataFrame({"quantity": list(_QUANTITIES)}).join(units.points.select("covariance"), how="cross")
    tracks = np.tile(units.sums[..., 0].sum(axis=0), len(_QUANTITIES)).astype(np.int64)
    numbers = {"value": found.value, "low": found.low, "high": found.high, "scenes": found.n_scenes}
    flat = {name: np.broadcast_to(values, found.value.shape).ravel() for name, values in numbers.items()}
    bounded = labels.with_columns(tracks=pl.Series(tracks), **flat)
    numeric = pl.col("value", "low", "high").fill_nan(None)
    ratio = pl.when(pl.col("quantity") == "error_ratio").then(numeric.exp()).otherwise(numeric)
    return bounded.with_columns(ratio).select("covariance", "quantity", "value", "low", "high", "tracks", "scenes")


def _rows(problem: Problem, tried: Mapping[str, Covariances]) -> pl.DataFrame:
    """One row per track and covariance, with what is summed."""
    found = {name: _triangulated(problem, of(problem)) for name, of in tried.items()}
    reference = np.abs(found[_ONE_PX].error)
    parts = [
        pl.DataFrame(
            {
                "scene": problem.scene,
                "covariance": name,
                "log_error": np.log(np.abs(part.error) / reference),
                "z_square": part.z**2,
                **{
                    f"inside_{100 * level:.0f}": (np.abs(part.z) <= stats.norm.ppf(0.5 + level / 2.0)) * 1.0
                    for level in _LEVELS
                },
            }
        )
        for name, part in found.items()
    ]
    return pl.concat(parts)


def _triangulated(problem: Problem, covariances: Sequence[NDArray[np.float64]]) -> _Triangulated:
    parts = zip(problem.groups, errors_of(problem), covariances, strict=True)
    error, z, squares, freedom = [], [], 0.0, 0
    for group, errors, covariance in parts:
        tracks = PointTracks(group.frames, group.points)
        linear = linear_tracks(problem.camera, problem.world_from_camera, tracks)
        fitted = fit_points(linear.by_point, errors.reshape(len(errors), -1), covariance)
        distance = np.linalg.norm(linear.rays, axis=1)
        moved, over_claimed = fitted.along(linear.rays / distance[:, None])
        error.append(moved / distance)
        z.append(over_claimed)
        squares += float(np.square(fitted.residuals).sum())
        freedom += errors.size - 3 * len(errors)
    return _Triangulated(np.concatenate(error), np.concatenate(z), squares, freedom)
