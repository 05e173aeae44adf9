"""The section that says what was measured, and with what."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.report.evidence import Evidence
from tracknoise.report.sentences import TIMES, count, listing, number, percent
from tracknoise.report.tables import Cells, cells
from tracknoise.statistics.populations import POPULATIONS
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
_MANY = 0.5
"""Share of observations without a true position above which the page says so at its top."""


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


def truth_was_read(evidence: Evidence) -> bool:
    """Whether any true positions come from poses and depth that were read rather than simulated."""
    entries = evidence.manifest.sequences.values()
    return any(entry.truth == "birth" and entry.dataset != "simulated" for entry in entries)


def without_truth(evidence: Evidence) -> list[tuple[str, str]]:
    """Conditions, then sequences, most of whose observations have no true position: which, and a sentence."""
    statuses = evidence.counts.filter(kind="truth")
    if statuses["n"].sum() > 0 and not statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum():
        return [("The whole run", _unknown(statuses))]
    keys = list(condition_columns(evidence))
    conditions = in_order(evidence, statuses.select(keys).unique()).iter_rows(named=True)
    groups = [(_condition(evidence, names), statuses.filter(**names)) for names in conditions]
    for key in sorted(evidence.manifest.sequences):
        groups.append((key, evidence.run.sequence_table("counts", key).filter(kind="truth")))
    return [(place, sentence) for place, rows in groups if (sentence := _unknown(rows))]


def _unknown(rows: pl.DataFrame) -> str:
    """What share of observations, counted by truth status, has no true position, and why; empty where it is small."""
    n = {name: int(rows.filter(name=name)["n"].sum()) for name in _TRUTHS}
    total = sum(n.values())
    unknown = {name: n[name] for name in _TRUTHS if name not in POPULATIONS["projected"] and n[name]}
    if sum(unknown.values()) <= _MANY * total:
        return ""
    reasons = listing(f"{percent(value / total)} {_TRUTHS[name]}" for name, value in unknown.items())
    rest = "its errors are of the rest alone" if sum(unknown.values()) < total else "no error could be measured"
    share = percent(sum(unknown.values()) / total)
    return f"the true position of {share} of {count(total, 'observation')} is unknown ({reasons}); {rest}."


def _condition(evidence: Evidence, names: Mapping[str, Any]) -> str:
    """A condition in words, by the values of `condition_columns`."""
    lighting = f" under lighting {names['lighting']}" if "lighting" in names else ""
    rotation = f" at rotation {names['rotation']}°" if "rotation" in names else ""
    return f"{names['tracker']} at speed {names['speed']}{lighting}{rotation}"


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
    """Counts, every measured condition down and names across; each with its share of the row."""
    keys = condition_columns(evidence)
    table = evidence.counts.filter(kind=kind)
    totals = [pl.col("n").filter(pl.col("name") == name).sum().alias(name) for name in names]
    wide = table.group_by(list(keys)).agg(*totals, all=pl.col("n").sum())
    every = evidence.summary.select(list(keys)).unique()
    wide = in_order(evidence, every.join(wide, on=list(keys), how="left").fill_null(0))
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
