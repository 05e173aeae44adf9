"""The noise to give to an estimator that fits 3-D points to windows of tracks, with intervals.

All of it is of windows of the first N observations, features pooled, with the true poses:

- residual sigma: what residuals look like, sqrt(sum r^2 / sum of degrees of freedom) (window.residual_sigma)
- residual core: the same without the tails. It is the median over windows of sqrt(sum r^2 / degrees of freedom), over
  that of independent Gaussian noise of standard deviation 1 (window.residual_core)
- consistent sigma: what makes the depths of points as certain as they are, the median of |z| over that of a Gaussian of
  standard deviation 1, 0.6745 (window.consistent_sigma)
- overconfidence: the second over the first. An estimator whose sigma was tuned to residuals claims depths that are this
  much more certain than they are (window.overconfidence)
- core overconfidence: consistent sigma over residual core. Both are medians, so that few tracks that were lost on
  another point do not change them. Where errors are not trimmed, these tracks dominate the residual sigma
- z root mean square: as the consistent sigma, but with the tails
- gate ratios: quantile of the sum of squared residuals of a window, in units of residual sigma, over that of chi
  square. A gate at this quantile must be multiplied by it (window.gate)
- coverage: share of windows whose depth is inside its interval, for residual sigma
- depth share: share of windows that show the depth of their point
"""

from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.units import SceneGroups, Units, scheme
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Condition, Tables, TablesByCondition, by_condition
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, quantile, share_below
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED_OF_N, OF_CONDITION, Constants, Rows, RunTable, by_quantity
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.tables.schema import TRIMMING, WINDOW_BLOCKS, WINDOW_NOISE, check


def _windows() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        "residual_sigma": ("residual_sigma", {}),
        "residual_sigma_u": ("residual_sigma_of_coordinate", {"coordinate": "u"}),
        "residual_sigma_v": ("residual_sigma_of_coordinate", {"coordinate": "v"}),
        "residual_core": ("residual_core", {}),
        "consistent_sigma": ("sigma", {}),
        "overconfidence": ("overconfidence", {}),
        "core_overconfidence": ("core_overconfidence", {}),
        "z_root_mean_square": ("z_root_mean_square", {}),
        **{f"gate_{level}": ("gate_factor", {"part": f"{level} %"}) for level in (95, 99)},
        **{f"coverage_{level}": ("window_coverage", {"part": f"{level} %"}) for level in (50, 90, 95, 99)},
        "depth_share": ("depth_share", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N, axis="window", coordinate=None, part=None)
    keys = {**OF_CONDITION, "trimming": "trimming", "at": "window"}
    return Rows("windows", keys, values)


WINDOW_SIGMAS = RunTable(
    "window_sigmas",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "window": pl.UInt32,
        "quantity": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    _windows(),
    title="noise for depths, by length of window",
    quantities={
        "sigma": Quantity(
            "px",
            "Noise that makes the depths of points fitted to windows of tracks as certain as they are, for known "
            "poses.",
        ),
        "residual_sigma": Quantity("px", "RMS of the residuals of points fitted to windows, by degrees of freedom."),
        "residual_sigma_of_coordinate": Quantity("px", "The same of one coordinate."),
        "residual_core": Quantity("px", "The same by the median over windows."),
        "overconfidence": Quantity("1", "Noise for depths over residual sigma."),
        "core_overconfidence": Quantity("1", "Noise for depths over residual core."),
        "z_root_mean_square": Quantity("px", "Noise for depths with the tails."),
        "gate_factor": Quantity("1", "Quantile of the squared residuals of a window over that of chi square."),
        "window_coverage": Quantity(
            "share", "Share of windows whose depth is inside its interval, for residual sigma."
        ),
        "depth_share": Quantity("share", "Share of windows that show the depth of their point."),
    },
)
"""The noise to give to an estimator, by length of its windows: see `tracknoise.estimators.window_noise`.

Sigmas, residual_core and z_root_mean_square are in px, all others have no unit. n counts windows.
"""

_POINT = ["trimming", "window"]
_SUMS = ("n", "n_depth", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares_z")
_HISTOGRAMS = ("residual_counts", "z_counts")
_GATES, _LEVELS = (0.95, 0.99), (0.5, 0.9, 0.95, 0.99)
_HALF = float(special.ndtri(0.75))
QUANTITIES: dict[str, str] = {
    "residual_sigma": "log",
    "residual_sigma_u": "log",
    "residual_sigma_v": "log",
    "residual_core": "log",
    "consistent_sigma": "log",
    "overconfidence": "log",
    "core_overconfidence": "log",
    "z_root_mean_square": "log",
    **{f"gate_{100 * level:.0f}": "log" for level in _GATES},
    **{f"coverage_{100 * level:.0f}": "logit" for level in _LEVELS},
    "depth_share": "logit",
}
"""Quantities of a window, and the scales of their intervals."""


def window_sigmas(windows: Tables, blocks: Tables = (), sampling: Sampling = USUAL) -> pl.DataFrame:
    """Quantities of every condition, trimming and length of window.

    Parameters
    ----------
    windows
        Tables of all scenes, schema `WINDOW_NOISE`.
    blocks
        The same by blocks of tracks, schema `WINDOW_BLOCKS`, where there are few scenes.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `WINDOW_SIGMAS`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(windows, WINDOW_NOISE, "window noise")
    few = any(_has_few_scenes(key, part, sampling.groups) for key, part in conditions.items())
    of_blocks = by_condition(blocks if few else (), WINDOW_BLOCKS, "window blocks")
    keyed = {key: part.with_columns(_condition=pl.lit(place)) for place, (key, part) in enumerate(conditions.items())}
    rows = partial(_rows, list(keyed), of_blocks)
    table = condition_table(keyed, WINDOW_SIGMAS, rows, sampling)
    return check(table.sort(*POOLED, *_POINT, "quantity"), WINDOW_SIGMAS, "window sigmas")


def scene_quantities(windows: pl.DataFrame) -> pl.DataFrame:
    """The same quantities of every scene on its own.

    Parameters
    ----------
    windows
        Rows of one condition and one trimming, schema `WINDOW_NOISE`.

    Returns
    -------
    polars.DataFrame
        Columns scene, window, quantity, n and value, without rows where a quantity is undefined. n counts the windows,
        or those that show depth, that the quantity rests on.
    """
    units = units_of(_wide(windows), points=["window"], columns=_columns())
    values, n = _quantities(np.transpose(units.sums, (2, 1, 0))), _sizes(units)
    there = np.argwhere(~np.isnan(values))
    quantity, window, scene = there.T
    return pl.DataFrame(
        {
            "scene": np.array(units.scenes, dtype=np.str_)[scene],
            "window": units.points["window"].to_numpy()[window],
            "quantity": np.array(list(QUANTITIES))[quantity],
            "n": n[tuple(there.T)].astype(np.int64),
            "value": values[tuple(there.T)],
        }
    )


def _has_few_scenes(key: Condition, windows: pl.DataFrame, groups: SceneGroups) -> bool:
    """Whether blocks are resampled, because scenes cannot be. Only then blocks are read: they are many."""
    return scheme(groups.of(key[0], windows["scene"].unique().sort().to_list())) is None


def _rows(
    keys: list[Condition],
    blocks: TablesByCondition,
    windows: pl.DataFrame,
    draws: Draws,
    method: Method,
) -> pl.DataFrame:
    """One row per trimming, window and quantity of a condition."""
    own = blocks.get(keys[windows["_condition"][0]])
    whole = _wide(windows)
    units = units_of(whole, None if own is None else _wide(own), points=_POINT, columns=_columns(), groups=draws.groups)
    found = pooled(
        units, draws.weights(units), _quantities, method, scales=list(QUANTITIES.values()), sizes=_sizes(units)
    )
    labels = pl.DataFrame({"quantity": list(QUANTITIES)}).join(units.points, how="cross")
    n = np.tile(units.sums[..., 0].sum(axis=0), len(QUANTITIES))
    table = estimated(labels, found, units, WINDOW_SIGMAS, value="value").with_columns(pl.Series("n", n))
    return table.with_columns(pl.col("value", "low", "high").fill_nan(None)).drop_nulls("value")


def _columns() -> list[str]:
    return [*_SUMS, *(f"{name}_{place}" for name in _HISTOGRAMS for place in range(LOG_HISTOGRAM_BINS))]


def _wide(windows: pl.DataFrame) -> pl.DataFrame:
    """The table with a column for each bin of the histograms."""
    counts = [
        pl.DataFrame(
            np.array(windows[name].to_list(), dtype=np.float64).reshape(-1, LOG_HISTOGRAM_BINS),
            schema=[f"{name}_{place}" for place in range(LOG_HISTOGRAM_BINS)],
        )
        for name in _HISTOGRAMS
    ]
    return windows.drop(_HISTOGRAMS).hstack([column for part in counts for column in part.get_columns()])


def _sizes(units: Units) -> NDArray[np.float64]:
    """(quantities, points, units) float64: windows, or those that show depth, of each unit."""
    n, n_depth = units.sums[..., 0].T, units.sums[..., 1].T
    about_depth = ("consistent", "overconfidence", "core_overconfidence", "z_", "coverage")
    return np.stack([n_depth if name.startswith(about_depth) else n for name in QUANTITIES])


def _quantities(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(quantities, points, ...) float64 from sums (columns, points, ...), NaN where there are none."""
    n, n_depth, squares_u, freedom_u, squares_v, freedom_v, squares_z = sums[: len(_SUMS)]
    residuals, z = sums[len(_SUMS) : len(_SUMS) + LOG_HISTOGRAM_BINS], sums[len(_SUMS) + LOG_HISTOGRAM_BINS :]
    residual = _root(squares_u + squares_v, freedom_u + freedom_v)
    consistent = quantile(z, 0.5) / _HALF
    freedom = _ratio(freedom_u + freedom_v, n)
    core = quantile(residuals, 0.5) / np.sqrt(_chi2_quantile(0.5, freedom) / freedom)
    gates = [
        _ratio(quantile(residuals, level) ** 2, residual**2) / (_chi2_quantile(level, freedom) / freedom)
        for level in _GATES
    ]
    inside = [share_below(z, float(special.ndtri(0.5 + level / 2.0)) * residual) for level in _LEVELS]
    axes = [_root(squares_u, freedom_u), _root(squares_v, freedom_v)]
    about_z = [consistent, _ratio(consistent, residual), _ratio(consistent, core), _root(squares_z, n_depth)]
    return np.stack([residual, *axes, core, *about_z, *gates, *inside, _ratio(n_depth, n)])


def _chi2_quantile(level: float, freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of chi-squared distributions; NaN where there are no degrees of freedom."""
    known = np.where(freedom > 0.0, freedom, np.nan)
    return np.asarray(2.0 * special.gammaincinv(known / 2.0, level))


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(part / np.where(whole > 0.0, whole, np.nan))


def _root(squares: NDArray[np.float64], count: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(_ratio(squares, count)))
