"""The cheap proof of every run: whether intervals of depths of points hold the true ones, under four noise assumptions.

Windows of a sample of tracks (`tracknoise.statistics.noise.noise_tracks`) are triangulated with the true poses, to
first order. The assumed covariance of their observations is that of

- ``1 px``: one sigma, as many estimators are shipped
- ``residual sigma``: one sigma, the residual core of `tracknoise.noise_models.window_noise`
- ``consistent sigma``: one sigma, the one that makes depths as certain as they are
- ``whole tracks``: the components of a noise model, with the correlation of the observations of a track

All are learned from other scenes than those they are tried on (`tracknoise.noise_models.learned_noise`). Windows with a
parallax below 1 px do not count.

Quantities are of all windows of the condition, each sampled one counted for those that it stands for:

- coverage: share of windows whose depth is inside its claimed interval (depth.coverage)
- overconfidence: median of the absolute error over the claimed standard deviation, over that of a Gaussian
  (depth.overconfidence)
- depth error: median of the absolute error of the depth, as a share of it (depth.error)
- error ratio: this median over that with one sigma, which is the same for any sigma (depth.error_ratio)

None of them is changed by more than the share of tracks that were lost on another point.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import ndtri

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.noise_models.depth_windows import ONE_PX, WHOLE, tried_windows
from tracknoise.noise_models.learned_noise import learned_noise
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.errors.log_histogram import BINS, bin_of, quantile, share_below
from tracknoise.tables.findings_schema import DEPTH_INTERVALS
from tracknoise.tables.schema import NOISE_SUMS, NOISE_TRACKS, WINDOW_NOISE, check, empty

Array = NDArray[np.float64]

LEVELS = (0.5, 0.9, 0.95, 0.99)
"""Levels of the claimed intervals."""
_HALF = float(ndtri(0.75))
_SMALL = 1e-3
"""Errors of depths are counted in this unit, so that the bins of histograms reach small ones."""
_POINT = ["trimming", "window", "covariance"]
_HISTOGRAMS = ("z", "error")
QUANTITIES: Mapping[str, str] = {
    **{f"coverage_{100 * level:.0f}": "logit" for level in LEVELS},
    "overconfidence": "log",
    "depth_error": "log",
    "error_ratio": "log",
}
"""Quantities, and the scales of their intervals."""


def depth_intervals(tracks: Tables, sums: Tables, windows: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Quantities of every condition with sampled tracks in at least two scenes that are independent of each other.

    Parameters
    ----------
    tracks
        Sampled tracks of all scenes, schema `NOISE_TRACKS`.
    sums
        What noise models are fitted to, schema `NOISE_SUMS`.
    windows
        What sigmas are learned from, schema `WINDOW_NOISE`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `DEPTH_INTERVALS`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    sampled = by_condition(tracks, NOISE_TRACKS, "noise tracks")
    of_sums = by_condition(sums if sampled else (), NOISE_SUMS, "noise sums")
    of_windows = by_condition(windows if sampled else (), WINDOW_NOISE, "window noise")
    learned = {
        key: learned_noise(
            part["scene"].unique(),
            of_sums.get(key, empty(NOISE_SUMS)),
            of_windows.get(key, empty(WINDOW_NOISE)),
            groups=sampling.groups,
        )
        for key, part in sampled.items()
    }
    tried = {key: tried_windows(part, learned[key]) for key, part in sampled.items()}
    table = condition_table(tried, DEPTH_INTERVALS, _rows, sampling)
    return check(table.sort(*POOLED, *_POINT, "quantity"), DEPTH_INTERVALS, "depth intervals")


def _rows(windows: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per trimming, window, covariance and quantity of a condition."""
    columns = ["weight", "n", *(f"{name}_{place}" for name in _HISTOGRAMS for place in range(BINS))]
    blocks = _counted(windows)
    units = units_of(blocks, blocks, points=_POINT, columns=columns, groups=draws.groups)
    n = units.sums[..., 1]
    sizes = np.broadcast_to(n.T, (len(QUANTITIES), *n.T.shape))
    statistics = partial(_quantities, _reference(units.points))
    scales = list(QUANTITIES.values())
    found = pooled(units, draws.weights(units), statistics, method, scales=scales, sizes=sizes)
    points = units.points.join(_mean_sigmas(windows), on=_POINT, how="left", maintain_order="left")
    labels = pl.DataFrame({"quantity": list(QUANTITIES)}).join(points, how="cross")
    table = estimated(labels, found, units, DEPTH_INTERVALS, value="value")
    counted = table.with_columns(n=np.tile(n.sum(axis=0), len(QUANTITIES)))
    return counted.with_columns(pl.col("value", "low", "high").fill_nan(None)).drop_nulls("value")


def _mean_sigmas(windows: pl.DataFrame) -> pl.DataFrame:
    """Mean of what was learned from different scenes, by point; null where the noise is not one number."""
    weight = pl.col("weight")
    mean = (pl.col("sigma") * weight).sum() / weight.sum()
    return windows.group_by(_POINT).agg(sigma_px=pl.when(pl.col("covariance").first() != WHOLE).then(mean))


def _counted(windows: pl.DataFrame) -> pl.DataFrame:
    """Sums and histograms by dataset, scene, block and point: a column for each bin."""
    keys = ["dataset", "scene", "block", *_POINT]
    numbered = windows.with_columns(_cell=pl.struct(keys).rank("dense") - 1)
    first = numbered.unique("_cell").sort("_cell")
    index, weight = numbered["_cell"].to_numpy().astype(np.intp), windows["weight"].to_numpy()
    size = first.height
    columns = {"weight": np.bincount(index, weight, size), "n": np.bincount(index, minlength=size).astype(np.float64)}
    for name, unit in zip(_HISTOGRAMS, (1.0, _SMALL), strict=True):
        cells = index * BINS + bin_of(windows[name].to_numpy() / unit)
        histogram = np.bincount(cells, weight, size * BINS).reshape(size, BINS)
        columns |= {f"{name}_{place}": histogram[:, place] for place in range(BINS)}
    return first.select(keys).hstack(pl.DataFrame(columns))


def _reference(points: pl.DataFrame) -> NDArray[np.intp]:
    """(points,) intp: place of the same trimming and window with 1 px."""
    places = points.with_row_index("place")
    ones = places.filter(covariance=ONE_PX).select("trimming", "window", one="place")
    found = places.join(ones, on=["trimming", "window"], how="left", maintain_order="left")
    return found["one"].to_numpy().astype(np.intp)


def _quantities(reference: NDArray[np.intp], sums: Array) -> Array:
    """(quantities, points, ...) float64 from sums (columns, points, ...), NaN where there are none."""
    z, errors = sums[2 : 2 + BINS], sums[2 + BINS :]
    shape = z.shape[1:]
    inside = [share_below(z, np.full(shape, ndtri(0.5 + level / 2.0))) for level in LEVELS]
    error = quantile(errors, 0.5) * _SMALL
    return np.stack([*inside, quantile(z, 0.5) / _HALF, error, error / error[reference]])
