"""How large errors are: the core, the root mean square, how many lie far out, and those of tracks that live long."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import polars as pl

from tracknoise.analysis.error_shape import ON_GRID
from tracknoise.analysis.estimand import OVER_ALL, Estimand, RoleValues, Wording
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.tables.enumerations import Aspect, Population, Trimming, Weighting
from tracknoise.topics.answer_summary import Measure
from tracknoise.topics.factor_topic import best
from tracknoise.topics.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    curve_estimate,
    curve_rows,
    curve_scenes,
    in_brackets,
    size_estimate,
)
from tracknoise.topics.measures import (
    POOLED_WORDS,
    SIZES,
    Subject,
    card_number,
    estimate_cell,
    first,
    short,
    shown_size,
    trimmed_word,
    with_interval,
)
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import each_axis, joined
from tracknoise.topics.shape_topic import why_no_shape
from tracknoise.topics.topic import ABOUT_TRACKS, Column, Topic
from tracknoise.topics.truth_topic import at_most, fitted_measure
from tracknoise.words import DASH, RMS_OF_SCENE, SPACE, count, format_estimate, listing, percent, rms_of_tracks

_SECTION = "error-by-tracker"


def size(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How large errors are at the reference age."""
    as_in_paper = conditions.trimming == Trimming.trimmed and conditions.percentile is not None
    return _paper(tables, conditions) if as_in_paper else _robust(tables, conditions)


def _robust(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Core and root mean square of all tracks, and the share of far errors."""
    closing = (
        "The core is the sigma of the Gaussian with the same median absolute error. A Gaussian has "
        f"0.3{SPACE}% of its errors beyond three cores.{'' if _is_one_scene(tables, conditions) else _OVER_SCENES}"
        f"{_population(conditions)}"
        f"{_brackets(tables, conditions, Weighting.geometric)}"
    )
    return _of_trackers(tables, conditions, _robust_of, "of all tracks", closing)


_OVER_SCENES = f" Core and {RMS_OF_SCENE} are geometric means over scenes."


def _is_one_scene(tables: RunTables, conditions: ReportedConditions) -> bool:
    """Whether errors are of one scene: its RMS is that of all tracks, and no typical one, which n features raise."""
    scenes = conditions.intervals(tables).filter(weighting=Weighting.geometric)["n_scenes"]
    return scenes.drop_nulls().unique().to_list() == [1]


def _robust_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row = first(conditions.of(tables["summary"], tracker))
    if row is None or row["at"] is None:
        return None
    intervals = conditions.intervals(tables, tracker)
    cores, pooled = (
        {axis: size_estimate(row, intervals, conditions, name, axis) for axis in "uv"} for name in ("core", "rms")
    )
    cores = {axis: core for axis, core in cores.items() if core.value is not None}
    lengths = [
        curve_estimate(curve_rows(intervals, conditions, "second", row["at"], axis, weighting=Weighting.geometric))
        for axis in "uv"
    ]
    sentences = list(_cores(intervals, conditions, row["at"], tracker, cores))
    is_typical = all(lengths) and not _is_one_scene(tables, conditions)
    quantity, roots = (RMS_OF_SCENE, lengths) if is_typical else (conditions.rms, [*pooled.values()])
    sentences += each_axis(
        [format_estimate(estimate) for estimate in roots if estimate is not None], f"Its {quantity} in u is"
    )
    sentences += [*_beyond(row, conditions.trimming), *_grid(tables, conditions, tracker)]
    return Part(" ".join(sentences), [estimate for estimate in (*cores.values(), *roots) if estimate is not None])


def _cores(
    intervals: pl.DataFrame, conditions: ReportedConditions, at: int, tracker: str, cores: Mapping[str, Estimate]
) -> Iterator[str]:
    """Sentences about the cores in u and in v, of which either or both may be missing; the first names the tracker."""
    texts = {axis: format_estimate(core) for axis, core in cores.items()}
    if not texts:
        yield f"{tracker} has no core: its errors are few, or mostly exactly zero."
        return
    axis, *_ = texts
    few = {axis: _few_scenes(intervals, conditions, at, axis) for axis in texts}
    yield f"The core of {tracker} in {axis} is {texts[axis]}.{few[axis]}"
    if scenes := curve_scenes(intervals, conditions, "core", at, axis, weighting=Weighting.geometric):
        yield scenes
    if len(texts) == 2:
        yield f"In v the core is {texts['v']}.{few['v']}"
    else:
        yield f"In {'v' if axis == 'u' else 'u'} it has no core: most errors are exactly zero."


def _few_scenes(intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str) -> str:
    """Say, after a space, where a core is of fewer scenes than the RMS beside it, or the other core; else empty."""
    weighting = Weighting.geometric
    n_core, n_core_u, n_rms = (
        curve_rows(intervals, conditions, role, at, coordinate, weighting=weighting)["n_scenes"].to_list()
        for role, coordinate in (("core", axis), ("core", "u"), ("second", axis))
    )
    if not n_core or n_core[0] == max([*n_core, *n_core_u, *n_rms]):
        return ""
    return (
        f" This core is of {count(n_core[0], 'scene')}; other scenes have few errors, or mostly errors of exactly zero."
    )


def _beyond(row: Mapping[str, Any], trimming: str) -> list[str]:
    """The share of far errors, beside that of a Gaussian."""
    shares = {axis: row[f"{trimming}_beyond_{axis}"] for axis in "uv"}
    texts = [f"{percent(share)} in {axis}" for axis, share in shares.items() if share is not None]
    return [f"{listing(texts).replace(' in ', ' of its errors in ', 1)} exceed three cores."] if texts else []


def _grid(tables: RunTables, conditions: ReportedConditions, tracker: str) -> list[str]:
    """A remark where errors lie on a grid, as those of whole or half pixels do."""
    reasons = why_no_shape(tables, conditions, tracker)
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
    intervals = conditions.intervals(tables, tracker)
    trimmed, untrimmed = (
        [size_estimate(row, intervals, conditions, "rms", axis, trimming) for axis in "uv"]
        for trimming in conditions.trimmings
    )
    sentences = [
        *each_axis([*map(format_estimate, trimmed)], f"After trimming, the error of {tracker} in u is"),
        *each_axis([*map(format_estimate, untrimmed)], "Without trimming, the error in u is"),
    ]
    return Part(joined(sentences), [*trimmed, *untrimmed])


def _of_trackers(
    tables: RunTables,
    conditions: ReportedConditions,
    describe: Callable[[RunTables, ReportedConditions, str], Part | None],
    what: str,
    closing: str,
) -> Headline | None:
    return conditions.headline(
        lambda tracker: describe(tables, conditions, tracker),
        opening=f"Error size {conditions.where(tables)}, {what}.{_places(tables, conditions)}",
        closing=closing.strip(),
        figure=_SECTION,
    )


def _places(tables: RunTables, conditions: ReportedConditions) -> str:
    """The ages or frames that numbers are of; begins with a space, and is empty where there are none."""
    summary = conditions.reported(tables["summary"]).drop_nulls("at")
    rows = (
        summary.sort("at").select("at", "tracker").unique(maintain_order=True).group_by("at", maintain_order=True).all()
    )
    places = [(conditions.place(at), listing(names)) for at, names in rows.iter_rows()]
    if len(places) == 1:
        return f" Numbers are {places[0][0]}."
    return "".join(f" Those of {names} are {where}." for where, names in places)


def _population(conditions: ReportedConditions) -> str:
    return " Occluded features are included." if conditions.population == Population.projected else ""


def _brackets(tables: RunTables, conditions: ReportedConditions, weighting: str) -> str:
    """How intervals of second moments at the reference were made; empty where there are none."""
    axis = conditions.axis
    chosen = {"aspect": Aspect.all, "axis": axis, "statistic": NAMES[axis]["second"], "weighting": weighting}
    reference = tables["summary"].select_seq(*POOLED, pl.col("at").cast(pl.Int64))
    return in_brackets(conditions.intervals(tables).filter(**chosen).join(reference, on=[*POOLED, "at"], how="semi"))


def survivorship(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether long-lived tracks have smaller errors than all tracks."""
    errors = f"{trimmed_word(conditions)}root mean square errors, {POOLED_WORDS}"
    return conditions.headline(
        lambda tracker: _survivorship_of(tables, conditions, tracker),
        opening=f"Survivorship bias {conditions.where(tables)}, in {errors}.",
        figure="survivorship-bias",
    )


def _survivorship_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row, intervals = first(conditions.of(tables["summary"], tracker)), conditions.intervals(tables, tracker)
    if row is None or row["at"] is None:
        return None
    since, trimming = abs(conditions.since(row["at"])), conditions.trimmings[0]
    aspect = Aspect.long_lived
    for age in sorted(intervals.filter(aspect=aspect)["at_least"].unique()):
        rows = curve_rows(
            intervals, conditions, "second", row["at"], "u", trimming=trimming, aspect=aspect, at_least=age
        )
        if age > since and (long := curve_estimate(rows)):
            all_tracks = size_estimate(row, intervals, conditions, "rms", "u", trimming)
            text = (
                f"{conditions.opening_place(row['at'])}, tracks of {tracker} that live to age {age} are compared with "
                f"all. The long-lived tracks have an error in u of {format_estimate(long)}. All tracks have "
                f"{format_estimate(all_tracks)}."
            )
            brief = f"The RMS over the tracks of {tracker} that live long is {short(long)} in u."
            return Part(text, [long, all_tracks], brief)
    return None


def size_measure(subject: Subject) -> Measure | None:
    """Size of the error at the reference age."""
    smallest = best(subject.data, subject.tracker, "core", "smallest")
    if subject.data.truth_is_fitted:
        return fitted_measure(subject, smallest)
    (name, axis), at = shown_size(subject.data), subject.shared_at
    if at is None or subject.row is None:
        return None
    other_axis = "v" if axis == "u" else "u"
    quantity, place = "core error" if name == "core" else subject.conditions.rms, subject.conditions.place(at)
    number, other_number = (
        card_number(size_estimate(subject.row, subject.intervals, subject.conditions, name, coordinate))
        for coordinate in (axis, other_axis)
    )
    if number.value is None:
        missing = f"unknown {place}: too few features"
        sentence = f"The error of {subject.tracker} is {missing}."
        return Measure("error", "px", number, None, smallest, f"{quantity} in {axis} {missing}", sentence, _SECTION)
    note = f"{quantity} in {axis} {place}; in {other_axis} {other_number.text}"
    most = at_most(subject.data.truth)
    sentence = f"The {quantity} of {subject.tracker} in {axis} is {most}{with_interval(number)}."
    return Measure("error", "px", number, None, smallest, note, sentence, _SECTION)


def size_columns(data: RunData) -> list[Column]:
    """Sizes at the reference age."""
    titles = {"core": "core", "rms": rms_of_tracks(data.trimming)}
    note = "Core: of a typical scene."
    return [
        Column(axis, partial(_size_cell, name=name, axis=axis), f"{titles[name]} (px)", note)
        for name in SIZES
        for axis in "uv"
    ]


def _size_cell(subject: Subject, name: str, axis: str) -> str:
    """Withheld where points are fitted to the tracks."""
    if subject.row is None or subject.data.truth_is_fitted:
        return DASH
    return estimate_cell(size_estimate(subject.row, subject.intervals, subject.conditions, name, axis))


SIZE = Topic(
    "noise",
    headline=size,
    columns=size_columns,
    measure=size_measure,
    in_cards=ABOUT_TRACKS,
    rows_of_card=("error", "noise"),
    compared=(
        Estimand(
            "core",
            f"Robust standard deviation of the errors of a scene: {OVER_ALL}.",
            RoleValues("core"),
            Wording("has smaller typical errors", "typical errors (core) are"),
            called="core of the errors",
            of_errors=True,
        ),
        Estimand(
            "second_moment",
            f"Second moment of all errors about zero, untrimmed: {OVER_ALL}.",
            RoleValues("second"),
            Wording("has a smaller mean squared error", "the mean squared error (second moment) is"),
            of_errors=True,
        ),
    ),
)
SURVIVORSHIP = Topic("survivorship", headline=survivorship, of_these_scenes=True)
