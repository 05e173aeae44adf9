"""The section on the measurement: sequences, trackers, settings, counts, and what failed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import accumulate
from typing import Any

import polars as pl

from tracknoise.report.cells import Cells, cells
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.prepared import POPULATIONS
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.text import dotted
from tracknoise.topics.bands import FRAME
from tracknoise.topics.run_data import MOST_CONDITIONS
from tracknoise.topics.sentences import MOST_NAMED, by_statement, together
from tracknoise.words import TIMES, condition_name, count, listing, number, percent

_TRUTHS = {
    "valid": "valid",
    "no_depth": "no depth",
    "edge": "depth edge",
    "occluded": "occluded",
    "out_of_image": "out of image",
    "behind_camera": "behind camera",
    "no_pose": "no pose",
}
_ENDS = {
    "lost": "lost",
    "outlier": "outlier",
    "displaced": "displaced",
    "masked": "masked",
    "sequence_end": "end of data",
}
_MANY = 0.5
"""The page warns where a larger share of observations has no true position."""


def scenes(data: ReportData) -> Cells:
    """One row per sequence. Where these are too many, only those of the view shown in the figures."""
    many = len(data.manifest.sequences) > MOST_CONDITIONS
    entries = data.sequences.values() if many else [e for _, e in sorted(data.manifest.sequences.items())]
    varied = data.varied
    played: dict[str, str] = {name: name for name in ("direction", "camera") if name in varied}
    columns: dict[str, str] = {
        "dataset": "dataset", "scene": "scene", "lighting": "lighting", "rotation": "rotation (°)",
        **played,
        "n_frames": "frames", "size": "image (px)", "truth": "truth",
    }  # fmt: skip
    rows = [
        {name: value for name, value in _columns_of(entry).items() if name in columns}
        | {"size": f"{entry.width} {TIMES} {entry.height}"}
        for entry in entries
    ]
    kinds = dict.fromkeys(columns, pl.String) | {"rotation": pl.Int64, "n_frames": pl.Int64}
    caption = "Sequences"
    if many:
        counts = listing(f"{len(values)} {name}s" for name, values in varied.items())
        caption = f"Sequences,{data.where}, of {count(len(data.manifest.sequences), 'sequence')} in all"
        caption += f" ({counts})" if counts else ""
    return cells(pl.DataFrame(rows, schema=kinds), columns, caption)


def _columns_of(entry: SequenceEntry) -> dict[str, Any]:
    return {**asdict(entry), **asdict(entry.sequence)}


def excluded_scenes(data: ReportData) -> list[tuple[str, str]]:
    """Scenes of the dataset that were skipped on purpose, and why."""
    return [(scene, data.shown(why)) for scene, why in sorted(data.manifest.excluded_scenes.items())]


def notes(data: ReportData) -> list[tuple[str, str]]:
    """What readers corrected or assumed: the sequences of each note."""
    pairs = ((key, data.shown(note)) for key, entry in sorted(data.manifest.sequences.items()) for note in entry.notes)
    return [(_sequences(keys), note) for note, keys in by_statement(pairs).items()]


def doubts(data: ReportData) -> list[tuple[str, str]]:
    """Why data look wrong: the sequences of each reason."""
    entries = sorted(data.manifest.sequences.items())
    pairs = ((key, data.shown(doubt)) for key, entry in entries for doubt in (*entry.doubts, *entry.cautions))
    return [(_sequences(keys), doubt) for doubt, keys in by_statement(pairs).items()]


def trackers(data: ReportData) -> Cells:
    """One row per tracker, with the options that the experiment sets."""
    rows = [
        {
            "name": str(entry.get("name") or entry.get("kind")),
            "kind": str(entry.get("kind", "")),
            "options": _written(entry.get("options", {})) or "all defaults",
        }
        for entry in data.shown(data.settings.get("trackers", []))
    ]
    columns = {"name": "tracker", "kind": "kind", "options": "options"}
    return cells(pl.DataFrame(rows, schema=dict.fromkeys(columns, pl.String)), columns, "Trackers")


def settings(data: ReportData) -> Cells:
    """Every other setting of the experiment, by its key."""
    plain = {key: data.shown(value) for key, value in data.settings.items() if key != "trackers"}
    rows = [{"key": key, "value": _value(value)} for key, value in dotted(plain)]
    table = pl.DataFrame(rows, schema={"key": pl.String, "value": pl.String})
    return cells(table, {"key": "setting", "value": "value"}, "Settings")


def mixed_kernels(data: ReportData) -> str | None:
    """A sentence if sequences were measured with different kernels of the numerical libraries; otherwise None.

    Those of sequences that were measured with an earlier version are not known, and are left out.
    """
    counted = Counter(entry.kernels for entry in data.manifest.sequences.values() if entry.kernels)
    if len(counted) < 2:
        return None
    parts = {kernels: kernels.split(", ") for kernels in counted}
    common = set.intersection(*map(set, parts.values()))
    differing = {kernels: ", ".join(part for part in parts[kernels] if part not in common) for kernels in parts}
    groups = "; ".join(f"{count(n, 'sequence')} with {differing[kernels]}" for kernels, n in sorted(counted.items()))
    return f"Sequences were measured on machines of different kinds ({groups}), whose numbers differ by rounding."


def provenance(data: ReportData) -> Cells:
    """Versions, machine, and kernels of the numerical libraries."""
    kernels = sorted({entry.kernels for entry in data.manifest.sequences.values() if entry.kernels})
    machine = data.manifest.machine | ({"kernels": "; ".join(kernels)} if kernels else {})
    rows = [
        {"what": name, "value": value} for part in (data.manifest.versions, machine) for name, value in part.items()
    ]
    table = pl.DataFrame(rows, schema={"what": pl.String, "value": pl.String})
    return cells(table, {"what": "component", "value": "version"}, "Versions and machine")


def truth_was_read(data: ReportData) -> bool:
    """Whether any true positions come from recorded poses and depth."""
    entries = data.manifest.sequences.values()
    return any(entry.truth != "raycast" and entry.sequence.dataset != "simulated" for entry in entries)


def without_truth(data: ReportData) -> list[tuple[str, str]]:
    """Conditions, then sequences, most of whose observations have no true position, each with a sentence."""
    statuses = data["counts"].filter(kind="truth")
    if statuses["n"].sum() > 0 and not statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum():
        return [("The whole run", _unknown(data, statuses))]
    listed, keys = data.listed(statuses), list(data.condition_columns)
    conditions = data.in_order(listed.select(keys).unique()).iter_rows(named=True)
    sequences = data.sequences if data.is_large else sorted(data.manifest.sequences)
    return [
        *_mostly_unknown(data, [(condition_name(names), listed.filter(**names)) for names in conditions]),
        *_mostly_unknown(
            data, [(key, data.run.sequence_table("counts", key).filter(kind="truth")) for key in sequences]
        ),
    ]


def _mostly_unknown(data: ReportData, groups: Sequence[tuple[str, pl.DataFrame]]) -> list[tuple[str, str]]:
    """Groups of observations that mostly have no true position, each with a sentence. Many share one sentence."""
    mostly_unknown = [(place, rows, sentence) for place, rows in groups if (sentence := _unknown(data, rows))]
    if len(mostly_unknown) <= MOST_NAMED:
        return [(place, sentence) for place, _, sentence in mostly_unknown]
    return [
        (
            together([place for place, *_ in mostly_unknown]),
            _unknown(data, pl.concat([rows for _, rows, _ in mostly_unknown])),
        )
    ]


def _unknown(data: ReportData, rows: pl.DataFrame) -> str:
    """The share of observations that have no true position, and why. Empty where it is small."""
    n = {name: int(rows.filter(name=name)["n"].sum()) for name in _TRUTHS}
    total = sum(n.values())
    unknown = {name: n[name] for name in _TRUTHS if name not in POPULATIONS["projected"] and n[name]}
    if sum(unknown.values()) <= _MANY * total:
        return ""
    labels = _truths(data)
    reasons = listing(f"{percent(value / total)} {labels[name]}" for name, value in unknown.items())
    consequence = (
        "Errors are measured for the rest only" if sum(unknown.values()) < total else "No error could be measured"
    )
    share = percent(sum(unknown.values()) / total)
    return f"the true position of {share} of {count(total, 'observation')} is unknown ({reasons}). {consequence}."


def _truths(data: ReportData) -> dict[str, str]:
    """Name of each truth status. With a scan, a feature without depth is one that is not on the scan."""
    return _TRUTHS | ({"no_depth": "not on the scan"} if data.axis is FRAME else {})


def truth_counts(data: ReportData) -> Cells:
    """Observations of each condition by truth status."""
    labels = _truths(data)
    names = {status.name: labels[status.name] for status in TruthStatus}
    return _pivot(data, "truth", names, "Observations by truth status")


def end_counts(data: ReportData) -> Cells:
    """Tracks of each condition by how they ended."""
    names = {end.name: _ENDS[end.name] for end in TrackEnd}
    return _pivot(data, "end", names, "Tracks by how they ended")


def failures(data: ReportData) -> list[tuple[str, str]]:
    """Sequences that could not be measured, by cause."""
    causes = by_statement((key, data.shown(cause)) for key, cause in sorted(data.manifest.failures.items()))
    return [(_sequences(keys), cause) for cause, keys in causes.items()]


def _sequences(keys: Sequence[str]) -> str:
    """Names of sequences as part of a sentence."""
    return together([*map(readable, keys)])


def _pivot(data: ReportData, kind: str, names: Mapping[str, str], caption: str) -> Cells:
    """Counts with their shares: one row per measured condition, one column per name."""
    keys = data.condition_columns
    table = data.listed(data["counts"]).filter(kind=kind)
    totals = [_sum(pl.col("n").filter(pl.col("name") == name)).alias(name) for name in names]
    wide = table.group_by(list(keys)).agg(*totals, all=_sum(pl.col("n")))
    conditions = data.listed(data["summary"]).select(list(keys)).unique()
    nothing = conditions.join(wide, on=list(keys), how="anti").with_columns(
        pl.lit(0).alias(name) for name in (*names, "all")
    )
    wide = data.in_order(pl.concat([wide, nothing.select(wide.columns).cast(wide.schema)]))
    shown = [_with_share(pl.col(name), pl.col("all")).alias(name) for name in names]
    result = cells(wide.with_columns(shown), {**keys, "all": "all", **names}, caption + _chosen(data))
    words = ("tracker", "lighting", "direction", "camera")
    return replace(result, numeric=[name not in words for name in (*keys, "all", *names)])


def summary(data: ReportData) -> Cells:
    """Key numbers of every condition. Where there are too many, only those of the view."""
    conditions, axis = data.condition_columns, data.axis
    lived = {
        "n_tracks": "tracks",
        "mean_lifetime": "mean",
        "median_lifetime": "KM median",
        "restricted_to": "horizon",
        "restricted_mean_lifetime": "KM mean to horizon",
        "median_until_failure": "KM median until failure",
        "outlier_ratio": "outliers",
        "at": axis.name,
    }
    signs = {"nu": "mean", "eta": "absolute", "rms": "RMS", "core": "core"}
    trimmings = (data.trimming, *(other for other in Trimming if other != data.trimming))
    errors = {
        f"{trimming}_{value}_{coordinate}_px": f"{sign} {coordinate}"
        for trimming in trimmings
        for value, sign in signs.items()
        for coordinate in "uv"
    }
    groups = [("", len(conditions) + 1), ("lifetime (frames)", 5), ("", 2)]
    groups += [(f"{trimming} (px)", 2 * len(signs)) for trimming in trimmings]
    table = data.in_order(data.listed(data["summary"]))
    caption = f"Key numbers of every condition{_chosen(data)}"
    return cells(table, {**conditions, **lived, **errors}, caption, groups=groups)


def summary_parts(data: ReportData) -> list[Cells]:
    """The table of `summary` in parts that fit the page: lifetimes and outliers, then errors by trimming."""
    table, keys = summary(data), len(data.condition_columns)
    ends = list(accumulate(span for _, span in table.groups))
    parts = [table.part(range(ends[2]), table.caption, table.groups[:3])]
    for (title, span), start, end in zip(table.groups[3:], ends[2:], ends[3:], strict=False):
        groups = [("", keys + 1), (title, span)]
        parts.append(table.part([*range(keys), ends[2] - 1, *range(start, end)], f"Errors, {title}", groups))
    return parts


def _chosen(data: ReportData) -> str:
    """What a table leaves out, to follow its caption."""
    if not data.is_large:
        return ""
    n = data["summary"].height - data.listed(data["summary"]).height
    return f",{data.where}; {count(n, 'other condition')} in the table file" if n else ""


def _sum(counts: pl.Expr) -> pl.Expr:
    """The sum of counts; null where one is null, because a tracker does not report it."""
    return pl.when(counts.null_count() == 0).then(counts.sum())


def _with_share(n: pl.Expr, total: pl.Expr) -> pl.Expr:
    def written(row: Mapping[str, int | None]) -> str:
        if row["n"] is None:
            return "not recorded"
        if row["total"] is None:
            return number(row["n"])
        share = f" ({100 * row['n'] / row['total']:.1f} %)" if row["n"] else ""
        return f"{number(row['n'])}{share}"

    return pl.struct(n=n, total=total).map_elements(written, return_dtype=pl.String)


def _written(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {_value(value)}" for key, value in dotted(options))


def _value(value: object) -> str:
    return (
        listing(map(str, value))
        if isinstance(value, list)
        else str(value).lower()
        if isinstance(value, bool)
        else str(value)
    )
