"""Errors of tracks with planted noise, as numbers, and the sums that noise models are fitted to."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS
from tracknoise.inference.units import BLOCKS, Units
from tracknoise.statistics.noise_sums import ErrorTracks, products

MOTIONS = ("sideways", "forward")


def error_tracks(
    random: np.random.Generator,
    *,
    first: float = 0.0,
    white: float = 0.0,
    walk: float = 0.0,
    drift: float = 0.0,
    motion: str = "sideways",
    n_tracks: int = 150,
    most: int = 20,
    mean_length: float = 12.0,
    factor: NDArray[np.float64] | None = None,
    nu: float = np.inf,
) -> ErrorTracks:
    """Tracks of at most `most` observations, whose lengths are geometrically distributed.

    With `factor`, (n_tracks, most), variances of white noise and walk are multiplied. With `nu`, each track has a scale
    of its own, so that its errors have Student's distribution.
    """
    length = np.clip(random.geometric(1.0 / mean_length, n_tracks), 2, most)
    depth = random.uniform(2.0, 10.0, n_tracks)[:, None]
    now = depth - (0.06 if motion == "forward" else 0.0) * np.arange(most)
    magnification = depth / now
    scale = np.ones((n_tracks, most, 1)) if factor is None else np.sqrt(factor)[..., None]
    steps = walk * scale * random.standard_normal((n_tracks, most, 2)) / magnification[..., None]
    steps[:, 0] = 0.0
    age = np.arange(most)[None, :, None]
    begun = (age > 0) * 1.0
    error = magnification[..., None] * (first * random.standard_normal((n_tracks, 1, 2)) + np.cumsum(steps, axis=1))
    error += white * scale * random.standard_normal(error.shape) + age * drift * random.standard_normal(
        (n_tracks, 1, 2)
    )
    if np.isfinite(nu):
        error /= np.sqrt(random.chisquare(nu, (n_tracks, 1, 1)) / nu)
    walked = np.cumsum((age[..., 0] > 0) / magnification**2, axis=1)
    there = np.arange(most) < length[:, None]
    track, frame = np.nonzero(there)
    return ErrorTracks(
        rows=np.arange(len(track)),
        track=track,
        frame=frame,
        speed=np.ones_like(frame),
        age=frame * 1.0,
        error_px=(begun * error)[there],
        outlier=np.zeros(len(track), dtype=bool),
        limit_px=np.array([np.inf]),
        magnification=magnification[there],
        walked=walked[there],
        motion_px=np.full((len(track), 2), np.nan),
    )


def sums_of(scene: str, tracks: ErrorTracks) -> pl.DataFrame:
    """Sums by block, product and age."""
    parts = [
        pl.DataFrame(np.hstack([found.values, found.factors]), schema=COLUMNS[1:])
        .with_columns(product=pl.lit(str(kind)), age=pl.Series(tracks.age[found.rows]).cast(pl.UInt32))
        .with_columns(block=pl.Series(tracks.track[found.rows] % BLOCKS).cast(pl.UInt8))
        .group_by("block", "product", "age")
        .agg(pl.len().alias("n"), pl.all().sum())
        for kind, found in products(tracks)
    ]
    return pl.concat(parts).with_columns(scene=pl.lit(scene))


def errors_of(scene: str, tracks: ErrorTracks, **quality: NDArray[np.float64]) -> pl.DataFrame:
    """Rows of `TRACK_ERRORS`; `quality`: (n_tracks, most) each."""
    columns = {
        "track": tracks.track,
        "block": (tracks.track % BLOCKS).astype(np.uint8),
        "age": tracks.age.astype(np.uint32),
        **dict(zip(("du_px", "dv_px"), tracks.error_px.T, strict=True)),
        "magnification": tracks.magnification,
        "motion_px": np.full(len(tracks.track), np.nan),
        **{f"quality_{name}": values[tracks.track, tracks.frame] for name, values in quality.items()},
    }
    view = {"lighting": "default", "rotation": 0, "direction": "forward", "camera": ""}
    origin = {"dataset": "made", "scene": scene, **view}
    return pl.DataFrame(columns).with_columns(**{name: pl.lit(value) for name, value in origin.items()})


def units(seed: int, *, scenes: int = 20, spread: float = 0.0, **planted: object) -> Units:
    """Sums of scenes whose standard deviations differ by factors of this logarithmic spread."""
    random = np.random.default_rng(seed)
    sigmas = ("first", "white", "walk", "drift")
    tables = []
    for number in range(scenes):
        scale = float(np.exp(spread * random.standard_normal()))
        own = {name: value * scale if name in sigmas else value for name, value in planted.items()}
        tables.append(sums_of(f"scene-{number:02}", error_tracks(random, **own)))
    table = pl.concat(tables)
    return units_of(table.drop("block"), table, points=["product", "age"], columns=COLUMNS)
