"""The section that says what was measured, and with what."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import polars as pl

from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import MOST_CONDITIONS, Evidence
from tracknoise.report.names import MOST_NAMED, by_statement, together
from tracknoise.report.sentences import TIMES, count, listing, number, percent
from tracknoise.report.tables import Cells, cells
from tracknoise.statistics.populations import POPULATIONS
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import TRIMMING, TrackEnd, TruthStatus

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
    """One row a sequence; where these are too many, one a scene, as the figures are about it."""
    many = len(evidence.manifest.sequences) > MOST_CONDITIONS
    entries = evidence.sequences.values() if many else [e for _, e in sorted(evidence.manifest.sequences.items())]
    several: dict[str, list[Any]] = {
        "lighting": evidence.lightings,
        "rotation": evidence.rotations,
        "direction": evidence.directions,
    }
    direction = {"direction": "direction"} if len(evidence.directions) > 1 else {}
    columns = {
        "dataset": "dataset", "scene": "scene", "lighting": "lighting", "rotation": "rotation (°)", **direction,
        "n_frames": "frames", "size": "image (px)", "truth": "truth", "seconds": "measured in (s)",
    }  # fmt: skip
    rows = [
        {name: value for name, value in _columns_of(entry).items() if name in columns}
        | {"size": f"{entry.width} {TIMES} {entry.height}", "seconds": f"{entry.seconds:.1f}"}
        for entry in entries
    ]
    kinds = dict.fromkeys(columns, pl.String) | {"rotation": pl.Int64, "n_frames": pl.Int64}
    caption = "Sequences"
    if many:
        others = listing(f"{len(values)} {name}s" for name, values in several.items() if len(values) > 1)
        caption = f"Sequences,{evidence.where}, of {count(len(evidence.manifest.sequences), 'sequence')} in all"
        caption += f" ({others})" if others else ""
    return cells(pl.DataFrame(rows, schema=kinds), columns, caption)


def _columns_of(entry: SequenceEntry) -> dict[str, Any]:
    return {**asdict(entry), **asdict(entry.sequence)}


def excluded_scenes(evidence: Evidence) -> list[tuple[str, str]]:
    """Scenes of the data set that are not measured, and why."""
    return sorted(evidence.manifest.excluded_scenes.items())


def notes(evidence: Evidence) -> list[tuple[str, str]]:
    """What readers corrected or assumed: sequences and sentence, the same sentence once."""
    told = ((key, note) for key, entry in sorted(evidence.manifest.sequences.items()) for note in entry.notes)
    return [(together(keys), note) for note, keys in by_statement(told).items()]


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
    return any(entry.truth in ("birth", "scan") and entry.sequence.dataset != "simulated" for entry in entries)


def without_truth(evidence: Evidence) -> list[tuple[str, str]]:
    """Conditions, then sequences, most of whose observations have no true position: which, and a sentence."""
    statuses = evidence.counts.filter(kind="truth")
    if statuses["n"].sum() > 0 and not statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum():
        return [("The whole run", _unknown(evidence, statuses))]
    listed, keys = evidence.listed(statuses), list(condition_columns(evidence))
    conditions = in_order(evidence, listed.select(keys).unique()).iter_rows(named=True)
    sequences = evidence.sequences if evidence.is_large else sorted(evidence.manifest.sequences)
    return [
        *_mostly_unknown(evidence, [(condition(names), listed.filter(**names)) for names in conditions]),
        *_mostly_unknown(
            evidence, [(key, evidence.run.sequence_table("counts", key).filter(kind="truth")) for key in sequences]
        ),
    ]


def _mostly_unknown(evidence: Evidence, groups: Sequence[tuple[str, pl.DataFrame]]) -> list[tuple[str, str]]:
    """Groups of observations most of which have no true position, each with a sentence, or all with one if many."""
    found = [(place, rows, sentence) for place, rows in groups if (sentence := _unknown(evidence, rows))]
    if len(found) <= MOST_NAMED:
        return [(place, sentence) for place, _, sentence in found]
    return [(together([place for place, *_ in found]), _unknown(evidence, pl.concat([rows for _, rows, _ in found])))]


def _unknown(evidence: Evidence, rows: pl.DataFrame) -> str:
    """What share of observations, counted by truth status, has no true position, and why; empty where it is small."""
    n = {name: int(rows.filter(name=name)["n"].sum()) for name in _TRUTHS}
    total = sum(n.values())
    unknown = {name: n[name] for name in _TRUTHS if name not in POPULATIONS["projected"] and n[name]}
    if sum(unknown.values()) <= _MANY * total:
        return ""
    labels = _truths(evidence)
    reasons = listing(f"{percent(value / total)} {labels[name]}" for name, value in unknown.items())
    rest = "its errors are of the rest alone" if sum(unknown.values()) < total else "no error could be measured"
    share = percent(sum(unknown.values()) / total)
    return f"the true position of {share} of {count(total, 'observation')} is unknown ({reasons}); {rest}."


def _truths(evidence: Evidence) -> dict[str, str]:
    """What each truth status is called: with a scan, features have a depth only where that gives them one."""
    return _TRUTHS | ({"no_depth": "not on the scan"} if evidence.axis is FRAME else {})


def condition(names: Mapping[str, Any]) -> str:
    """Name a condition, by its values of `condition_columns`."""
    lighting = f" under lighting {names['lighting']}" if "lighting" in names else ""
    rotation = f" at rotation {names['rotation']}°" if "rotation" in names else ""
    direction = f" played {names['direction']}" if "direction" in names else ""
    return f"{names['tracker']} at speed {names['speed']}{lighting}{rotation}{direction}"


def truth_counts(evidence: Evidence) -> Cells:
    """Observations of each condition by truth status."""
    labels = _truths(evidence)
    names = {status.name: labels[status.name] for status in TruthStatus}
    return _pivot(evidence, "truth", names, "Observations by truth status")


def end_counts(evidence: Evidence) -> Cells:
    """Tracks of each condition by the way they ended."""
    names = {end.name: _ENDS[end.name] for end in TrackEnd}
    return _pivot(evidence, "end", names, "Tracks by the way they ended")


def failures(evidence: Evidence) -> list[tuple[str, str]]:
    """Sequences that could not be measured, and why: those that failed of the same together."""
    told = by_statement(sorted(evidence.manifest.failures.items()))
    return [(together(keys), cause) for cause, keys in told.items()]


def _pivot(evidence: Evidence, kind: str, names: Mapping[str, str], caption: str) -> Cells:
    """Counts, every measured condition down and names across; each with its share of the row."""
    keys = condition_columns(evidence)
    table = evidence.listed(evidence.counts).filter(kind=kind)
    totals = [pl.col("n").filter(pl.col("name") == name).sum().alias(name) for name in names]
    wide = table.group_by(list(keys)).agg(*totals, all=pl.col("n").sum())
    every = evidence.listed(evidence.summary).select(list(keys)).unique()
    wide = in_order(evidence, every.join(wide, on=list(keys), how="left").fill_null(0))
    shown = [_with_share(pl.col(name), pl.col("all")).alias(name) for name in names]
    result = cells(wide.with_columns(shown), {**keys, "all": "all", **names}, caption + _chosen(evidence))
    words = ("tracker", "lighting", "direction")
    return replace(result, numeric=[name not in words for name in (*keys, "all", *names)])


def summary(evidence: Evidence) -> Cells:
    """The first numbers of every condition, or of those of the view where there are too many."""
    conditions, axis = condition_columns(evidence), evidence.axis
    lived = {
        "n_tracks": "tracks",
        "mean_lifetime": "mean",
        "median_lifetime": "KM median",
        "outlier_ratio": "outliers",
        "at": axis.name,
    }
    signs = {"nu": axis.signs["mean"], "eta": axis.signs["absolute"], "rms": axis.signs["second"]}
    errors = {
        f"{trimming}_{value}_{coordinate}_px": f"{sign} {coordinate}"
        for trimming in TRIMMING.categories[::-1]
        for value, sign in signs.items()
        for coordinate in "uv"
    }
    groups = [("", len(conditions) + 1), ("lifetime (frames)", 2), ("", 2), ("trimmed (px)", 6), ("untrimmed (px)", 6)]
    table = in_order(evidence, evidence.listed(evidence.summary))
    caption = f"Every condition at a glance{_chosen(evidence)}"
    return cells(table, {**conditions, **lived, **errors}, caption, groups=groups)


def _chosen(evidence: Evidence) -> str:
    """What a table does not hold, after its caption."""
    if not evidence.is_large:
        return ""
    n = evidence.summary.height - evidence.listed(evidence.summary).height
    return f",{evidence.where}; {count(n, 'other condition')} in the table's file"


def _with_share(n: pl.Expr, total: pl.Expr) -> pl.Expr:
    def written(row: Mapping[str, int]) -> str:
        share = f" ({100 * row['n'] / row['total']:.1f} %)" if row["n"] else ""
        return f"{number(row['n'])}{share}"

    return pl.struct(n=n, total=total).map_elements(written, return_dtype=pl.String)


def condition_columns(evidence: Evidence) -> dict[str, str]:
    """Columns that tell the conditions in a table on the page apart, with their headings."""
    if evidence.is_large:
        return {"tracker": "tracker", "speed": "speed"}
    lighting = {"lighting": "lighting"} if len(evidence.lightings) > 1 else {}
    rotation = {"rotation": "rotation (°)"} if len(evidence.rotations) > 1 else {}
    direction = {"direction": "direction"} if len(evidence.directions) > 1 else {}
    return {"tracker": "tracker", "speed": "speed", **lighting, **rotation, **direction}


def in_order(evidence: Evidence, table: pl.DataFrame) -> pl.DataFrame:
    """Sort conditions by tracker, speed, lighting, rotation and direction, names as the experiment has them."""
    order = {"tracker": evidence.trackers, "lighting": evidence.lightings, "direction": evidence.directions}
    keys = [
        pl.col(name).replace_strict(list(order[name]), range(len(order[name])), return_dtype=pl.Int64)
        if name in order
        else pl.col(name)
        for name in ("tracker", "speed", "lighting", "rotation", "direction")
        if name in table.columns
    ]
    return table.sort(keys)


def _flattened(settings: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Settings by their full keys; a table in a list of tables is told by its place: ``views[1].rotation``."""
    rows = []
    for key, value in settings.items():
        name = prefix + key
        if isinstance(value, dict):
            rows += _flattened(value, f"{name}.")
        elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
            rows += [row for place, item in enumerate(value) for row in _flattened(item, f"{name}[{place}].")]
        else:
            rows.append((name, _value(value)))
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
