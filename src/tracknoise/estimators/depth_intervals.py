"""The cheap proof of every run: whether intervals of depths of points hold the true ones.

Windows of a sample of tracks (`tracknoise.statistics.windows`) are triangulated with the true poses, to first order,
under four noise assumptions. The assumed covariance of their observations is that of

- ``1 px``: one sigma, as many estimators are shipped
- ``residual sigma``: one sigma, the residual core of `tracknoise.estimators.window_noise`
- ``consistent sigma``: one sigma, the one that makes depths as certain as they are
- ``whole tracks``: the components of a noise model, with the correlation of the observations of a track

What is learned comes from other scenes than those it is tried on. Scenes are divided into at most `FOLDS` parts. Scenes
of a group stay together. What is tried on the scenes of a part was learned from all other parts. Windows with a
parallax below 1 px do not count.

Quantities are of all windows of the condition. Each sampled window is counted for those that it stands for:

- coverage: share of windows whose depth is inside its claimed interval (depth.coverage)
- overconfidence: median of the absolute error over the claimed standard deviation, over that of a Gaussian
  (depth.overconfidence)
- depth error: median of the absolute error of the depth, as a share of it (depth.error)
- error ratio: this median over that with one sigma, which is the same for any sigma (depth.error_ratio)

None of them is changed by more than the share of tracks that were lost on another point.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import ndtri

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.estimators.components import fit_noise, sums_of_units
from tracknoise.estimators.linear_window import fit_points, of_full_rank
from tracknoise.estimators.window_noise import scene_quantities
from tracknoise.exceptions import SettingsError
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of, quantile, share_below
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED_OF_N, OF_CONDITION, Constants, Rows, RunTable, by_quantity
from tracknoise.tables.schema import NOISE_SUMS, NOISE_TRACKS, TRIMMING, WINDOW_NOISE, Schema, check, empty
from tracknoise.tables.schema import POOLED as CONDITIONS


def _depths() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("depth_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "overconfidence": ("depth_overconfidence", {}),
        "error_ratio": ("depth_error_ratio", {}),
        "depth_error": ("depth_error", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N, axis="window", of=None)
    keys = {**OF_CONDITION, "trimming": "trimming", "at": "window", "part": "covariance", "part_low": "sigma_px"}
    return Rows("depths", keys, values)


DEPTH_INTERVALS = RunTable(
    "depth_intervals",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "window": pl.UInt32,
        "covariance": pl.String,
        "quantity": pl.String,
        "sigma_px": pl.Float64,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    _depths(),
    title="intervals of depths, by assumed noise",
    quantities={
        "depth_coverage": Quantity(
            "share", "Share of the depths of points of other scenes inside their claimed interval."
        ),
        "depth_error": Quantity("share", "Error of the depth of points of other scenes, relative to the depth."),
        "depth_error_ratio": Quantity("1", "Error of the depth over the claimed one."),
        "depth_overconfidence": Quantity("1", "Factor by which claimed depths are too certain."),
    },
)
"""What estimators would claim of the depths of points of other scenes: see `tracknoise.estimators.depth_intervals`.

covariance says which noise is assumed, and sigma_px how large it is if it is one number. n counts windows. No quantity
has a unit.
"""

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
    """What some scenes say."""

    # columns window, trimming, quantity and value: `tracknoise.estimators.window_noise`, of all these scenes
    sigmas: pl.DataFrame
    components: TrackNoise | None  # of the noise of whole tracks; None where these could not be fitted

    def sigma(self, quantity: str, trimming: str, window: int) -> float | None:
        """A standard deviation, px; None where it is unknown or 0."""
        found = self.sigmas.filter(quantity=quantity, trimming=trimming, window=window)["value"].to_list()
        return found[0] if found and found[0] > 0.0 else None


def tried_windows(tracks: pl.DataFrame, learned_for: Iterable[tuple[Collection[str], LearnedNoise]]) -> pl.DataFrame:
    """Windows of one condition under each covariance.

    Returns one row per window, trimming and covariance: dataset, scene, block, trimming, window, covariance, weight
    (tracks that it stands for), sigma (px; null for whole tracks), z (error of the depth over what is claimed) and
    error (as a share of the depth), both without their signs.
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
    """Windows of equal length N that show the depths of their points."""

    labels: pl.DataFrame  # columns dataset, scene, block, kept, window and weight
    errors: Array  # (windows, 2 N): px
    # (windows, 2 N, 3): derivatives by two motions across the first ray, and by the depth as a share of it, px
    by_point: Array
    # ages, magnification: (windows, N): frames of the recording since birth, and Z_0 / Z_k
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


FOLDS = 4
"""Most parts that scenes are divided into."""


def learned_noise(
    scenes: Collection[str], sums: pl.DataFrame, windows: pl.DataFrame, *, groups: SceneGroups
) -> Iterator[tuple[Sequence[str], LearnedNoise]]:
    """Scenes, and what all others say that are of none of their groups; nothing where none of these has windows."""
    seen = {*windows["scene"]}
    for part in _parts(sorted(seen | {*sums["scene"]}), sums, windows, groups):
        tried = [scene for scene in part if scene in seen.intersection(scenes)]
        if tried and seen.difference(part):
            others = ~pl.col("scene").is_in(part)
            together = windows.filter(others).with_columns(scene=pl.lit(""))
            by_trimming = together.partition_by("trimming", as_dict=True).items()
            sigmas = [scene_quantities(own).with_columns(trimming=pl.lit(str(name))) for (name,), own in by_trimming]
            yield tried, LearnedNoise(pl.concat(sigmas), _components(sums.filter(others), groups))


def _parts(scenes: list[str], sums: pl.DataFrame, windows: pl.DataFrame, groups: SceneGroups) -> list[list[str]]:
    """Scenes that are left out together."""
    if not scenes:
        return []
    (dataset,) = {*sums["dataset"], *windows["dataset"]}
    part = groups.of(dataset, scenes) % FOLDS
    return [[scene for scene, own in zip(scenes, part, strict=True) if own == one] for one in np.unique(part)]


def _components(sums: pl.DataFrame, groups: SceneGroups) -> TrackNoise | None:
    if sums.is_empty():
        return None
    try:
        noise = fit_noise(sums_of_units(sums, groups), level=LEVEL)
    except SettingsError:  # too few errors
        return None
    return None if noise.is_zero else noise


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
    columns = ["weight", "n", *(f"{name}_{place}" for name in _HISTOGRAMS for place in range(LOG_HISTOGRAM_BINS))]
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
        cells = index * LOG_HISTOGRAM_BINS + bin_of(windows[name].to_numpy() / unit)
        histogram = np.bincount(cells, weight, size * LOG_HISTOGRAM_BINS).reshape(size, LOG_HISTOGRAM_BINS)
        columns |= {f"{name}_{place}": histogram[:, place] for place in range(LOG_HISTOGRAM_BINS)}
    return first.select(keys).hstack(pl.DataFrame(columns))


def _reference(points: pl.DataFrame) -> NDArray[np.intp]:
    """(points,) intp: place of the same trimming and window with 1 px."""
    places = points.with_row_index("place")
    ones = places.filter(covariance=ONE_PX).select("trimming", "window", one="place")
    found = places.join(ones, on=["trimming", "window"], how="left", maintain_order="left")
    return found["one"].to_numpy().astype(np.intp)


def _quantities(reference: NDArray[np.intp], sums: Array) -> Array:
    """(quantities, points, ...) float64 from sums (columns, points, ...), NaN where there are none."""
    z, errors = sums[2 : 2 + LOG_HISTOGRAM_BINS], sums[2 + LOG_HISTOGRAM_BINS :]
    shape = z.shape[1:]
    inside = [share_below(z, np.full(shape, ndtri(0.5 + level / 2.0))) for level in LEVELS]
    error = quantile(errors, 0.5) * _SMALL
    return np.stack([*inside, quantile(z, 0.5) / _HALF, error, error / error[reference]])
