"""Statistics of scripts, computed from their definitions in docs/statistics.md, not by `tracknoise.statistics`.

All sums are over single errors of all scenes. Each function returns a table with the keys of the package's table.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.selfcheck.known_worlds import UNKNOWN, Script

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_NAMES = {"age": ("nu", "eta", "Phi", "central"), "frame": ("mu", "kappa", "Sigma", "central")}
_ROUNDING_PX = 1e-9
_LEAST_ERRORS = 10
_PER_MEDIAN = 1.482602218505602
"""1 / 0.6745, where 0.6745 is the upper quartile of the standard Gaussian."""
_POPULATIONS = {"visible": ["valid"], "projected": ["valid", "occluded", "out_of_image"]}


@dataclass(frozen=True, slots=True)
class Trim:
    """Percentile of the largest errors of tracks above which tracks are dropped, and whose percentile it is."""

    percentile: float
    among: str
    population: str


def population(script: Script, name: str) -> Mask:
    """(tracks, steps) observations of a population."""
    return script.alive & np.isin(script.status, _POPULATIONS[name])


def age(script: Script) -> NDArray[np.int64]:
    """(tracks, steps) frames since the first frame of the track."""
    return script.frames - script.frames[script.birth][:, None]


def threshold_px(script: Script, trim: Trim) -> tuple[float, Array]:
    """Largest error that trimming keeps, and the largest error of each track, NaN where it has none."""
    seen = population(script, trim.population)
    size = np.where(seen, np.hypot(*np.moveaxis(script.error_px, -1, 0)), -1.0).max(axis=1)
    elsewhere = (seen & (script.frames != script.zero_frame[:, None])).any(axis=1)
    counted = elsewhere if trim.among == "followed" else seen.any(axis=1)
    ordered = np.sort(size[counted])
    place = (len(ordered) - 1) * trim.percentile / 100
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    limit = ordered[low] + (place - low) * (ordered[high] - ordered[low])
    return float(limit), np.where(seen.any(axis=1), size, np.nan)


def kept(script: Script, trim: Trim) -> Mask:
    """(tracks,) whether trimming keeps a track: all its observations, or none."""
    limit, largest = threshold_px(script, trim)
    return ~(largest > limit)


def curves(scripts: Sequence[Script], trim: Trim, *, axis: str) -> pl.DataFrame:
    """Every curve by population, trimming and weighting."""
    return _by_selection(scripts, trim, lambda chosen: _points(scripts, chosen, axis))


def cores(scripts: Sequence[Script], trim: Trim, *, axis: str) -> pl.DataFrame:
    """Geometric mean over scenes of 1.4826 times the median absolute error, for scenes with 10 errors or more."""
    return _by_selection(scripts, trim, lambda chosen: _cores(scripts, chosen, axis))


def _by_selection(
    scripts: Sequence[Script], trim: Trim, table: Callable[[Sequence[Mask]], pl.DataFrame]
) -> pl.DataFrame:
    """A table for the observations of each population and trimming."""
    parts = []
    for name in _POPULATIONS:
        every = [population(script, name) for script in scripts]
        some = [mask & kept(script, trim)[:, None] for mask, script in zip(every, scripts, strict=True)]
        for trimming, chosen in (("untrimmed", every), ("trimmed", some)):
            parts.append(table(chosen).with_columns(population=pl.lit(name), trimming=pl.lit(trimming)))
    return pl.concat(parts)


def long_lived(scripts: Sequence[Script], at_least: int) -> pl.DataFrame:
    """Curves of the visible errors of tracks that were observed at an age or later."""
    masks = []
    for script in scripts:
        oldest = np.where(script.alive, age(script), -1).max(axis=1)
        masks.append(population(script, "visible") & (oldest >= at_least)[:, None])
    return _points(scripts, masks, "age")


def survival(scripts: Sequence[Script]) -> pl.DataFrame:
    """Kaplan-Meier survival: the last lifetime of a track that is censored was not searched beyond it."""
    lived = np.concatenate([script.alive.sum(axis=1) for script in scripts])
    ended = np.concatenate([script.end != "sequence_end" for script in scripts])
    level, rows = 1.0, []
    for lifetime in range(1, int(lived.max()) + 1):
        searched = int(((lived > lifetime) | ((lived == lifetime) & ended)).sum())
        gone = int(((lived == lifetime) & ended).sum())
        level *= 1 - gone / searched if searched else np.nan
        rows.append((lifetime, gone, level))
    table = pl.DataFrame(rows, schema=["lifetime", "n_ended", "survival"], orient="row")
    return table.with_columns(pl.col("survival").fill_nan(None))


def rates(scripts: Sequence[Script]) -> dict[str, float | None]:
    """Mean lifetime, in frames that the tracker saw, and outliers over the features that were offered.

    The outlier ratio is None if the cause of an end is unknown.
    """
    frames, tracks = (sum(int(count(script)) for script in scripts) for count in (_observations, _tracks))
    outliers = sum(int((script.end == "outlier").sum()) for script in scripts)
    offered = sum(int(script.alive[:, :-1].sum()) for script in scripts)
    known = all((script.end != UNKNOWN).all() for script in scripts)
    return {"mean_lifetime": frames / tracks, "outlier_ratio": outliers / offered if known else None}


def counts(scripts: Sequence[Script]) -> pl.DataFrame:
    """Number of observations by status, and of tracks by known end."""
    found = {"truth": [script.status[script.alive] for script in scripts], "end": [script.end for script in scripts]}
    rows = [
        (kind, str(name), int(n))
        for kind, parts in found.items()
        for name, n in zip(*np.unique(np.concatenate(parts), return_counts=True), strict=True)
        if name != UNKNOWN
    ]
    return pl.DataFrame(rows, schema=["kind", "name", "n"], orient="row")


def autocorrelation(scripts: Sequence[Script]) -> tuple[float, float]:
    """Of changes of visible errors, about zero, at one step: in u and in v."""
    products, squares = np.zeros(2), np.zeros(2)
    for script in scripts:
        seen = population(script, "visible")
        change = np.diff(script.error_px, axis=1)
        pair = (seen[:, 2:] & seen[:, 1:-1] & seen[:, :-2])[..., None]
        products += (pair * change[:, 1:] * change[:, :-1]).sum(axis=(0, 1))
        squares += (pair * (change[:, 1:] ** 2 + change[:, :-1] ** 2)).sum(axis=(0, 1)) / 2
    u, v = products / squares
    return float(u), float(v)


def _observations(script: Script) -> int:
    return int(script.alive.sum())


def _tracks(script: Script) -> int:
    return len(script.alive)


def _points(scripts: Sequence[Script], chosen: Sequence[Mask], axis: str) -> pl.DataFrame:
    """Both weightings of every statistic at every age or frame."""
    sums = np.stack([_sums(script, mask, axis) for script, mask in zip(scripts, chosen, strict=True)])
    there = sums[..., 0].sum(axis=0) > 0
    by_scene = np.ma.masked_invalid(_statistics(sums)).mean(axis=0).filled(np.nan)
    weighted = {"features": _statistics(sums.sum(axis=0)), "scenes": by_scene}
    n = sums[..., 0].sum(axis=0)
    parts = []
    for weighting, values in weighted.items():
        for name, columns in zip(_NAMES[axis], _columns(values), strict=True):
            table = pl.DataFrame({"at": np.arange(len(there)), "n": n.astype(np.int64), **columns}).filter(there)
            labels = {"statistic": name, "weighting": weighting}
            parts.append(table.with_columns(pl.lit(value).alias(key) for key, value in labels.items()))
    return pl.concat(parts).with_columns(pl.col("u", "v", "uv").fill_nan(None))


def _cores(scripts: Sequence[Script], chosen: Sequence[Mask], axis: str) -> pl.DataFrame:
    """The cores of u and v at every age or frame: geometric means over scenes with enough errors and a core above 0."""
    found: dict[int, list[Array]] = {}
    for script, mask in zip(scripts, chosen, strict=True):
        at, size = _places(script, mask, axis), np.abs(script.error_px[mask])
        for place in np.unique(at):
            if (at == place).sum() >= _LEAST_ERRORS:
                found.setdefault(int(place), []).append(_PER_MEDIAN * np.median(size[at == place], axis=0))
    rows = [
        (place, *(_geometric_mean(values) for values in np.transpose(each))) for place, each in sorted(found.items())
    ]
    schema = {"at": pl.Int64, "core_u_px": pl.Float64, "core_v_px": pl.Float64}
    return pl.DataFrame(rows, schema=schema, orient="row").filter(~pl.all_horizontal(pl.col("^core_.*$").is_null()))


def _geometric_mean(values: Array) -> float | None:
    """Of those that are more than rounding; None where there is none."""
    known = values[values > _ROUNDING_PX]
    return float(np.prod(known) ** (1 / len(known))) if len(known) else None


def _places(script: Script, mask: Mask, axis: str) -> NDArray[np.int64]:
    """Age or frame of the chosen observations."""
    return age(script)[mask] if axis == "age" else np.broadcast_to(script.frames, mask.shape)[mask]


def _sums(script: Script, mask: Mask, axis: str) -> Array:
    """N and the sums of u, v, |u|, |v|, uu, vv, uv at every age or frame, (places, 8)."""
    at = _places(script, mask, axis)
    u, v = script.error_px[mask].T
    columns = (np.ones_like(u), u, v, abs(u), abs(v), u * u, v * v, u * v)
    return np.stack([np.bincount(at, column, int(script.frames[-1]) + 1) for column in columns], axis=-1)


def _statistics(sums: Array) -> Array:
    """Mean u, v; absolute u, v; second and central u, v, uv from sums (..., 8); NaN where undefined."""
    n, u, v, abs_u, abs_v, uu, vv, uv = np.moveaxis(sums, -1, 0)
    some, several = np.where(n > 0, n, np.nan), np.where(n > 1, n - 1, np.nan)
    second = np.stack([uu, vv, uv]) / some
    central = np.stack([uu - u * u / some, vv - v * v / some, uv - u * v / some]) / several
    return np.moveaxis(np.concatenate([np.stack([u, v, abs_u, abs_v]) / some, second, central]), 0, -1)


def _columns(values: Array) -> Iterator[dict[str, Array]]:
    """u, v and uv of each statistic."""
    missing = np.full(len(values), np.nan)
    for u, v, uv in ((0, 1, None), (2, 3, None), (4, 5, 6), (7, 8, 9)):
        yield {"u": values[:, u], "v": values[:, v], "uv": missing if uv is None else values[:, uv]}
