"""What a headline is, which conditions of a run headlines are about, and their numbers with intervals."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import MIN_SCENES, NO_GROUPS, SceneGroups
from tracknoise.statistics.definitions import NAMES
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.defaults import POPULATION, TRIMMING
from tracknoise.tables.enumerations import Aspect, Axis, Trimming, Weighting
from tracknoise.tables.schema import VIEW
from tracknoise.topics.bands import interval_texts
from tracknoise.topics.sentences import joined
from tracknoise.words import (
    count,
    coverage_sentence,
    next_scene_text,
    opening_place,
    place,
    rms_of_tracks,
    spread_text,
    these_scenes,
    view_text,
)

RunTables: TypeAlias = Mapping[str, pl.DataFrame]
"""Tables of a run, by their names."""


class Part(NamedTuple):
    """What is said about one tracker.

    Attributes
    ----------
    text
        One or several sentences.
    estimates
        The numbers in them.
    brief
        The same in one sentence; empty where there is none.
    """

    text: str
    estimates: list[Estimate]
    brief: str = ""


_NUMBERS = "intervals"
MOST_TRACKERS = 4
"""Of more trackers than this the headlines name only the first."""


@dataclass(frozen=True, slots=True)
class Headline:
    """A few sentences about one topic.

    Attributes
    ----------
    text
        Plain text.
    figure
        Anchor of the section of the report that shows it.
    table
        Table that holds its numbers; by default that of the intervals of all numbers.
    estimate
        The first of its numbers that has an interval; the first of all where none has; None where it has no number.
    brief
        The same in one sentence; empty where there is none.
    opening, closing, parts
        What the text is made of, where it has a part for each tracker.
    """

    text: str
    figure: str
    table: str = _NUMBERS
    estimate: Estimate | None = None
    brief: str = ""
    opening: str = ""
    closing: str = ""
    parts: tuple["TrackerPart", ...] = ()

    def row(self, topic: str, rank: int) -> dict[str, Any]:
        """The headline of a topic as a row of `FINDINGS`."""
        texts = {name: getattr(self, name) for name in ("text", "figure", "table", "brief", "opening", "closing")}
        numbers = {name: getattr(self.estimate, name, None) for name in ("value", "low", "high", "unit")}
        leading_id = getattr(self.estimate, "id", None)
        parts = self.parts or (TrackerPart(None, self.text, () if leading_id is None else (leading_id,)),)
        ids = [leading_id, *(name for part in parts for name in part.rows)]
        return {
            "rank": rank,
            "topic": topic,
            **texts,
            **numbers,
            "rows": list(dict.fromkeys(filter(None, ids))),
            "parts": [{"tracker": part.tracker, "text": part.text, "rows": list(part.rows)} for part in parts],
        }


@dataclass(frozen=True, slots=True)
class TrackerPart:
    """The part of a headline that is about one tracker, or about none, and the ids of its rows of results."""

    tracker: str | None
    text: str
    rows: tuple[str, ...]


def ids_of(estimates: Sequence[Estimate]) -> tuple[str, ...]:
    """Ids of the rows of results that numbers come from."""
    return tuple(dict.fromkeys(estimate.id for estimate in estimates if estimate.id is not None))


def brief_of(parts: Iterable[Part]) -> str:
    """The short sentence of the part that has the leading number, or of the first where none has numbers; or empty."""
    with_brief = [part for part in parts if part.brief]
    number = leading([estimate for part in with_brief for estimate in part.estimates])
    leaders = (
        part for part in with_brief if number is None or any(part_number is number for part_number in part.estimates)
    )
    return next((part.brief for part in leaders), "")


def leading(estimates: Sequence[Estimate]) -> Estimate | None:
    """The first number that has an interval, or else the first."""
    return next((estimate for estimate in estimates if estimate.low is not None), estimates[0] if estimates else None)


def in_brackets(rows: pl.DataFrame) -> str:
    """How the intervals in brackets were made, as the last sentences; or that there are too few scenes for any.

    `rows`: those reported, with columns low, high, level, resampled and n_scenes.
    """
    texts = interval_texts(rows.drop_nulls(["low", "high"]), "n_scenes")
    n_scenes = rows["n_scenes"].max()
    if not texts and isinstance(n_scenes, int) and n_scenes < MIN_SCENES:
        return f" Numbers have no intervals: {count(n_scenes, 'scene')} {'is' if n_scenes == 1 else 'are'} too few."
    return "".join(f" {'Others' if place else 'Brackets'} hold {text}." for place, text in enumerate(texts))


def intervals_of(tables: RunTables) -> pl.DataFrame:
    """Intervals of all numbers of a run: schema `INTERVALS`."""
    return tables[_NUMBERS]


@dataclass(frozen=True, slots=True)
class ReportedConditions:
    """The conditions that headlines are about: every tracker in the reference view at the lowest speed.

    Parameters
    ----------
    reference
        The view and the speed; the key frames, where curves run along frames.
    trackers
        Names, in the order in which they are reported.
    population
        Which observations errors are of: `visible` or `projected`.
    percentile
        Percentile of the largest errors of tracks above which tracks were dropped; None where none was.
    fitted
        Whether true positions were fitted to the tracks, so that errors about them say nothing about drift.
    groups
        Groups of scenes that are not independent of each other.
    trimming
        Errors that verdicts are about.
    """

    reference: ReferenceCondition
    trackers: Sequence[str]
    population: str = POPULATION
    percentile: float | None = None
    fitted: bool = False
    groups: SceneGroups = NO_GROUPS
    trimming: Trimming = TRIMMING

    @property
    def axis(self) -> Axis:
        """What curves run along: frame where there are key frames, otherwise age."""
        return Axis.frame if self.reference.key_frames else Axis.age

    @property
    def trimmings(self) -> tuple[Trimming, ...]:
        """Trimmings that are reported, that of the verdicts first."""
        if self.percentile is None:
            return (self.trimming,)
        return (self.trimming, *(trimming for trimming in Trimming if trimming != self.trimming))

    def of(self, table: pl.DataFrame, tracker: str) -> pl.DataFrame:
        """Rows of a tracker's condition."""
        chosen = {name: getattr(self.reference, name) for name in (*VIEW, "speed")}
        return table.filter(tracker=tracker, **chosen)

    def intervals(self, tables: RunTables, *trackers: str) -> pl.DataFrame:
        """Intervals of all numbers of the conditions of trackers; by default of all that are reported."""
        rows = intervals_of(tables)
        return pl.concat([rows.clear(), *(self.of(rows, tracker) for tracker in trackers or self.trackers)])

    def reported(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows of the conditions of all trackers that are reported."""
        return pl.concat([table.clear(), *(self.of(table, tracker) for tracker in self.trackers)])

    def headline(
        self,
        describe: Callable[[str], Part | None],
        *,
        opening: str,
        closing: str = "",
        figure: str,
        table: str = _NUMBERS,
    ) -> Headline | None:
        """A headline with a part for each tracker; None where there is no part."""
        described = {tracker: part for tracker in self.trackers if (part := describe(tracker))}
        if not described:
            return None
        named = dict(list(described.items())[:MOST_TRACKERS])
        more = len(described) - len(named)
        sentences = [opening, *(part.text for part in named.values())]
        sentences += [f"The table has {count(more, 'other tracker')}."] if more else []
        text = joined([*sentences, closing])
        parts = tuple(TrackerPart(tracker, part.text, ids_of(part.estimates)) for tracker, part in described.items())
        return Headline(
            text,
            figure,
            table,
            leading([estimate for part in named.values() for estimate in part.estimates]),
            brief=brief_of(named.values()),
            opening=opening,
            closing=closing.strip(),
            parts=parts,
        )

    @property
    def at_zero(self) -> int:
        """Age or frame at which errors are zero."""
        return self.reference.key_frames.get(self.reference.direction, 0)

    def since(self, at: int) -> int:
        """Distance of an age or a frame from where errors are zero, in frames of the sequence."""
        return at - self.at_zero

    def place(self, at: int) -> str:
        """Write an age or a frame by its distance from where errors are zero."""
        return place(self.axis, self.since(at))

    def opening_place(self, at: int) -> str:
        """Write an age or a frame as `place` does, as the start of a sentence."""
        return opening_place(self.axis, self.since(at))

    def opening_distance(self, age: int) -> str:
        """Write an age that counts frames from where errors are zero, before it and after it, as `opening_place`."""
        return opening_place(Axis.age, age) if self.axis == Axis.age else f"At {count(age, 'frame')} from the key frame"

    @property
    def rms(self) -> str:
        """What root mean square errors are called whose features are pooled over scenes."""
        return rms_of_tracks(self.trimming)

    def where(self, tables: RunTables) -> str:
        """Write the speed, the parts of the view of which a run has several, and whether scenes are few."""
        conditions = tables["summary"]
        several = [name for name in VIEW if conditions[name].n_unique() > 1]
        view = {name: getattr(self.reference, name) for name in VIEW}
        n_scenes = self.reported(conditions)["n_scenes"].max()
        limits = f", {these_scenes(n_scenes)} only" if isinstance(n_scenes, int) and n_scenes < MIN_SCENES else ""
        return f"at speed {self.reference.speed}{view_text(view, several)}{limits}"


def curve_rows(
    intervals: pl.DataFrame,
    conditions: ReportedConditions,
    role: str,
    at: int,
    coordinate: str,
    *,
    trimming: str | None = None,
    weighting: str = Weighting.features,
    aspect: str = Aspect.all,
    at_least: int | None = None,
) -> pl.DataFrame:
    """The row of a point of a curve, if there is one.

    Parameters
    ----------
    intervals
        Rows of one condition.
    conditions
        Say which population and axis.
    role
        Of the statistic, as in `tracknoise.statistics.definitions.NAMES`, or core.
    at, coordinate, trimming, weighting, aspect, at_least
        As in the table; by default the trimming is that of the conditions.
    """
    return intervals.filter(
        pl.col("at_least").eq_missing(at_least),
        aspect=aspect,
        population=conditions.population,
        trimming=conditions.trimming if trimming is None else trimming,
        weighting=weighting,
        statistic=NAMES[conditions.axis].get(role, role),
        axis=conditions.axis,
        at=at,
        coordinate=coordinate,
    )


_SQUARES = [NAMES[axis][role] for axis in Axis for role in ("second", "central")]


def curve_estimate(rows: pl.DataFrame) -> Estimate | None:
    """Estimate of a row of `curve_rows`, px; None where there is no interval. Second moments are given as roots."""
    if rows["statistic"].is_in(_SQUARES).any():
        rows = rows.with_columns_seq(pl.col("value", "low", "high").clip(lower_bound=0.0).sqrt())
    return _estimate(rows.with_columns_seq(unit=pl.lit("px")))


def size_estimate(
    row: Mapping[str, Any],
    intervals: pl.DataFrame,
    conditions: ReportedConditions,
    name: str,
    coordinate: str,
    trimming: str | None = None,
) -> Estimate:
    """Size of the errors of a condition at its reference age, px; without a number where it has no such age.

    Parameters
    ----------
    row
        Of schema `SUMMARY`.
    intervals
        Rows of the condition.
    conditions
        Say which population and axis.
    name
        core, as geometric mean over scenes, or rms, with features pooled.
    coordinate, trimming
        By default the trimming is that of the conditions.
    """
    at, trimming = row["at"], trimming or conditions.trimming
    if at is None:
        return Estimate(None, unit="px")
    role, weighting = ("core", Weighting.geometric) if name == "core" else ("second", Weighting.features)
    rows = curve_rows(intervals, conditions, role, at, coordinate, trimming=trimming, weighting=weighting)
    return Estimate.of(row[f"{trimming}_{name}_{coordinate}_px"], curve_estimate(rows), "px")


def curve_scenes(
    intervals: pl.DataFrame,
    conditions: ReportedConditions,
    role: str,
    at: int,
    coordinate: str,
    *,
    weighting: str,
    of: str = "This number",
) -> str:
    """Write how much scenes differ at a point of a curve, and where the next one is expected; empty where unknown.

    `of`: the number, as the subject of the sentence.
    """
    row = curve_rows(intervals, conditions, role, at, coordinate, weighting=weighting)
    return _scenes(row, of, is_scale=role != "mean")


def scalar_scenes(intervals: pl.DataFrame, statistic: str, *, of: str = "This number") -> str:
    """The same for a statistic of which each condition has one number."""
    return _scenes(intervals.filter(statistic=statistic), of, is_scale=True)


def _scenes(intervals: pl.DataFrame, opening: str, *, is_scale: bool) -> str:
    rows = intervals.drop_nulls(["spread", "next_low", "next_high"]).head(1).to_dicts()
    texts = [
        f"{opening} {spread_text(row['spread'], row['unit'], is_scale=is_scale)}; "
        f"{next_scene_text(row['next_low'], row['next_high'], row['unit'])}."
        for row in rows
    ]
    return joined([*texts, *(coverage_sentence("For this number,", row["level"], row["coverage"]) for row in rows)])


def scalar_estimate(row: Mapping[str, Any], intervals: pl.DataFrame, statistic: str, unit: str) -> Estimate:
    """A number of a row of `SUMMARY`, with its interval in the rows of the condition, if there is one."""
    return Estimate.of(row[statistic], _estimate(intervals.filter(statistic=statistic)), unit)


def _estimate(rows: pl.DataFrame) -> Estimate | None:
    bounded = rows.drop_nulls("value").filter(pl.col("low").is_not_null() | pl.col("high").is_not_null())
    if bounded.is_empty():
        return None
    row = bounded.row(0, named=True)
    return Estimate.of_row(row, "value", "low", "high", row["unit"])
