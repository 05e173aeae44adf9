"""Headlines about errors: their size, bias, shape and growth, and what trimming changes.

- Headlines about the size of errors: the core, the root mean square, and how many errors lie far out.
- Headlines about errors: their bias, shape and growth, and survivorship bias.
- The headline that says which answers change where the tracks with the largest errors are dropped.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.analysis.error_shape import ON_GRID
from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import Resampled
from tracknoise.phrases.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    by_tracker,
    curve_bounds,
    curve_rows,
    curve_scenes,
    in_brackets,
    scale_estimate,
)
from tracknoise.phrases.withheld import (
    audited_bias,
    audited_rise,
    bias_covers,
    covered_coordinates,
    growth_cover,
    withheld_bias,
    withheld_growth,
)
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.tables.enumerations import Aspect, Axis, Behaviour, Population, Trimming, Verdict, Weighting
from tracknoise.words import SHAPES, SPACE, chance, count, format_estimate, listing, number, percent, px, sentence_case


def size(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How large errors are at the reference age."""
    as_in_paper = conditions.trimming == Trimming.trimmed and conditions.percentile is not None
    return _paper(tables, conditions) if as_in_paper else _robust(tables, conditions)


def _robust(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Core and root mean square of all tracks, and the share of far errors."""
    closing = (
        "The core is the sigma of the Gaussian with the same median error. Of the errors of a Gaussian, "
        f"0.3{SPACE}% exceed three cores. Core and RMS are geometric means over scenes.{_population(conditions)}"
        f"{_brackets(tables, conditions, Weighting.geometric)}"
    )
    return _of_trackers(tables, conditions, _robust_of, "of all tracks", closing)


def _robust_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row = first(conditions.of(tables["summary"], tracker))
    if row is None or row["at"] is None:
        return None
    intervals = conditions.of(tables["intervals"], tracker)
    cores = [_core(intervals, conditions, row, axis) for axis in "uv"]
    lengths = [scale_estimate(intervals, conditions, "second", row["at"], axis) for axis in "uv"]
    pooled = [rms(intervals, conditions, row, axis, conditions.trimming) for axis in "uv"]
    sentences = list(_cores(intervals, conditions, row["at"], tracker, cores))
    which = "" if all(lengths) else ", features pooled,"
    u, v = (format_estimate(one) for one in (lengths if all(lengths) else pooled) if one is not None)
    sentences += [f"The RMS{which} of {tracker} is {u} in u.", f"In v it is {v}."]
    sentences += [*_beyond(row, conditions.trimming), *_grid(tables, conditions, tracker)]
    every = [*cores, *(lengths if all(lengths) else pooled)]
    return " ".join(sentences), [one for one in every if one is not None]


def _cores(
    intervals: pl.DataFrame, conditions: ReportedConditions, at: int, tracker: str, cores: Sequence[Estimate | None]
) -> Iterator[str]:
    """Sentences about the cores in u and in v, of which either may be missing."""
    known = {axis: format_estimate(core) for axis, core in zip("uv", cores, strict=True) if core is not None}
    if not known:
        return
    axis, *_ = known
    few = {axis: _few_scenes(intervals, conditions, at, axis) for axis in known}
    yield f"{conditions.opening_place(at)}, the core of {tracker} in {axis} is {known[axis]}{few[axis]}."
    if scenes := curve_scenes(intervals, conditions, "core", at, axis, weighting=Weighting.geometric):
        yield scenes
    if len(known) == len(cores):
        yield f"In v it is {known['v']}{few['v']}."
    else:
        yield f"In {'v' if axis == 'u' else 'u'} there is none: most errors are exactly 0."


def _few_scenes(intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str) -> str:
    """Say where a core is of fewer scenes than the root mean square errors beside it, or the other core."""
    weighting = Weighting.geometric
    own, other, errors = (
        curve_rows(intervals, conditions, role, at, coordinate, weighting=weighting)["n_scenes"].to_list()
        for role, coordinate in (("core", axis), ("core", "u"), ("second", axis))
    )
    if not own or own[0] == max([*own, *other, *errors]):
        return ""
    return f", of {count(own[0], 'scene')}; the others have few errors, or mostly errors of exactly 0"


def _core(
    intervals: pl.DataFrame, conditions: ReportedConditions, row: Mapping[str, Any], coordinate: str
) -> Estimate | None:
    value = row[f"{conditions.trimming}_core_{coordinate}_px"]
    bounds = scale_estimate(intervals, conditions, "core", row["at"], coordinate)
    return None if value is None else Estimate.of(value, bounds, "px")


def _beyond(row: Mapping[str, Any], trimming: str) -> list[str]:
    """The share of far errors, beside that of a Gaussian."""
    shares = {axis: row[f"{trimming}_beyond_{axis}"] for axis in "uv"}
    known = [f"{percent(share)} in {axis}" for axis, share in shares.items() if share is not None]
    return [f"{listing(known).replace(' in ', ' of its errors in ', 1)} exceed three cores."] if known else []


def _grid(tables: RunTables, conditions: ReportedConditions, tracker: str) -> list[str]:
    """A remark where errors lie on a grid, as those of whole or half pixels do."""
    shapes = conditions.of(tables["gaussianity"], tracker).filter(trimming=conditions.trimming)
    reasons = shapes["why"].drop_nulls().unique(maintain_order=True).to_list()
    grids = [reason.partition(":")[0] for reason in reasons if reason.startswith(ON_GRID)]
    return [f"Its {grid}, so that its core takes few values; its RMS says more." for grid in grids[:1]]


def _paper(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """The paper's quantity: root mean square errors of the kept tracks, features pooled; the untrimmed ones beside."""
    dropped = f"Trimming drops the tracks whose largest error is above the {conditions.percentile:g}th percentile."
    closing = (
        f"{dropped} An estimator that keeps these tracks must assume the untrimmed errors. Features are pooled over "
        f"scenes.{_population(conditions)}{_brackets(tables, conditions, Weighting.features)}"
    )
    return _of_trackers(tables, conditions, _paper_of, "as root mean square of the paper's trimmed errors", closing)


def _paper_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row = first(conditions.of(tables["summary"], tracker))
    if row is None or row["at"] is None:
        return None
    intervals = conditions.of(tables["intervals"], tracker)
    trimmed, untrimmed = (
        [rms(intervals, conditions, row, axis, trimming) for axis in "uv"] for trimming in conditions.trimmings
    )
    text = (
        f"After trimming, the error of {tracker} {conditions.place(row['at'])} is {in_u_and_v(trimmed)}. "
        f"Without trimming it is {in_u_and_v(untrimmed)}."
    )
    return text, [*trimmed, *untrimmed]


def _of_trackers(
    tables: RunTables,
    conditions: ReportedConditions,
    describe: Callable[[RunTables, ReportedConditions, str], Part | None],
    what: str,
    closing: str,
) -> Headline | None:
    return by_tracker(
        conditions.trackers,
        lambda tracker: describe(tables, conditions, tracker),
        opening=f"Error size {conditions.where(tables['summary'])}, {what}.",
        closing=closing.strip(),
        topic="noise",
        figure="error-by-tracker",
        table="intervals",
    )


def rms(
    intervals: pl.DataFrame, conditions: ReportedConditions, row: Mapping[str, Any], coordinate: str, trimming: str
) -> Estimate:
    """Root mean square error of a condition at its reference age, features pooled."""
    bounds = curve_bounds(intervals, conditions, "second", row["at"], coordinate, trimming=trimming)
    return Estimate.of(row[f"{trimming}_rms_{coordinate}_px"], bounds, "px")


def in_u_and_v(pair: Sequence[Estimate | None]) -> str:
    """Write estimates in u and in v."""
    u, v = (format_estimate(one) for one in pair if one is not None)
    return f"{u} in u and {v} in v"


def first(rows: pl.DataFrame) -> dict[str, Any] | None:
    """The first row; None where there is none."""
    return rows.row(0, named=True) if rows.height else None


def _population(conditions: ReportedConditions) -> str:
    return " Occluded features are included." if conditions.population == Population.projected else ""


def _brackets(tables: RunTables, conditions: ReportedConditions, weighting: str) -> str:
    """How intervals of second moments at the reference were made; empty where there are none."""
    axis = conditions.axis
    chosen = {"aspect": Aspect.all, "axis": axis, "statistic": NAMES[axis]["second"], "weighting": weighting}
    reference = tables["summary"].select_seq(*POOLED, pl.col("at").cast(pl.Int64))
    known = tables["intervals"].filter(**chosen).join(reference, on=[*POOLED, "at"], how="semi")
    return in_brackets(conditions.reported(known))


_GROWTH: Mapping[str, tuple[str, str, str]] = {
    Behaviour.white: ("constant", "white_px", "px"),
    Behaviour.random_walk: ("random walk", "walk_px_per_sqrt_frame", "px per sqrt(frame)"),
    Behaviour.drift: ("drift", "drift_px_per_frame", "px per frame"),
    Behaviour.saturating: ("saturating", "saturating_px", "px"),
}
"""Name of a behaviour, and the column and the unit of its size."""
_GROWING = (Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)
"""Behaviours that the errors of poses have too."""
_POOLED = "features pooled over scenes"
_RISING = ("walk_px_per_sqrt_frame", "drift_px_per_frame")


def bias(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the mean error is zero."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _bias_of(tables, conditions, tracker),
        opening=f"Bias {conditions.where(tables['summary'])}.",
        closing=f"The test takes all {conditions.axis}s together and weights scenes equally.",
        topic="bias",
        figure="error-by-tracker",
        table="zero_mean",
    )


def _bias_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["zero_mean"], tracker).filter(trimming=conditions.trimmings[0], axis=conditions.axis)
    overall, summary = first(rows.filter(pl.col("at").is_null())), first(conditions.of(tables["summary"], tracker))
    if overall is None:
        return None
    at = None if summary is None else summary["at"]
    there = None if at is None else first(rows.filter(at=at))
    covers = {} if summary is None or there is None else bias_covers(summary, there)
    withheld = None if there is None else withheld_bias(tracker, conditions.opening_place(there["at"]), covers)
    if withheld is None and there is not None:
        withheld = audited_bias(tables, conditions, tracker, there["at"])
    if withheld is not None and overall["verdict"] == Verdict.yes:
        return withheld, [Estimate.verdict(overall, "effect_px")]
    trimming = conditions.trimmings[0]
    estimates = [] if there is None else _means(tables, conditions, tracker, there, trimming)
    text = _zero_or_not(f"the mean {_trimmed(conditions)}error of {tracker}", overall)
    if there is not None and len(estimates) == 2:
        u, v = map(format_estimate, estimates)
        text += f" {conditions.opening_place(there['at'])}, the mean in u is {u}. In v it is {v}."
        intervals = conditions.of(tables["intervals"], tracker)
        scenes = curve_scenes(intervals, conditions, "mean", there["at"], "u", weighting=Weighting.scenes, of="In u")
        text += f" {scenes}" if scenes else ""
        if there["share_of_second"] is not None:
            share = percent(there["share_of_second"])
            text += f" The square of the mean is {share} of the second moment, u and v together."
        text += covered_coordinates(covers)
        untrimmed = _untrimmed_means(tables, conditions, tracker, there["at"])
        text += f" Without trimming, the mean is {in_u_and_v(untrimmed)}." if len(untrimmed) == 2 else ""
        estimates += untrimmed
    return text, [*estimates, Estimate.verdict(overall, "effect_px")]


def _untrimmed_means(tables: RunTables, conditions: ReportedConditions, tracker: str, at: int) -> list[Estimate]:
    """Mean errors of all tracks, where the verdict is about those that trimming kept."""
    if conditions.percentile is None or conditions.trimming == Trimming.untrimmed:
        return []
    rows = conditions.of(tables["zero_mean"], tracker)
    there = first(rows.filter(trimming=Trimming.untrimmed, axis=conditions.axis, at=at))
    return [] if there is None else _means(tables, conditions, tracker, there, Trimming.untrimmed)


def _zero_or_not(mean: str, overall: Mapping[str, Any]) -> str:
    p = overall["sign_flip_p_family"]
    test = "" if p is None else f" ({chance(p)}, {count(overall['n_scenes'], 'scene')})"
    if overall["verdict"] == Verdict.yes:
        return f"{sentence_case(mean)} is not zero{test}."
    why = f": {overall['why']}" if overall["why"] and p is None else ""
    return f"It is undecided whether {mean} is zero{test}{why}."


def _means(
    tables: RunTables, conditions: ReportedConditions, tracker: str, row: Mapping[str, Any], trimming: Trimming
) -> list[Estimate]:
    found = []
    intervals, scenes = conditions.of(tables["intervals"], tracker), Weighting.scenes
    for coordinate in "uv":
        value = row[f"mean_{coordinate}_px"]
        bounds = curve_bounds(intervals, conditions, "mean", row["at"], coordinate, trimming=trimming, weighting=scenes)
        found += [] if value is None else [Estimate.of(value, bounds, "px")]
    return found


def shape(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether errors are Gaussian, in the band of ages that contains the reference age."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _shape_of(tables, conditions, tracker),
        opening=f"Shape of the error distribution {conditions.where(tables['summary'])}.",
        topic="shape",
        figure="gaussianity",
        table="gaussianity",
    )


def _shape_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["gaussianity"], tracker)
    bands = rows.select_seq("age_low", "age_high").unique().sort("age_low").rows()
    if not bands:
        return None
    summary = first(conditions.of(tables["summary"], tracker))
    since = abs(conditions.since(summary["at"])) if summary and summary["at"] is not None else bands[0][0]
    low, high = next((band for band in bands if band[0] <= since <= (band[1] or since)), bands[0])
    sentences, estimates = [], []
    for trimming in conditions.trimmings:
        row = first(rows.filter(trimming=trimming, age_low=low))
        if row is not None:
            within = _gain(row, "student_within")
            scales = [] if row["resampled"] == Resampled.blocks else _gain(row, "scales")
            estimates += [*within, *scales, Estimate.verdict(row, "shape")]
            which = f"{trimming} errors" if len(conditions.trimmings) > 1 else "errors"
            whose = f"{sentence_case(which)} of {tracker} at {band_text(conditions.axis, low, high)}"
            why = f": {row['why']}" if row["why"] and not within else ""
            sentences += [f"{whose} are {SHAPES[row['verdict']]}{why}.", *_tails(row, within, scales)]
    return " ".join(sentences), estimates


def _gain(row: Mapping[str, Any], name: str) -> list[Estimate]:
    """A gain in nats per error; empty where it is unknown."""
    if row[f"gain_{name}_nats"] is None:
        return []
    return [Estimate.of_row(row, f"gain_{name}_nats", f"gain_{name}_low", f"gain_{name}_high", "nat")]


def _tails(row: Mapping[str, Any], within: list[Estimate], scales: list[Estimate]) -> list[str]:
    tail = row["tail_99_within"]
    texts = [f"Within scenes, {number(tail)} times as many lie beyond the 99{SPACE}% ellipse as of a Gaussian."]
    gains = [f"There Student's t gains {format_estimate(one)} per error over a Gaussian." for one in within]
    added = [f"Different scales of scenes add {format_estimate(one)}." for one in scales]
    return [*([] if tail is None else texts), *gains, *added]


def band_text(axis: Axis, low: int, high: int | None) -> str:
    """Write a band of ages, or of distances from the key frame: ``ages 5 to 9``.

    Parameters
    ----------
    axis
        What curves run along.
    low, high
        First and last age, or distance; None where there is no last one.
    """
    ages = f"{low} or more" if high is None else f"{low} to {high}"
    return f"ages {ages}" if axis == Axis.age else f"{ages} frames from the key frame"


def growth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How errors grow with age."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _growth_of(tables, conditions, tracker),
        opening=f"Growth of {_trimmed(conditions)}errors {conditions.where(tables['summary'])}, {_POOLED}.",
        topic="growth",
        figure="time-structure",
        table="time_structure",
    )


def _growth_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["time_structure"], tracker).filter(trimming=conditions.trimmings[0])
    withheld, covered = _growth_withheld(tables, conditions, tracker, rows)
    texts: dict[str, list[str]] = {}
    estimates = []
    for row in rows.filter(~pl.col("coordinate").is_in(covered)).sort("coordinate").to_dicts():
        name, size = _behaviour(row)
        estimates += size
        texts.setdefault(", ".join([name, *map(format_estimate, size)]), []).append(row["coordinate"])
    sentences = [f"{tracker} in {listing(coordinates)}: {text}." for text, coordinates in texts.items()]
    sentences += withheld
    estimates += [Estimate.verdict(row, "growth") for row in rows.sort("coordinate").to_dicts()]
    return (" ".join(sentences), estimates) if sentences else None


def _growth_withheld(
    tables: RunTables, conditions: ReportedConditions, tracker: str, rows: pl.DataFrame
) -> tuple[list[str], list[str]]:
    """Sentences about coordinates that grow as the truth floor or faults of the truth do, and these coordinates."""
    summary = first(conditions.of(tables["summary"], tracker))
    if summary is None or summary["at"] is None:
        return [], []
    growing = rows.filter(pl.col("verdict").is_in(_GROWING))["coordinate"].sort().to_list()
    covers = {axis: growth_cover(tables, conditions, tracker, axis, summary["at"]) for axis in growing}
    covered = [axis for axis, cover in covers.items() if cover is not None and cover.is_covered]
    by_floor = withheld_growth(tracker, conditions.place(summary["at"]), covers)
    rest = [axis for axis in growing if axis not in covered]
    audited = {axis: audited_rise(tables, conditions, tracker, axis, summary["at"]) for axis in rest}
    by_audit = {axis: sentence for axis, sentence in audited.items() if sentence is not None}
    return [*([] if by_floor is None else [by_floor]), *by_audit.values()], [*covered, *by_audit]


def _behaviour(row: Mapping[str, Any]) -> tuple[str, list[Estimate]]:
    """Name of the behaviour of one coordinate, and its size if it has one."""
    if row["verdict"] not in _GROWTH:
        undecided = f"undecided; {row['why']}" if row["why"] else "undecided"
        none = row["why"] or "none of the models fits"
        return (none if row["verdict"] == Behaviour.none else undecided), []
    name, column, unit = _GROWTH[row["verdict"]]
    size = Estimate.of_row(row, column, f"{column}_low", f"{column}_high", unit)
    return f"mostly {name}" if rises(row) else name, [] if size.value is None else [size]


def rises(row: Mapping[str, Any]) -> bool:
    """Whether errors of a coordinate are mostly constant, but have a part that grows, by its interval.

    Parameters
    ----------
    row
        Of `TIME_STRUCTURE`.
    """
    return row["verdict"] == Behaviour.white and any((row[f"{part}_low"] or 0.0) > 0 for part in _RISING)


def survivorship(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether long-lived tracks have smaller errors than all tracks."""
    errors = f"{_trimmed(conditions)}root mean square errors, {_POOLED}"
    return by_tracker(
        conditions.trackers,
        lambda tracker: _survivorship_of(tables, conditions, tracker),
        opening=f"Survivorship bias {conditions.where(tables['summary'])}, in {errors}.",
        topic="survivorship",
        figure="survivorship-bias",
        table="intervals",
    )


def _survivorship_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row, intervals = first(conditions.of(tables["summary"], tracker)), conditions.of(tables["intervals"], tracker)
    if row is None or row["at"] is None:
        return None
    since, trimming = abs(conditions.since(row["at"])), conditions.trimmings[0]
    aspect = Aspect.long_lived
    for age in sorted(intervals.filter(aspect=aspect)["at_least"].unique()):
        long = curve_bounds(
            intervals, conditions, "second", row["at"], "u", trimming=trimming, aspect=aspect, at_least=age
        )
        if age > since and long:
            every = rms(intervals, conditions, row, "u", trimming)
            text = (
                f"{conditions.opening_place(row['at'])}, the error of {tracker} in u is {format_estimate(long)} "
                f"for tracks that live to age {age}. For all tracks it is {format_estimate(every)}."
            )
            return text, [long, every]
    return None


def _trimmed(conditions: ReportedConditions) -> str:
    return "" if conditions.percentile is None else f"{conditions.trimming} "


_BOTH = (Trimming.untrimmed, Trimming.trimmed)
_WORDS: Mapping[str, str] = {Behaviour.none: "no model fits", Behaviour.white: "constant"}
"""Verdicts that are clearer in other words."""


def trimming_matters(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Where trimmed and untrimmed errors give different answers; none where they agree or nothing was trimmed."""
    if conditions.percentile is None:
        return None
    verdicts, rankings = _verdicts(tables, conditions), _rankings(tables, conditions)
    if not verdicts and not rankings:
        return None
    count = "one" if len(verdicts) == 1 else str(len(verdicts))
    answers = [f"Trimming changes {count} of the answers below.", *verdicts] if verdicts else []
    orders = [*rankings, "Whether trimming reverses the order in other scenes was not tested."] if rankings else []
    return Headline("trimming", " ".join([*answers, *orders]), "trimming", "summary")


def _rankings(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """One sentence for each axis in which another tracker has the smallest error, as a number: it can be by chance.

    All are compared at one age (frame), the nearest to the first of those that their headlines are about.
    """
    rows = [first(conditions.of(tables["summary"], tracker)) for tracker in conditions.trackers]
    known = [int(row["at"]) for row in rows if row is not None and row["at"] is not None]
    if len(known) < 2:
        return []
    at = min(known, key=abs)
    found = [_ranking(tables["intervals"], conditions, at, axis) for axis in "uv"]
    return [sentence for sentence in found if sentence]


def _ranking(intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str) -> str:
    values = {trimming: _rms(intervals, conditions, at, axis, trimming) for trimming in _BOTH}
    if len(values[_BOTH[0]]) < 2 or len({frozenset(each) for each in values.values()}) > 1:
        return ""
    best = {trimming: min(each, key=lambda tracker: each[tracker]) for trimming, each in values.items()}
    if len(set(best.values())) == 1:
        return ""
    untrimmed, trimmed = (_smallest(values[trimming], best[trimming]) for trimming in _BOTH)
    order = f"that of {untrimmed} without trimming, and that of {trimmed} after it"
    return f"In the measured scenes, features pooled, the smallest RMS in {axis} {conditions.place(at)} is {order}."


def _rms(
    intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str, trimming: str
) -> Mapping[str, float]:
    """Root mean square errors of the trackers that have one, px, features pooled."""
    rows = {
        tracker: first(curve_rows(conditions.of(intervals, tracker), conditions, "second", at, axis, trimming=trimming))
        for tracker in conditions.trackers
    }
    return {
        tracker: math.sqrt(row["value"])
        for tracker, row in rows.items()
        if row is not None and row["value"] is not None
    }


def _smallest(values: Mapping[str, float], best: str) -> str:
    return f"{best} ({px(values[best])})"


def _verdicts(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """One sentence for each question and tracker whose verdicts differ."""
    sentences: list[str] = []
    for tracker in conditions.trackers:
        for coordinate in "uv":
            rows = conditions.of(tables["time_structure"], tracker).filter(coordinate=coordinate)
            sentences += _differs(rows, f"The growth of the error of {tracker} in {coordinate}")
        zero = conditions.of(tables["zero_mean"], tracker).filter(pl.col("at").is_null(), axis=conditions.axis)
        sentences += _differs(zero, f"Whether {tracker} has a mean error")
    return sentences


def _differs(rows: pl.DataFrame, subject: str) -> Sequence[str]:
    found = [first(rows.filter(trimming=trimming)) for trimming in _BOTH]
    verdicts = [None if row is None else str(row["verdict"]) for row in found]
    if None in verdicts or verdicts[0] == verdicts[1]:
        return []
    words = [_WORDS.get(verdict, verdict) for verdict in verdicts if verdict is not None]
    answers = (f"{word} {trimming}" for word, trimming in zip(words, _BOTH, strict=True))
    return [f"{subject}: {listing(answers)}."]
