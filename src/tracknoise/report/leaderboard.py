"""The leaderboard of a run with three or more trackers: what to set, errors, lifetimes, outliers, costs and ranks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import polars as pl

from tracknoise.analysis.factors import RANKED
from tracknoise.inference.estimates import Estimate
from tracknoise.report.answer import noise_to_set
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.tables.costs import read_costs
from tracknoise.text import significant
from tracknoise.topics.answer_summary import NoiseToSet, Number
from tracknoise.topics.factor_topic import disputed_ranks, ranks_by_role
from tracknoise.topics.headline import scalar_estimate, size_estimate
from tracknoise.topics.measures import Subject, card_number, shown_size
from tracknoise.words import SPACE, count, rms_of_tracks

TITLES: Mapping[str, str] = dict(
    zip(RANKED, ("typical error (core)", "RMS error", "lifetime", "outlier ratio"), strict=True)
)
"""What trackers are ranked by, by the roles of the statistics, in the order of the table."""
COLUMNS = dict(zip(RANKED, ("core", "RMS", "lifetime", "outliers"), strict=True))
_QUANTITY = dict(zip(RANKED, ("typical error", "RMS error", "lifetime", "outlier ratio"), strict=True))
_BEST = dict(
    zip(RANKED, ("smallest typical error", "smallest RMS error", "longest tracks", "fewest outliers"), strict=True)
)
_LESS = dict(zip(RANKED, ("smaller errors", "smaller errors", "longer tracks", "fewer outliers"), strict=True))
_SETTING, _COST = "sigma to set", "CPU per step"
_UNKNOWN = Number(None, None, None, "", "")


@dataclass(frozen=True, slots=True)
class Entry:
    """A cell of the leaderboard.

    Attributes
    ----------
    number
        The value with its interval; its text is empty where it is unknown.
    ranks
        Best and worst rank by it, such as ``2 to 5``; empty where trackers are not ranked by it.
    why
        From how many trackers it is not distinguished.
    """

    number: Number
    ranks: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """A tracker: its name and colour, and a cell for each column."""

    tracker: str
    colour: str
    entries: tuple[Entry, ...]
    is_bound: bool
    """Whether its sigma is an upper bound, because the truth is not trusted."""


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Trackers, the one to take first.

    Attributes
    ----------
    ranks
        Ranks of trackers by each statistic: `RANKS` with a column `role`.
    settings
        What to set in the estimator of the experiment.
    columns
        Headings of the cells of a row.
    rows
        Sorted by best rank in typical error, then by sigma to set.
    reading
        What ranks say.
    places
        What the columns are of.
    """

    ranks: pl.DataFrame
    settings: tuple[NoiseToSet, ...]
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    reading: str
    places: str

    def first_with(self, settings: Iterable[NoiseToSet]) -> str:
        """Name of the tracker to take with what is set in an estimator."""
        return order_of(self.ranks, {one.tracker: one for one in settings})[0]

    @property
    def leader(self) -> str:
        """Which tracker to take, what to set with it, and why, in two sentences."""
        return self.leader_with(self.settings)

    def leader_with(self, settings: Iterable[NoiseToSet]) -> str:
        """The same for what to set in another estimator."""
        return _leader(self.ranks, {one.tracker: one for one in settings})

    @property
    def ranked_by(self) -> str:
        """What the first ranks are of."""
        return TITLES[roles_of(self.ranks)[0]]

    def cells(self) -> Cells:
        """The same as a plain table, with ranks in brackets."""
        rows = [[row.tracker, *(_text(entry) for entry in row.entries)] for row in self.rows]
        caption = f"{self.places} In brackets: ranks. {self.reading}"
        return Cells(caption, ["tracker", *self.columns], rows, [False, *([True] * len(self.columns))])


def _text(entry: Entry) -> str:
    return f"{entry.number.text} ({entry.ranks})" if entry.ranks else entry.number.text


def leaderboard(data: ReportData) -> Leaderboard | None:
    """The leaderboard of a run; None where its trackers have no ranks."""
    ranks = ranks_by_role(data)
    if ranks.is_empty():
        return None
    costs, roles = read_costs(data.run), roles_of(ranks)
    settings = {one.tracker: one for one in noise_to_set(data)}
    spans = {(row["tracker"], row["role"]): row for row in ranks.iter_rows(named=True)}
    _, axis = shown_size(data)
    rows = []
    for tracker in order_of(ranks, settings):
        setting, subject = settings.get(tracker), Subject(data, tracker)
        entries = [Entry(_UNKNOWN if setting is None else setting.sigma)]
        entries += [_entry(_number(subject, role, axis), spans.get((tracker, role))) for role in roles]
        entries += [Entry(_cost(costs.get(tracker)))] if costs else []
        is_bound = setting is not None and setting.is_bound
        rows.append(Row(tracker, data.colour[tracker], tuple(entries), is_bound))
    columns = (_SETTING, *(COLUMNS[role] for role in roles), *([_COST] if costs else []))
    return Leaderboard(
        ranks, tuple(settings.values()), columns, tuple(rows), how_to_read(data, ranks), _places(data, axis)
    )


def _places(data: ReportData, axis: str) -> str:
    """What errors and lifetimes are of."""
    of_all = Subject(data, data.trackers[0])
    at = of_all.shared_at
    errors = (
        "" if at is None else f"Errors are in {axis} {of_all.conditions.place(at)}; {rms_of_tracks(data.trimming)}. "
    )
    return f"{errors}Lifetimes are restricted means."


def roles_of(ranks: pl.DataFrame) -> list[str]:
    """The roles that there are, in the order of the table."""
    return [role for role in TITLES if role in set(ranks["role"])]


def order_of(ranks: pl.DataFrame, settings: Mapping[str, NoiseToSet]) -> list[str]:
    """Names of trackers by their best rank in the first statistic, then by what to set, then by the middle of ranks."""
    first = ranks.filter(role=roles_of(ranks)[0])
    best = {row["tracker"]: (row["best"], row["best"] + row["worst"]) for row in first.iter_rows(named=True)}
    last = (ranks["n_trackers"].max(), 0)

    def place(tracker: str) -> tuple[Any, ...]:
        setting = settings.get(tracker)
        sigma = None if setting is None else setting.sigma.value
        rank, middle = best.get(tracker, last)
        return rank, sigma is None, sigma or 0.0, middle, tracker

    return sorted(ranks["tracker"].unique(), key=place)


def how_to_read(data: ReportData, ranks: pl.DataFrame) -> str:
    """What ranks say, and from how many scenes."""
    scenes = count(min(ranks["n_scenes"].to_list()), "scene")
    margin = f"{100.0 * data.margin:.3g}{SPACE}%"
    return (
        f"Rank 2 to 5 of 15, by {scenes}: one tracker is shown to be better by more than {margin}, ten to be worse."
        f"{disputed_ranks(ranks)}"
    )


def _number(subject: Subject, role: str, axis: str) -> Number:
    """The value that trackers are ranked by, as cards and curves show it."""
    return _UNKNOWN if (estimate := _estimate(subject, role, axis)) is None else card_number(estimate)


def _estimate(subject: Subject, role: str, axis: str) -> Estimate | None:
    row = subject.row
    if row is None:
        return None
    if role in ("core", "second"):
        name = "core" if role == "core" else "rms"
        return size_estimate(row, subject.intervals, subject.conditions, name, axis)
    statistic, unit = {"lifetime": ("restricted_mean_lifetime", "frames")}.get(role, ("outlier_ratio", "share"))
    return None if row[statistic] is None else scalar_estimate(row, subject.intervals, statistic, unit)


def _entry(number: Number, span: Mapping[str, Any] | None) -> Entry:
    if span is None:
        return Entry(number)
    best, worst, n = span["best"], span["worst"], span["n_trackers"]
    if alike := worst - best:
        texts = [f"not distinguished from {alike} of {count(n - 1, 'other')}"]
    else:
        texts = ["distinguished from every other tracker"]
    texts += [f"shown to be worse than {best - 1}"] if best > 1 else []
    texts += [f"shown to be better than {n - worst}"] if worst < n else []
    return Entry(number, str(best) if best == worst else f"{best} to {worst}", "; ".join(texts))


def _cost(ms: float | None) -> Number:
    return _UNKNOWN if ms is None else Number(ms, None, None, f"{significant(ms, 2)}{SPACE}ms", "")


def _leader(ranks: pl.DataFrame, settings: Mapping[str, NoiseToSet]) -> str:
    """Which tracker to take: of those that none is shown to be better than, the one with the smallest sigma."""
    first, *_ = order_of(ranks, settings)
    role = roles_of(ranks)[0]
    by_role = ranks.filter(role=role)
    n, equal = by_role["tracker"].n_unique(), by_role.filter(best=1).height
    reason = {
        1: f"the {_BEST[role]} of {n} trackers",
        n: f"the smallest sigma of {n} trackers, of which none is shown to have {_LESS[role]} than another",
    }.get(equal, f"the smallest sigma of the {equal} of {n} trackers that share the first rank in {_QUANTITY[role]}")
    setting = settings.get(first)
    if setting is None or not setting.sigma.text:
        return f"{first} has {reason}." if equal == 1 else f"{equal} of {n} trackers share the first rank."
    to_set = "sigma is at most" if setting.is_bound else "set"
    return f"{first}: {to_set} {setting.sigma.text}. It has {reason}."
