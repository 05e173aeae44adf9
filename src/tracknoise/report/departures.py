"""How what is done here departs from the paper, and what that changes in runs that repeat it."""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

import polars as pl

from tracknoise.findings.wording import DASH, SPACE, effect_text, number, percent, pixels
from tracknoise.report import measured, paper
from tracknoise.report.evidence import Evidence
from tracknoise.report.tables import Cells
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.differences import comparable, largest_differences
from tracknoise.statistics.lifetimes import mean_lifetime


@dataclass(frozen=True, slots=True)
class Part:
    """One experiment of a replication.

    Attributes
    ----------
    title
        What it is called.
    evidence
        Its run.
    variants
        A run of its first scene with variants of its trackers, if there is one.
    """

    title: str
    evidence: Evidence
    variants: Evidence | None = None


@dataclass(frozen=True, slots=True)
class Departure:
    """One way in which what is done here departs from the paper.

    Attributes
    ----------
    id
        Anchor in the page.
    title, text
        What differs, in a few words, and in a few sentences.
    measured
        What that changes in the runs at hand; None where their tables do not tell.
    """

    id: str
    title: str
    text: str
    measured: Cells | None


def departures(parts: Sequence[Part]) -> list[Departure]:
    """Every departure, with its effect in the runs at hand where that can be computed."""
    return [
        Departure(id=name, title=item["title"], text=item["text"].strip(), measured=_measured(name, parts))
        for name, item in texts().items()
    ]


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Title and text of every departure, by its id."""
    source = resources.files("tracknoise.report") / "departures.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def _measured(name: str, parts: Sequence[Part]) -> Cells | None:
    if name in _CURVES:
        return _by_curves(name, parts)
    measure = {"lifetimes": _lifetimes, "rejection": _rejection}.get(name)
    return measure(parts) if measure else None


def _populations(curves: pl.DataFrame, evidence: Evidence) -> pl.DataFrame:
    chosen = curves.filter(weighting="features", trimming="trimmed")
    return chosen.with_columns(level=pl.col("population").cast(pl.String))


def _trimmings(curves: pl.DataFrame, evidence: Evidence) -> pl.DataFrame:
    chosen = curves.filter(weighting="features", population=evidence.population)
    return chosen.with_columns(level=pl.col("trimming").cast(pl.String))


def _weightings(curves: pl.DataFrame, evidence: Evidence) -> pl.DataFrame:
    chosen = curves.filter(trimming="trimmed", population=evidence.population)
    return chosen.with_columns(level=pl.col("weighting").cast(pl.String))


def _centres(curves: pl.DataFrame, evidence: Evidence) -> pl.DataFrame:
    chosen = curves.filter(weighting="features", trimming="trimmed", population=evidence.population)
    return chosen.filter(pl.col("role").is_in(["second", "central"])).with_columns(level="role", role=pl.lit("second"))


_CURVES: Mapping[str, tuple[str, Callable[[pl.DataFrame, Evidence], pl.DataFrame]]] = {
    "occlusion": ("Errors of visible features against those of all projected ones", _populations),
    "trimming": ("Errors of all tracks against those of the kept ones", _trimmings),
    "weighting": ("Scenes weighted alike against features pooled", _weightings),
    "covariance": ("Covariance about the mean against the second moment about zero", _centres),
}
"""Departures that are a choice between curves: what is compared, and how the curves are told apart."""
_ROLES = ("mean", "absolute", "second")


def _by_curves(name: str, parts: Sequence[Part]) -> Cells:
    """For each tracker at the nominal speed, how far the two curves lie apart, relative to their common variation."""
    caption, choose = _CURVES[name]
    roles = [role for role in _ROLES if name != "covariance" or role == "second"]
    rows = []
    for part in parts:
        found = _apart(part.evidence, choose)
        for tracker in part.evidence.trackers:
            cells = [_difference(found.filter(tracker=tracker, role=role), role) for role in roles]
            if name == "weighting" and _is_one_scene(part.evidence, tracker):
                cells = [(DASH, "one scene")] * len(roles)
            rows.append([part.title, tracker, *(text for pair in cells for text in pair)])
    headings = ["experiment", "tracker", *(["differ by", "effect"] * len(roles))]
    groups = [("", 2), *((paper.STATISTICS[role], 2) for role in roles)]
    return Cells(caption, headings, rows, [False, False, *[True] * (2 * len(roles))], groups)


def _is_one_scene(evidence: Evidence, tracker: str) -> bool:
    """Whether a tracker's curves at the nominal speed rest on a single scene, so that its weight changes nothing."""
    return evidence.nominal(evidence.curves).filter(tracker=tracker)["n_scenes"].max() == 1


def _apart(evidence: Evidence, choose: Callable[[pl.DataFrame, Evidence], pl.DataFrame]) -> pl.DataFrame:
    """The largest differences between the two levels that `choose` tells apart, by tracker and role."""
    key_frames = {direction: evidence.key_frame(direction) or 0 for direction in evidence.directions}
    roles = evidence.axis.roles
    curves = comparable(evidence.nominal(evidence.curves), key_frames).with_columns(
        role=pl.col("statistic").replace_strict(roles, return_dtype=pl.String)
    )
    return largest_differences(choose(curves, evidence), by=["tracker", "role"], level="level").sort(
        "effect", "coordinate", descending=[True, False]
    )


def _difference(found: pl.DataFrame, role: str) -> tuple[str, str]:
    if found.is_empty():
        return DASH, DASH
    row = found.row(0, named=True)
    return f"{number(row['difference'])} {'px²' if role == 'second' else 'px'}", effect_text(row["effect"])


def _lifetimes(parts: Sequence[Part]) -> Cells:
    """Mean lifetime as the paper counts it, and by Kaplan and Meier."""
    rows = []
    for part in parts:
        table = mean_lifetime(part.evidence.nominal(part.evidence.lifetimes))
        for row in measured.in_order(part.evidence, table).to_dicts():
            censored = percent(row["n_censored"] / row["n_tracks"])
            means = [number(row["mean_lifetime"]), number(row["restricted_mean_lifetime"])]
            rows.append([part.title, row["tracker"], *means, censored])
    headings = ["experiment", "tracker", "mean, as the paper has it", "Kaplan-Meier mean", "cut short by the end"]
    return Cells("Mean lifetime, frames", headings, rows, [False, False, True, True, True])


def _rejection(parts: Sequence[Part]) -> Cells | None:
    """What the ways to reject outliers come to, in the first scene of each experiment."""
    rows = []
    for title, variants in ((part.title, part.variants) for part in parts if part.variants):
        table = variants.nominal(variants.summary).join(_roots_where_all_are(variants), on="tracker", how="left")
        for row in measured.in_order(variants, table).to_dicts():
            ratio = DASH if row["outlier_ratio"] is None else percent(row["outlier_ratio"])
            place = DASH if row["since"] is None else variants.axis.place(row["since"]).replace(" ", SPACE)
            rms = [pixels(row["u"]), pixels(row["v"])]
            rows.append([title, row["tracker"], ratio, number(row["mean_lifetime"]), place, *rms])
    headings = ["experiment", "tracker", "outlier ratio", "mean lifetime (frames)", "where", "u (px)", "v (px)"]
    numeric = [False, False, True, True, False, True, True]
    groups = [("", 4), ("root mean square error, trimmed", 3)]
    return Cells("Ways to reject outliers", headings, rows, numeric, groups) if rows else None


def _roots_where_all_are(evidence: Evidence) -> pl.DataFrame:
    """Roots of trimmed second moments at the last place, up to `REFERENCE_AGE`, that all trackers with a curve share.

    Columns tracker, since, u and v; a row a tracker, or none where nothing is shared.
    """
    points = evidence.nominal(evidence.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming="trimmed",
        population=evidence.population,
    )
    is_shared = pl.col("tracker").n_unique().over("since") == points["tracker"].n_unique()
    shared = points.filter(is_shared).select("tracker", "since", "u", "v")
    return shared.filter(pl.col("since") == pl.col("since").max())
