"""The section that says what was measured, and with what."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.report.evidence import Evidence
from tracknoise.report.sentences import TIMES, listing, number
from tracknoise.report.tables import Cells, cells
from tracknoise.tables.schema import TrackEnd, TruthStatus

_TRUTHS = {
    "valid": "valid",
    "no_depth": "no depth",
    "edge": "depth edge",
    "occluded": "occluded",
    "out_of_image": "out of image",
    "behind_camera": "behind camera",
}
_ENDS = {
    "lost": "lost",
    "outlier": "outlier",
    "displaced": "displaced",
    "masked": "masked",
    "sequence_end": "end of data",
}


def scenes(evidence: Evidence) -> Cells:
    """One row a sequence."""
    columns = {
        "dataset": "dataset", "scene": "scene", "lighting": "lighting", "rotation": "rotation (°)",
        "n_frames": "frames", "size": "image (px)", "truth": "truth", "seconds": "measured in (s)",
    }  # fmt: skip
    entries = [entry for _, entry in sorted(evidence.manifest.sequences.items())]
    rows = [
        {name: getattr(entry, name) for name in columns if name != "size"}
        | {"size": f"{entry.width} {TIMES} {entry.height}", "seconds": f"{entry.seconds:.1f}"}
        for entry in entries
    ]
    kinds = dict.fromkeys(columns, pl.String) | {"rotation": pl.Int64, "n_frames": pl.Int64}
    return cells(pl.DataFrame(rows, schema=kinds), columns, "Sequences")


def notes(evidence: Evidence) -> list[tuple[str, str]]:
    """What readers corrected or assumed: sequence and sentence."""
    return [(key, note) for key, entry in sorted(evidence.manifest.sequences.items()) for note in entry.notes]


def trackers(evidence: Evidence) -> Cells:
    """One row a tracker, with those of its options that the experiment sets."""
    rows = [
        {
            "name": str(entry.get("name") or entry.get("kind")),
            "kind": str(entry.get("kind", "")),
            "options": _written(entry.get("options", {})) or "all defaults",
        }
        for entry in evidence.settings.get("trackers", [])
    ]
    columns = {"name": "tracker", "kind": "kind", "options": "options"}
    return cells(pl.DataFrame(rows, schema=dict.fromkeys(columns, pl.String)), columns, "Trackers")


def settings(evidence: Evidence) -> Cells:
    """Every other setting of the experiment, by its key."""
    plain = {key: value for key, value in evidence.settings.items() if key != "trackers"}
    rows = [{"key": key, "value": value} for key, value in _flattened(plain)]
    table = pl.DataFrame(rows, schema={"key": pl.String, "value": pl.String})
    return cells(table, {"key": "setting", "value": "value"}, "Settings")


def provenance(evidence: Evidence) -> Cells:
    """Versions and machine."""
    rows = [
        {"what": name, "value": value}
        for part in (evidence.manifest.versions, evidence.manifest.machine)
        for name, value in part.items()
    ]
    table = pl.DataFrame(rows, schema={"what": pl.String, "value": pl.String})
    return cells(table, {"what": "made with", "value": "version"}, "Versions and machine")


def truth_counts(evidence: Evidence) -> Cells:
    """Observations of each condition by truth status."""
    names = {status.name: _TRUTHS[status.name] for status in TruthStatus}
    return _pivot(evidence, "truth", names, "Observations by truth status")


def end_counts(evidence: Evidence) -> Cells:
    """Tracks of each condition by the way they ended."""
    names = {end.name: _ENDS[end.name] for end in TrackEnd}
    return _pivot(evidence, "end", names, "Tracks by the way they ended")


def failures(evidence: Evidence) -> list[tuple[str, str]]:
    """Sequences that could not be measured, and why."""
    return sorted(evidence.manifest.failures.items())


def _pivot(evidence: Evidence, kind: str, names: Mapping[str, str], caption: str) -> Cells:
    """Counts, conditions down and names across; each with its share of the row."""
    keys = condition_columns(evidence)
    table = evidence.counts.filter(kind=kind)
    totals = [pl.col("n").filter(pl.col("name") == name).sum().alias(name) for name in names]
    wide = table.group_by(list(keys)).agg(*totals, all=pl.col("n").sum())
    wide = in_order(evidence, wide)
    shown = [_with_share(pl.col(name), pl.col("all")).alias(name) for name in names]
    result = cells(wide.with_columns(shown), {**keys, "all": "all", **names}, caption)
    return Cells(
        caption, result.headings, result.rows, [name not in ("tracker", "lighting") for name in [*keys, "all", *names]]
    )


def _with_share(n: pl.Expr, total: pl.Expr) -> pl.Expr:
    def written(row: Mapping[str, int]) -> str:
        share = f" ({100 * row['n'] / row['total']:.1f} %)" if row["n"] else ""
        return f"{number(row['n'])}{share}"

    return pl.struct(n=n, total=total).map_elements(written, return_dtype=pl.String)


def condition_columns(evidence: Evidence) -> dict[str, str]:
    """Columns that tell this run's conditions apart, with their headings."""
    lighting = {"lighting": "lighting"} if len(evidence.lightings) > 1 else {}
    rotation = {"rotation": "rotation (°)"} if len(evidence.rotations) > 1 else {}
    return {"tracker": "tracker", "speed": "speed", **lighting, **rotation}


def in_order(evidence: Evidence, table: pl.DataFrame) -> pl.DataFrame:
    """Sort conditions: trackers as the experiment names them, then speed, lighting and rotation."""
    columns = [name for name in condition_columns(evidence) if name != "tracker"]
    place = pl.Series([evidence.place(name) for name in table["tracker"]], dtype=pl.Int64)
    return table.with_columns(place=place).sort("place", *columns).drop("place")


def _flattened(settings: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    rows = []
    for key, value in settings.items():
        rows += _flattened(value, f"{prefix}{key}.") if isinstance(value, dict) else [(prefix + key, _value(value))]
    return rows


def _written(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in _flattened(options))


def _value(value: object) -> str:
    return (
        listing(map(str, value))
        if isinstance(value, list)
        else str(value).lower()
        if isinstance(value, bool)
        else str(value)
    )
