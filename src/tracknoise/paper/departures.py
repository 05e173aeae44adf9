"""Differences from the paper, and what they change in runs that repeat its experiments."""

import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import chain
from pathlib import Path

import polars as pl

from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.yardstick import comparable, largest_differences
from tracknoise.tables.enumerations import Trimming
from tracknoise.words import DASH, SPACE, STATISTICS, effect_text, number, percent, pixels

START = "<!-- The rest of this page is made by python -m tracknoise.paper.departures docs/paper.md -->\n"
"""What follows it in ``docs/paper.md`` is made from the texts."""


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Title and text of every difference by its id, in the order of the page. Some have `see`, a page in docs/."""
    source = resources.files("tracknoise.paper") / "departures.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def markdown() -> str:
    """The end of ``docs/paper.md``: a paragraph for each difference."""
    return "".join(f"\n{_section(item)}\n" for item in texts().values())


def _section(item: Mapping[str, str]) -> str:
    text = f"**{item['title']}.** {item['text'].strip()}"
    if "see" in item:
        text += f" See [{item['see'].partition('#')[0].removesuffix('.md')}]({item['see']})."
    return text


def main() -> None:
    """Replace the differences in a page, whose path is the argument."""
    page = Path(sys.argv[1])
    opening = page.read_text(encoding="utf-8").partition(START)[0]
    page.write_text(opening + START + markdown(), encoding="utf-8")


if __name__ == "__main__":
    main()


@dataclass(frozen=True, slots=True)
class Part:
    """One experiment of a replication."""

    title: str  # its name
    data: ReportData  # of its run
    # Of a run of its first scene with variants of its trackers. None where there is none.
    variants: ReportData | None = None


@dataclass(frozen=True, slots=True)
class Departure:
    """One difference from the paper."""

    id: str  # anchor in the page
    title: str  # what differs
    paragraphs: Sequence[str]  # the text, with code between backticks
    measured: Cells | None  # What it changes in these runs. None where their tables cannot show it.


def departures(parts: Sequence[Part]) -> list[Departure]:
    """Every difference, with its effect in these runs where it can be computed."""
    return [
        Departure(name, item["title"], item["text"].strip().split("\n\n"), _measured(name, parts))
        for name, item in texts().items()
    ]


def _measured(name: str, parts: Sequence[Part]) -> Cells | None:
    if name in _CURVES:
        return _by_curves(name, parts)
    measure = {"lifetimes": _lifetimes, "rejection": _rejection}.get(name)
    return measure(parts) if measure else None


_CURVES: Mapping[str, tuple[str, str]] = {
    "occlusion": ("Errors of visible features compared with all projected ones", "population"),
    "trimming": ("Errors of all tracks compared with the kept ones", "trimming"),
    "weighting": ("Equally weighted scenes compared with pooled features", "weighting"),
    "covariance": ("Covariance about the mean compared with the second moment about zero", "role"),
}
"""Differences that are a choice between curves: caption, and the column that tells the two apart."""
_ROLES = ("mean", "absolute", "second")
_TRIMMINGS = (Trimming.trimmed, Trimming.untrimmed)


def _by_curves(name: str, parts: Sequence[Part]) -> Cells:
    """For each tracker at the nominal speed, how much the two curves differ, relative to their common variation."""
    caption, compared = _CURVES[name]
    roles = [role for role in _ROLES if name != "covariance" or role == "second"]
    shown = [(trimming, role) for trimming in (_TRIMMINGS if name != "trimming" else (None,)) for role in roles]
    rows = []
    for part in parts:
        differences = {trimming: _differences(part.data, compared, trimming) for trimming, _ in shown}
        for tracker in part.data.trackers:
            cells = [
                _difference(differences[trimming].filter(tracker=tracker, role=role), role) for trimming, role in shown
            ]
            if name == "weighting" and _is_one_scene(part.data, tracker):
                cells = [(DASH, "one scene")] * len(shown)
            rows.append([part.title, tracker, *(text for pair in cells for text in pair)])
    headings = ["experiment", "tracker", *(["difference", "effect"] * len(shown))]
    groups = [("", 2), *((", ".join(filter(None, [STATISTICS[role], trimming])), 2) for trimming, role in shown)]
    return Cells(caption, headings, rows, [False, False, *[True] * (2 * len(shown))], groups)


def _is_one_scene(data: ReportData, tracker: str) -> bool:
    """Whether a tracker's curves at the nominal speed come from a single scene, so that weights change nothing."""
    return data.nominal(data["curves"]).filter(tracker=tracker)["n_scenes"].max() == 1


def _differences(data: ReportData, compared: str, trimming: Trimming | None) -> pl.DataFrame:
    """The largest differences between the two values of the column `compared`, by tracker and role.

    Curves are those of one trimming; of both where these are compared.
    """
    key_frames = {direction: data.key_frame(direction) or 0 for direction in data.directions}
    fixed = {"weighting": "features", "population": data.population, "trimming": trimming}
    chosen = data.nominal(data["curves"]).filter(**{name: value for name, value in fixed.items() if name != compared})
    curves = comparable(chosen, key_frames).with_columns(
        role=pl.col("statistic").replace_strict(data.axis.roles, return_dtype=pl.String)
    )
    if compared == "role":
        curves = curves.filter(pl.col("role").is_in(["second", "central"]))
        curves = curves.with_columns(level="role", role=pl.lit("second"))
    else:
        curves = curves.with_columns(level=pl.col(compared).cast(pl.String))
    return largest_differences(curves, by=["tracker", "role"], level="level").sort(
        "effect", "coordinate", descending=[True, False]
    )


def _difference(differences: pl.DataFrame, role: str) -> tuple[str, str]:
    if differences.is_empty():
        return DASH, DASH
    row = differences.row(0, named=True)
    return f"{number(row['difference'])} {'px²' if role == 'second' else 'px'}", effect_text(row["effect"])


def _lifetimes(parts: Sequence[Part]) -> Cells:
    """Mean lifetime as the paper computes it, and the Kaplan-Meier mean."""
    rows = []
    for part in parts:
        summary = part.data.nominal(part.data["summary"])
        censored = part.data.nominal(part.data["lifetimes"]).group_by("tracker").agg(pl.col("n_censored").sum())
        for row in part.data.in_order(summary.join(censored, on="tracker")).to_dicts():
            names = ("mean_lifetime", "restricted_mean_lifetime", "restricted_to")
            cut = percent(row["n_censored"] / row["n_tracks"])
            rows.append([part.title, row["tracker"], *(number(row[name]) for name in names), cut])
    headings = ["experiment", "tracker", "mean as in the paper", "Kaplan-Meier mean", "up to", "censored"]
    return Cells("Mean lifetime (frames)", headings, rows, [False, False, True, True, True, True])


def _rejection(parts: Sequence[Part]) -> Cells | None:
    """Results of the variants of outlier rejection, in the first scene of each experiment."""
    rows = []
    for title, variants in ((part.title, part.variants) for part in parts if part.variants):
        roots = {trimming: _shared_roots(variants, trimming) for trimming in _TRIMMINGS}
        for row in variants.in_order(variants.nominal(variants["summary"])).to_dicts():
            ratio = DASH if row["outlier_ratio"] is None else percent(row["outlier_ratio"])
            lengths = (_root_cells(variants, table.filter(tracker=row["tracker"])) for table in roots.values())
            rows.append([title, row["tracker"], ratio, number(row["mean_lifetime"]), *chain.from_iterable(lengths)])
    headings = ["experiment", "tracker", "outlier ratio", "mean lifetime (frames)", *["where", "u (px)", "v (px)"] * 2]
    numeric = [False, False, True, True, *[False, True, True] * 2]
    groups = [("", 4), *((f"root mean square error, {trimming}", 3) for trimming in _TRIMMINGS)]
    return Cells("Variants of outlier rejection", headings, rows, numeric, groups) if rows else None


def _root_cells(data: ReportData, roots: pl.DataFrame) -> list[str]:
    """Where roots of second moments are compared, and their values; dashes where there are none."""
    if roots.is_empty():
        return [DASH, DASH, DASH]
    row = roots.row(0, named=True)
    return [data.axis.place(row["since"]).replace(" ", SPACE), pixels(row["u"]), pixels(row["v"])]


def _shared_roots(data: ReportData, trimming: Trimming) -> pl.DataFrame:
    """Roots of second moments at the last age, up to `REFERENCE_AGE`, that all trackers with a curve share.

    Columns tracker, since, u and v: one row per tracker. Empty where no age is shared.
    """
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=trimming,
        population=data.population,
    )
    is_shared = pl.col("tracker").n_unique().over("since") == points["tracker"].n_unique()
    shared = points.filter(is_shared).select("tracker", "since", "u", "v")
    return shared.filter(pl.col("since") == pl.col("since").max())
