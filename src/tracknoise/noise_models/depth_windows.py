"""Windows of a sample of tracks, triangulated under noise that was learned from other scenes."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.noise_models.point_fit import fit_points, of_full_rank
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import TRIMMING, Schema, empty

Array = NDArray[np.float64]

LENGTHS = (5, 10, 15)
"""Lengths of the windows that are tried, in observations."""
ONE_PX, RESIDUAL, CONSISTENT, WHOLE = "1 px", "residual sigma", "consistent sigma", "whole tracks"
"""Names of the covariances."""
_LEARNED = {RESIDUAL: "residual_core", CONSISTENT: "consistent_sigma"}
_LEAST_PARALLAX_PX = 1.0
_WINDOW: Schema = {
    "dataset": pl.String,
    "scene": pl.String,
    "block": pl.UInt8,
    "trimming": TRIMMING,
    "window": pl.UInt32,
    "covariance": pl.String,
    "weight": pl.Float64,
    "sigma": pl.Float64,
    "z": pl.Float64,
    "error": pl.Float64,
}


@dataclass(frozen=True, slots=True, eq=False)
class LearnedNoise:
    """What some scenes say.

    Attributes
    ----------
    sigmas
        Columns window, trimming, quantity and value: `tracknoise.noise_models.window_noise`, of all these scenes.
    components
        Of the noise of whole tracks; None where these could not be fitted.
    """

    sigmas: pl.DataFrame
    components: TrackNoise | None

    def sigma(self, quantity: str, trimming: str, window: int) -> float | None:
        """A standard deviation, px; None where it is unknown or 0."""
        found = self.sigmas.filter(quantity=quantity, trimming=trimming, window=window)["value"].to_list()
        return found[0] if found and found[0] > 0.0 else None


def tried_windows(tracks: pl.DataFrame, learned_for: Iterable[tuple[Collection[str], LearnedNoise]]) -> pl.DataFrame:
    """Windows of one condition under each covariance.

    Parameters
    ----------
    tracks
        Rows of the condition, schema `NOISE_TRACKS`.
    learned_for
        Names of scenes, and the noise to try on them.

    Returns
    -------
    polars.DataFrame
        One row per window, trimming and covariance: dataset, scene, block, trimming, window, covariance, weight (tracks
        that it stands for), sigma (px; null for whole tracks), z (error of the depth over what is claimed) and error
        (as a share of the depth), both without their signs.
    """
    parts = [empty(_WINDOW)]
    for scenes, learned in learned_for:
        own = tracks.filter(pl.col("scene").is_in(list(scenes)))
        parts += [part for length in LENGTHS for part in _tried(_Windows.of(own, length), length, learned)]
    return pl.concat(parts)


def _tried(windows: "_Windows", length: int, learned: LearnedNoise) -> Iterator[pl.DataFrame]:
    error, z = windows.with_one_px()
    whole = None if learned.components is None else windows.with_whole_tracks(learned.components)
    for trimming in Trimming:
        sigmas = {name: learned.sigma(quantity, trimming, length) for name, quantity in _LEARNED.items()}
        for name, sigma in {ONE_PX: 1.0, **sigmas}.items():
            if sigma is not None:
                yield windows.table(trimming, name, sigma, error, z / sigma)
        if whole is not None:
            yield windows.table(trimming, WHOLE, None, *whole)


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Windows of equal length N that show the depths of their points.

    Attributes
    ----------
    labels
        Columns dataset, scene, block, kept, window and weight.
    errors : (windows, 2 N) float64
        px.
    by_point : (windows, 2 N, 3) float64
        Derivatives by two motions across the first ray, and by the depth as a share of it, px.
    ages, magnification : (windows, N)
        Frames of the recording since birth, and Z_0 / Z_k.
    """

    labels: pl.DataFrame
    errors: Array
    by_point: Array
    ages: NDArray[np.int64]
    magnification: Array

    @classmethod
    def of(cls, tracks: pl.DataFrame, length: int) -> "_Windows":
        """The first observations of the tracks that have so many."""
        track = ["scene", "track"]
        place = pl.int_range(pl.len()).over(track)
        rows = tracks.sort(*track, "age").filter(pl.len().over(track) >= length, place < length)
        first = rows.gather_every(length)
        labels = first.select("dataset", "scene", "block", "kept", window=pl.lit(length), weight="stands_for")
        names = ("across_u", "across_v", "other_u", "other_v", "depth_u", "depth_v")
        derivatives = rows.select(names).to_numpy().astype(np.float64).reshape(-1, length, 3, 2)
        made = cls(
            labels=labels,
            errors=rows.select("du_px", "dv_px").to_numpy().astype(np.float64).reshape(-1, 2 * length),
            by_point=np.swapaxes(derivatives, 2, 3).reshape(-1, 2 * length, 3),
            ages=rows["age"].to_numpy().astype(np.int64).reshape(-1, length),
            magnification=rows["magnification"].to_numpy().astype(np.float64).reshape(-1, length),
        )
        return made._showing_depth()

    def _showing_depth(self) -> "_Windows":
        across, depth = np.linalg.qr(self.by_point[:, :, :2])[0], self.by_point[:, :, 2]
        left = depth - np.einsum("tnk,tk->tn", across, np.einsum("tnk,tn->tk", across, depth))
        shown = np.linalg.norm(left, axis=1) >= _LEAST_PARALLAX_PX
        arrays = (self.errors, self.by_point, self.ages, self.magnification)
        return _Windows(self.labels.filter(pl.Series(shown)), *(array[shown] for array in arrays))

    def with_one_px(self) -> tuple[Array, Array]:
        """Errors of depths, as shares of these, and over what independent errors of 1 px would claim."""
        return self._depths(np.eye(self.errors.shape[1]))

    def with_whole_tracks(self, noise: TrackNoise) -> tuple[Array, Array]:
        """The same with the covariance of whole tracks."""
        return self._depths(of_full_rank(noise.covariance(self.magnification, ages=self.ages)))

    def _depths(self, covariance: Array) -> tuple[Array, Array]:
        depth = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(self.errors), 3))
        return fit_points(self.by_point, self.errors, covariance).along(depth)

    def table(self, trimming: Trimming, name: str, sigma: float | None, error: Array, z: Array) -> pl.DataFrame:
        """Rows of a covariance."""
        columns = {"sigma": pl.lit(sigma), "covariance": pl.lit(name), "trimming": pl.lit(trimming)}
        made = self.labels.with_columns(pl.Series("z", np.abs(z)), pl.Series("error", np.abs(error)), **columns)
        chosen = made.filter("kept") if trimming == Trimming.trimmed else made
        return chosen.select(pl.col(column).cast(kind) for column, kind in _WINDOW.items())
