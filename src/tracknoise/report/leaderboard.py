"""Trackers in the order in which to take them: what to set, errors of a typical scene, lifetimes, outliers, ranks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isnan
from typing import Any

import polars as pl

from tracknoise.analysis.factors import RANKED
from tracknoise.analysis.shared_scenes import LAST_AGE, SHOWN_AGE, Typical, typical
from tracknoise.inference.conventions import LEVEL
from tracknoise.report.answer import noise_to_set
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.report.scene_results import group_array, scene_results
from tracknoise.tables.costs import read_costs
from tracknoise.text import significant
from tracknoise.topics.answer_summary import NoiseToSet, Number
from tracknoise.topics.factor_topic import disputed_ranks, ranks_by_role
from tracknoise.words import DASH, SPACE, count, number, percent, pixels

TITLES: Mapping[str, str] = dict(
    zip(RANKED, ("typical error (core)", "RMS error", "lifetime", "outlier ratio"), strict=True)
)
"""What trackers are ranked by, by the roles of the statistics, in the order of the table."""
_COLUMNS = dict(zip(RANKED, ("core", "RMS", "lifetime", "outliers"), strict=True))
_QUANTITY = dict(zip(RANKED, ("typical error", "RMS error", "lifetime", "outlier ratio"), strict=True))
_BEST = dict(
    zip(RANKED, ("smallest typical error", "smallest RMS error", "longest tracks", "fewest outliers"), strict=True)
)
_LESS = dict(
    zip(RANKED, ("smaller typical errors", "smaller RMS errors", "longer tracks", "fewer outliers"), strict=True)
)
_SETTING, _COST = "sigma to set", "CPU per step"
_WRITTEN: Mapping[str, tuple[Callable[[float], str], str]] = {
    "lifetime": (number, f"{SPACE}frames"),
    "outlier_ratio": (percent, ""),
}
"""How values are written, and their unit, by the roles of statistics that are not in px."""
UNKNOWN = Number(None, None, None, DASH, "")
Ranks = Mapping[str, tuple[int, int]]
"""Best and worst rank by the role of a statistic."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A tracker of a leaderboard.

    Attributes
    ----------
    tracker, colour
        Its name, and its colour in all figures.
    sigma, is_bound
        What to set; and whether it is an upper bound, because the truth is not trusted.
    values
        What a typical scene measured, by the role of the statistic.
    ranks
        Best and worst rank, likewise; none where trackers are not ranked.
    cost
        CPU time of a step.
    """

    tracker: str
    colour: str
    sigma: Number
    is_bound: bool
    values: Mapping[str, Number]
    ranks: Ranks
    cost: Number

    def span(self, role: str) -> str:
        """Best and worst rank by a statistic: ``2 to 5``; empty where there are none."""
        if role not in self.ranks:
            return ""
        best, worst = self.ranks[role]
        return str(best) if best == worst else f"{best} to {worst}"


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Trackers of the same scenes.

    Attributes
    ----------
    standings
        Of each tracker, in any order.
    roles
        The statistics that are shown; the first leads.
    scenes
        How many scenes trackers are ranked by.
    measured
        How many scenes were measured.
    margin
        Largest relative difference that counts as none.
    disputed
        About which trackers references of the two kinds disagree, a sentence after a space; empty where they do not.
    """

    standings: tuple[Standing, ...]
    roles: tuple[str, ...]
    scenes: int
    measured: int
    margin: float
    disputed: str = ""

    @property
    def rows(self) -> list[Standing]:
        """Sorted by best rank by the first statistic, then by sigma."""
        return self._ordered({one.tracker: one.sigma.value for one in self.standings})

    def _ordered(self, sigma_px: Mapping[str, float | None]) -> list[Standing]:
        role, last = self.roles[0], (len(self.standings), 0)

        def place(one: Standing) -> tuple[Any, ...]:
            sigma = sigma_px.get(one.tracker)
            best, worst = one.ranks.get(role, last if self.is_ranked else (1, 1))
            return best, sigma is None, sigma or 0.0, worst, one.tracker

        return sorted(self.standings, key=place)

    @property
    def is_ranked(self) -> bool:
        """Whether trackers have ranks."""
        return any(one.ranks for one in self.standings)

    def first_with(self, settings: Iterable[NoiseToSet]) -> str:
        """Name of the tracker to take with what is set in an estimator."""
        return self._ordered({one.tracker: one.sigma.value for one in settings})[0].tracker

    def leader_with(self, settings: Iterable[NoiseToSet]) -> str:
        """Which tracker to take: of those that none is shown to be better than, the one with the smallest sigma."""
        to_set = {one.tracker: one for one in settings}
        first, role, n = self.first_with(to_set.values()), self.roles[0], len(self.standings)
        equal = sum(one.ranks.get(role, (1, n))[0] == 1 for one in self.standings)
        if equal == 1:
            reason = f"the {_BEST[role]} of {n} trackers"
        elif equal == n:
            reason = f"the smallest sigma of {n} trackers, of which none is shown to have {_LESS[role]} than another"
        else:
            reason = "the smallest sigma of these"
        setting = to_set.get(first)
        if setting is None or setting.sigma.value is None:
            return f"{first} has {reason}." if equal == 1 else f"{equal} of {n} trackers share the first rank."
        verb = "sigma is at most" if setting.is_bound else "set"
        subject = "It"
        if 1 < equal < n:
            subject = f"{equal} of {n} trackers share the first rank in {_QUANTITY[role]}; {first}"
        return f"{first}: {verb} {setting.sigma.text}. {subject} has {reason}."

    def why(self, one: Standing, role: str) -> str:
        """From how many trackers one is not distinguished by a statistic."""
        if role not in one.ranks:
            return ""
        (best, worst), n = one.ranks[role], len(self.standings)
        alike = worst - best
        texts = [
            f"not distinguished from {alike} of {count(n - 1, 'other')}" if alike else "distinguished from all others"
        ]
        texts += [f"shown to be worse than {best - 1}"] if best > 1 else []
        texts += [f"shown to be better than {n - worst}"] if worst < n else []
        return "; ".join(texts)

    @property
    def without_rms(self) -> str:
        """Why a tracker has no RMS."""
        return f"undetermined: a few large errors decide it at age {SHOWN_AGE}"

    @property
    def columns(self) -> list[str]:
        """Headings of all columns but the name."""
        costs = [_COST] if any(one.cost.value is not None for one in self.standings) else []
        return [_SETTING, *(_COLUMNS[role] for role in self.roles), *costs]

    @property
    def ranked_by(self) -> str:
        """What the first ranks are of."""
        return TITLES[self.roles[0]]

    @property
    def places(self) -> str:
        """What errors and lifetimes are of."""
        errors = f"Core and RMS: geometric means over scenes at age {SHOWN_AGE}. " if "core" in self.roles else ""
        return f"{errors}Lifetimes: up to {LAST_AGE} frames."

    @property
    def reading(self) -> str:
        """What ranks say, by one of them, and from how many scenes where these are not all."""
        if not self.is_ranked:
            return "Not ranked."
        fewer = f"{self._from_scenes} " if self.scenes < self.measured else ""
        return f"{fewer}{self._one_rank}{self.disputed}"

    @property
    def _from_scenes(self) -> str:
        return f"Ranks are from {count(self.scenes, 'scene')}."

    @property
    def _one_rank(self) -> str:
        """What one of the ranks says; of those that are a range, the one in the middle."""
        role, n = self.roles[0], len(self.standings)
        ranged = [one for one in self.rows if role in one.ranks and one.ranks[role][0] != one.ranks[role][1]]
        if not ranged:
            return "No ranks are shared."
        one = max(ranged, key=lambda candidate: min(candidate.ranks[role][0] - 1, n - candidate.ranks[role][1]))
        best, worst = one.ranks[role]
        margin = f"{100.0 * self.margin:.3g}{SPACE}%"
        better = f"{best - 1} {'is' if best == 2 else 'are'} shown to be better by more than {margin}"
        return f"Rank {one.span(role)} ({one.tracker}): {better}, {n - worst} worse."

    def cells(self, about: str = "") -> Cells:
        """The same as a plain table, with intervals of sigma, and ranks in brackets. `about`: opens its caption."""
        rows = [
            [
                one.tracker,
                _with_interval(one),
                *(_with_ranks(one, role) for role in self.roles),
                *([one.cost.text] if _COST in self.columns else []),
            ]
            for one in self.rows
        ]
        ranked = " In brackets: ranks." if self.is_ranked else ""
        scenes = f" {self._from_scenes}" if self.is_ranked and self.scenes >= self.measured else ""
        caption = f"{about}{self.places}{ranked}{scenes} {self.reading}"
        return Cells(caption, ["tracker", *self.columns], rows, [False, *([True] * len(self.columns))])


def _with_interval(one: Standing) -> str:
    if one.is_bound and one.sigma.value is not None:
        return f"at most {one.sigma.text}"
    return f"{one.sigma.text} [{one.sigma.interval}]" if one.sigma.interval else one.sigma.text


def _with_ranks(one: Standing, role: str) -> str:
    text = one.values.get(role, UNKNOWN).text
    return f"{text} ({one.span(role)})" if one.span(role) else text


def number_of_role(role: str, found: Typical) -> Number:
    """What a typical scene measured, as it is printed."""
    written, unit = _WRITTEN.get(role, (pixels, f"{SPACE}px"))
    text = f"{written(found.value)}{unit}"
    if isnan(found.low):
        return Number(found.value, None, None, text, "")
    return Number(found.value, found.low, found.high, text, f"{written(found.low)} to {written(found.high)}")


def cost_of_step(ms: float | None) -> Number:
    """CPU time of a step, as it is printed."""
    return UNKNOWN if ms is None else Number(ms, None, None, f"{significant(ms, 2)}{SPACE}ms", "")


def leaderboard(data: ReportData) -> Leaderboard | None:
    """The leaderboard of a run; None where its trackers have no ranks."""
    ranks = ranks_by_role(data)
    if ranks.is_empty():
        return None
    roles = roles_of(ranks)
    costs, settings = read_costs(data.run), {one.tracker: one for one in noise_to_set(data)}
    spans: dict[str, dict[str, tuple[int, int]]] = {}
    for row in ranks.iter_rows(named=True):
        spans.setdefault(row["tracker"], {})[row["role"]] = row["best"], row["worst"]
    groups, scenes = scene_results(data)
    standings = []
    for tracker, of_roles in spans.items():
        measured = typical(scenes.get(tracker, {}), group_array(groups), LEVEL)
        setting = settings.get(tracker)
        standings.append(
            Standing(
                tracker,
                data.colour[tracker],
                UNKNOWN if setting is None else setting.sigma,
                setting is not None and setting.is_bound,
                {role: number_of_role(role, measured[role]) for role in roles if role in measured},
                of_roles,
                cost_of_step(costs.get(tracker)),
            )
        )
    n_scenes = min(ranks["n_scenes"].to_list())
    n_measured = len({entry.sequence.scene for entry in data.sequences.values()})
    return Leaderboard(tuple(standings), tuple(roles), n_scenes, n_measured, data.margin, disputed_ranks(ranks))


def roles_of(ranks: pl.DataFrame) -> list[str]:
    """The roles of a table of ranks, in the order of the leaderboard."""
    return [role for role in TITLES if role in set(ranks["role"])]
