"""Whether errors are Gaussian."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import FREQUENCY, OVER_SCENES, Estimand, RoleValues, Wording
from tracknoise.analysis.gaussianity import GAUSSIANITY, RADII, gaussianity
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import Axis, Shape, Verdict
from tracknoise.topics.answer_summary import Measure
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.measures import Subject, answer, card_number, first, with_interval
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import reasons
from tracknoise.topics.topic import NO_ROWS, Analysis, Column, Topic
from tracknoise.words import DASH, SHAPES, SPACE, format_estimate, number, percent, sentence_case

_MEANINGS = {Shape.contaminated: " (as if some came from a wider Gaussian)"}
"""What is added to the name of a shape that says little by itself."""


def shape(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether errors are Gaussian, in the band of ages that contains the reference age."""
    return conditions.headline(
        lambda tracker: _shape_of(tables, conditions, tracker),
        opening=f"Shape of the error distribution {conditions.where(tables)}.",
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
            errors = f"{trimming} errors" if len(conditions.trimmings) > 1 else "errors"
            whose = f"{sentence_case(errors)} of {tracker} at {band_text(conditions.axis, low, high)}"
            are = f"{whose} are {SHAPES[row['verdict']]}{_MEANINGS.get(row['verdict'], '')}"
            why = [] if within else reasons(row["why"])
            sentences += [f"{are}.", *why, *_tails(row, within, scales)]
    return Part(" ".join(sentences), estimates)


def why_no_shape(tables: RunTables, conditions: ReportedConditions, tracker: str) -> list[str]:
    """Reasons why the shape in bands of ages is not known, each once."""
    rows = conditions.of(tables["gaussianity"], tracker).filter(trimming=conditions.trimming)
    return rows["why"].drop_nulls().unique(maintain_order=True).to_list()


def shapes_of(data: RunData, tracker: str) -> list[Shape]:
    """Shapes in all bands of ages at the lowest speed."""
    rows = data.nominal(data["gaussianity"]).filter(tracker=tracker, trimming=data.trimming)
    return [Shape(shape) for shape in rows["verdict"]]


def _gain(row: Mapping[str, Any], name: str) -> list[Estimate]:
    """A gain in nats per error; empty where it is unknown."""
    if row[f"gain_{name}_nats"] is None:
        return []
    return [Estimate.of_row(row, f"gain_{name}_nats", f"gain_{name}_low", f"gain_{name}_high", "nat")]


def _tails(row: Mapping[str, Any], within: list[Estimate], scales: list[Estimate]) -> list[str]:
    tail = row["tail_99_within"]
    texts = [f"Within scenes, {number(tail)} times as many errors as of a Gaussian lie beyond its 99{SPACE}% ellipse."]
    gains = [f"Within scenes, Student's t gains {format_estimate(gain)} per error over a Gaussian." for gain in within]
    added = [f"Different scales of scenes add {format_estimate(gain)} to this gain." for gain in scales]
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


_GAUSSIAN_KURTOSIS = 8.0
"""Of two coordinates."""
_HEAVY = (Shape.heavy_tailed, Shape.contaminated)


def shape_measure(subject: Subject) -> Measure | None:
    """Kurtosis within scenes at ages around the reference age, and whether tails are heavier than a Gaussian's."""
    trimming = subject.conditions.trimming
    row = _at_reference(subject, trimming) or first(_bands(subject, trimming))
    if row is None:
        return None
    pooled = row["kurtosis_within"] is None
    part, part_name = ("kurtosis", "pooled kurtosis") if pooled else ("kurtosis_within", "kurtosis within scenes")
    kurtosis = Estimate.of_row(row, part, f"{part}_low", f"{part}_high")
    shown, ratio = card_number(kurtosis), replace(kurtosis.times(1.0 / _GAUSSIAN_KURTOSIS), unit="times")
    heavy = {Shape.undecided: Verdict.undecided, **dict.fromkeys(_HEAVY, Verdict.yes)}.get(row["verdict"], Verdict.no)
    answered = answer("heavy tails", heavy, wished=Verdict.no)
    size = "unknown" if shown.value is None else f"{with_interval(card_number(ratio))} that of a Gaussian"
    sentence = f"Errors of {subject.tracker} are {SHAPES[row['verdict']]}: their kurtosis is {size}."
    ages = band_text(subject.conditions.axis, row["age_low"], row["age_high"])
    note = f"{part_name} (Mardia's: {_GAUSSIAN_KURTOSIS:g} for a Gaussian), {ages}{_far_share(subject)}"
    return Measure("tails", "", shown, _GAUSSIAN_KURTOSIS, answered, note, sentence, "gaussianity")


def _bands(subject: Subject, trimming: str) -> pl.DataFrame:
    return subject.of("gaussianity").filter(trimming=trimming).sort("age_low")


def _at_reference(subject: Subject, trimming: str) -> dict[str, Any] | None:
    """The band of ages that holds the reference age."""
    since = 1 if subject.at is None else abs(subject.conditions.since(subject.at))
    holds = pl.col("age_low") <= since, pl.col("age_high").fill_null(since) >= since
    return first(_bands(subject, trimming).filter(*holds))


def shape_columns(data: RunData) -> list[Column]:
    """Verdicts around the reference age, one for each trimming."""
    return [
        Column("errors" if data.percentile is None else trimming, partial(_shape_cell, trimming=trimming), "Gaussian?")
        for trimming in data.conditions().trimmings
    ]


def _shape_cell(subject: Subject, trimming: str) -> str:
    row = _at_reference(subject, trimming)
    return DASH if row is None else str(row["verdict"])


def _far_share(subject: Subject) -> str:
    """Share of errors larger than three cores, in the coordinate where it is larger."""
    row = subject.row or {}
    shares = {axis: row.get(f"{subject.conditions.trimming}_beyond_{axis}") for axis in "uv"}
    known_shares = {axis: share for axis, share in shares.items() if share is not None}
    if not known_shares or row["at"] is None:
        return ""
    worst = max(known_shares, key=known_shares.__getitem__)
    return f"; {percent(known_shares[worst])} beyond three cores in {worst}, {subject.conditions.place(row['at'])}"


def _shapes_of(inputs: RunInputs) -> tuple[pl.DataFrame, pl.DataFrame]:
    samples = inputs.run.stacked_tables("samples", inputs.keys)
    shapes = gaussianity(
        inputs.moments,
        samples,
        key_frames=inputs.key_frames,
        min_features=inputs.min_features,
        **inputs.intervals,
    )
    return shapes.gaussianity, shapes.radii


SHAPE = Topic(
    "shape",
    (Analysis((GAUSSIANITY, RADII), _shapes_of, if_fitted=NO_ROWS),),
    headline=shape,
    measure=shape_measure,
    columns=shape_columns,
    rows_of_card=("tails",),
    compared=(
        Estimand(
            "tails",
            "Share of the errors of a scene that are larger than three cores of their age, all ages together: "
            f"{OVER_SCENES} and both coordinates.",
            RoleValues("tails"),
            Wording("has lighter tails", "errors beyond three cores (tails) are", *FREQUENCY, is_secondary=True),
            of_errors=True,
        ),
    ),
)
