"""The explorer: all curves of a run as plain data, of which the page draws those that a reader chooses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import polars as pl
import polars.selectors as cs

from tracknoise.report.report_data import ReportData
from tracknoise.tables.schema import VIEW
from tracknoise.topics.bands import BOUNDS

SCENE_FEATURES = 20
"""Curves of single scenes are cut where fewer features than this remain."""
_CONDITION = ["tracker", "speed", *VIEW]
_ERRORS = [*_CONDITION, "population", "trimming"]
_ROLES = ("mean", "absolute", "second", "core")
_DIGITS = 4


@dataclass(frozen=True, slots=True)
class Chart:
    """A figure of the explorer.

    Attributes
    ----------
    id, title
        Its name and heading.
    what_if
        What it would look like if errors were as many estimators assume, or what else to look for.
    """

    id: str
    title: str
    what_if: str


_OF_ERRORS = (
    Chart("mean", "Mean error (px)", "If there were no bias, the band would contain zero everywhere."),
    Chart(
        "absolute", "Mean absolute error (px)", "If errors were independent in every frame, the curve would be flat."
    ),
    Chart(
        "second",
        "RMS over tracks (px)",
        "If errors were a random walk, the curve would be a square root of age; with a drift it would be a line.",
    ),
    Chart("core", "Core error (px)", "If errors were Gaussian, the core of a scene would be equal to its RMS."),
)
_SURVIVAL = Chart(
    "survival",
    "Share of tracks that live longer (all tracks)",
    "If features were lost by chance alone, the curve would be an exponential decay.",
)


def charts(data: ReportData) -> Sequence[Chart]:
    """The figures. Those of errors are left out where points are fitted to the tracks."""
    return (_SURVIVAL,) if data.truth_is_fitted else (*_OF_ERRORS, _SURVIVAL)


def explored(data: ReportData) -> dict[str, Any]:
    """Curves and choices, as the script of the page reads them.

    Returns: `charts`, as dictionaries; `axis` and `title` of the axis; `colours` of trackers; `choices`, lists by the
    name of a control; `start`, the first choice. `errors`, `scenes` and `survival` are lists of curves. A curve has its
    condition, `at` and, by role, values in `u` and `v` with bounds.
    """
    return {
        "charts": [asdict(chart) for chart in charts(data)],
        "axis": data.axis.name,
        "title": data.axis.title,
        "colours": data.colour,
        "choices": _choices(data),
        "start": {"speed": data.slowest, **data.view, "population": data.population, "trimming": str(data.trimming)},
        "errors": [] if data.truth_is_fitted else sorted(_pooled(data), key=lambda curve: data.place(curve["tracker"])),
        "scenes": [] if data.truth_is_fitted else list(_scenes(data)),
        "survival": sorted(_survival(data), key=lambda curve: data.place(curve["tracker"])),
    }


def _choices(data: ReportData) -> dict[str, list[Any]]:
    """Values of every control."""
    return {
        "tracker": data.trackers,
        "speed": data.speeds,
        "lighting": data.lightings,
        "rotation": data.rotations,
        "direction": data.directions,
        "camera": data.cameras,
        **{
            name: _included(data)[name].unique().sort().cast(pl.String).to_list() for name in ("population", "trimming")
        },
        "scene": sorted({entry.sequence.scene for entry in data.manifest.sequences.values()}),
    }


def _included(data: ReportData) -> pl.DataFrame:
    """Points of the pooled curves."""
    points = data.points.filter(pl.col("role").is_in(_ROLES))
    return points.filter(population=data.population, trimming=data.trimming) if data.is_large else points


def _pooled(data: ReportData) -> Iterator[dict[str, Any]]:
    """Pooled curves with intervals."""
    for key, part in _included(data).sort("role", "at").group_by(_ERRORS, maintain_order=True):
        roles = {role: part.filter(role=role) for role in _ROLES if role in part["role"]}
        yield _curve(_ERRORS, key) | {
            role: _values(rows, ["at", "n", "u", "v", *BOUNDS]) for role, rows in roles.items()
        }


def _scenes(data: ReportData) -> Iterator[dict[str, Any]]:
    """Curves of single scenes, of the population of the run."""
    entries = data.sequences if data.is_large else data.manifest.sequences
    for name in sorted(entries):
        table = _of_scene(data, name)
        for key, part in table.group_by([*_ERRORS, "scene"], maintain_order=True):
            places = part.select("at", "n")
            roles = {role: part.select(u=f"{role}_u", v=f"{role}_v") for role in _ROLES}
            yield _curve([*_ERRORS, "scene"], key) | {
                role: _values(places.hstack(rows).drop_nulls(["u", "v"]), ["at", "n", "u", "v"])
                for role, rows in roles.items()
            }


def _of_scene(data: ReportData, name: str) -> pl.DataFrame:
    """Statistics of one sequence by age or frame, px, one row per condition and place."""
    keys = [*_ERRORS, "axis", "at"]
    chosen: dict[str, Any] = {"axis": data.axis.name, "population": data.population}
    chosen |= {"trimming": data.trimming, "speed": data.slowest} if data.is_large else {}
    enough = pl.col("n") >= SCENE_FEATURES
    moments, scales = (data.run.sequence_table(table, name).filter(enough, **chosen) for table in ("moments", "scales"))
    cores = scales.select(*keys, core_u="core_u_px", core_v="core_v_px")
    squares = {axis: pl.col(f"m_{axis}{axis}") + pl.col("n") * pl.col(f"mean_{axis}") ** 2 for axis in "uv"}
    roots = {f"second_{axis}": (total / pl.col("n")).sqrt() for axis, total in squares.items()}
    named = {f"absolute_{axis}": pl.col(f"mean_abs_{axis}") for axis in "uv"}
    return moments.with_columns(**roots, **named).join(cores, on=keys, how="left", nulls_equal=True).sort(keys)


def _survival(data: ReportData) -> Iterator[dict[str, Any]]:
    """Share of tracks that live longer than a number of frames that their tracker saw."""
    table = data.with_bounds_of(data["lifetimes"], "survival").sort("lifetime")
    values = table.select(*_CONDITION, at="lifetime", n="at_risk", u="survival", u_low="low", u_high="high")
    for key, part in values.group_by(_CONDITION, maintain_order=True):
        yield _curve(_CONDITION, key) | {"survival": _values(part, ["at", "n", "u", "u_low", "u_high"])}


def _curve(names: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    return dict(zip(names, values, strict=True))


def _values(table: pl.DataFrame, names: Sequence[str]) -> Mapping[str, list[Any]]:
    """Columns as lists, numbers with a few digits; bounds that are all unknown are left out."""
    rounded = table.select(names).with_columns(cs.float().round_sig_figs(_DIGITS)).fill_nan(None)
    return {name: rounded[name].to_list() for name in names if rounded[name].null_count() < rounded.height}
