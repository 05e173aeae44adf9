"""The summary of a run, made from its tables: cards, statements, and how far they can be trusted.

- Findings as short sentences, each with a link to its evidence; the whole finding is kept as details.
- How far the numbers of a run can be trusted: how sure they are, and whether the truth is right.
- A run as a notebook shows it: the cards of its trackers.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import Resampled
from tracknoise.phrases.truth_headlines import IN
from tracknoise.report import card_rows, small_plots
from tracknoise.report.answer_summary import FORMAT, Card, Finding, Judgement, Measure, Statement, Summary
from tracknoise.report.card_rows import Subject, answer, answers_counted, sigma_sentence
from tracknoise.report.card_rows import card_number as plain
from tracknoise.report.noise_cells import depth_sentence
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.prepared import POPULATIONS
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.findings_schema import AuditVerdict
from tracknoise.text import counted
from tracknoise.truth_faults.audit_summary import NO_FAULT
from tracknoise.truth_faults.fault_parameters import Family
from tracknoise.words import TIMES, count, interval_text, listing, number, percent, pixels, sentence_case

_MEASURES = {
    "noise": ("error", "noise"),
    "bias": ("bias",),
    "shape": ("tails",),
    "growth": ("growth",),
    "outliers": ("outliers",),
    "lifetimes": ("lifetime",),
}
"""Topics whose sentences are those of the cards, and the names of the measures."""


def findings(data: ReportData, cards: Sequence[Card], accuracy: Judgement) -> tuple[Finding, ...]:
    """Every finding of the run in short sentences, by rank."""
    rows = data.findings.sort("rank").to_dicts()
    return tuple(_finding(data, row, cards, accuracy) for row in rows)


def _finding(data: ReportData, row: Mapping[str, Any], cards: Sequence[Card], accuracy: Judgement) -> Finding:
    texts = _of_cards(row, cards) or _of_topic(data, row, accuracy)
    statements = tuple(Statement(text, section) for text, section in texts)
    return Finding(row["topic"], statements, row["table"].replace("_", "-"), row["text"], tuple(row["rows"]))


def _of_cards(row: Mapping[str, Any], cards: Sequence[Card]) -> list[tuple[str, str]]:
    if row["topic"] == "estimator":
        return [
            (f"{card.tracker}: {card.sigma[0].lower()}{card.sigma[1:]}", row["figure"]) for card in cards if card.sigma
        ]
    names = _MEASURES.get(row["topic"], ())
    return [(one.sentence, one.section) for card in cards for one in card.measures if one.name in names]


def _of_topic(data: ReportData, row: Mapping[str, Any], accuracy: Judgement) -> list[tuple[str, str]]:
    if row["topic"] == "factors":
        first = [(accuracy.text, accuracy.section)] if len(data.trackers) > 1 else []
        return [*first, *([(text, row["figure"])] if (text := answers_counted(data)) else [])]
    if row["topic"] == "depth" and (sentences := [*filter(None, (depth_sentence(data, one) for one in data.trackers))]):
        return [(text, row["figure"]) for text in sentences]
    if row["topic"] in _OF_RESULTS and (result := _result_of(data, row)):
        return [(_OF_RESULTS[row["topic"]](result), row["figure"])]
    return [(_SENTENCES.get(row["topic"], _brief)(row), row["figure"])]


def _brief(row: Mapping[str, Any]) -> str:
    return row["brief"] or f"This run has a finding about {row['topic']}."


def _value(row: Mapping[str, Any]) -> str:
    shown = plain(Estimate.of_row(row, "value", "low", "high", row["unit"] or ""))
    return f"{shown.text} ({shown.interval})" if shown.interval else shown.text


def _result_of(data: ReportData, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The row of results of the number that a finding leads with: it says of which tracker and coordinate it is."""
    rows = data.results.filter(pl.col("id").is_in(row["rows"][:1]))
    return rows.row(0, named=True) if rows.height else None


def _root(row: Mapping[str, Any]) -> Mapping[str, Any]:
    """A row of second moments as root mean squares."""
    roots = {name: None if row[name] is None else math.sqrt(max(row[name], 0.0)) for name in ("value", "low", "high")}
    return {**row, **roots, "unit": "px"}


def _scenes(row: Mapping[str, Any]) -> str:
    n = 0 if row["value"] is None else int(row["value"])
    return f"Conditions have as few as {n} scene{'' if n == 1 else 's'}, which limits what intervals and tests can say."


def _truth(row: Mapping[str, Any]) -> str:
    if row["table"] == "triangulated_noise":
        return "True positions are fitted to the tracks, which hides drift along epipolar lines."
    return "True positions were recorded, so that their own errors are part of every number."


_SENTENCES: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "groups": lambda row: f"Scenes come in {number(int(row['value']))} groups; intervals allow for it.",
    "scenes": _scenes,
    "truth": _truth,
    "estimator": lambda row: (
        f"Residuals in windows of tracks look like {_value(row)}; how certain depths are is unknown."
    ),
    "data": lambda _: "Some data look wrong, so that errors may not be those of the trackers.",
    "copies": lambda _: "Some scenes have the images of others, so that intervals are too narrow.",
    "trimming": lambda _: "Trimming the tracks with the largest errors changes some of these answers.",
}
"""Sentence of each topic that is not about a tracker of a card."""
_OF_RESULTS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "pose errors": lambda row: (
        f"A motion that the stated poses do not have is {_value(row)} of the second moment of {row['tracker']}."
    ),
    "depth edges": lambda row: (
        f"On the {row['part'].rpartition(' ')[2]} side of depth edges, the mean error of {row['tracker']} is "
        f"{_value(row)} {IN[row['coordinate']]}."
    ),
    "differences": lambda row: (
        f"At the same corners, the mean position of {row['tracker']} less that of {row['against']} is {_value(row)} in "
        f"{row['coordinate']}."
    ),
    "survivorship": lambda row: f"The RMS in u of tracks of {row['tracker']} that live long is {_value(_root(row))}.",
}
"""Sentence of each topic that leads with the number of one row of results, from this row."""


_HOLD: dict[str, tuple[str, Verdict]] = {
    Resampled.scenes: ("They hold for similar scenes", Verdict.yes),
    Resampled.groups: ("They hold for similar groups of scenes", Verdict.yes),
    Resampled.within: ("They hold for these groups of scenes only", Verdict.undecided),
    Resampled.blocks: ("They hold for these scenes only", Verdict.undecided),
}
_FEW = 8
"""With fewer scenes than this, intervals contain the true value less often than their level says."""
_MOST_SHARE = 0.5
"""Share of the second moment from which on it is the truth's rather than the tracker's."""
_MOSTLY = 0.5
"""Share of observations without a true position from which on it is stated."""
_GENERAL, _RIGHT = "other scenes", "trusted"


def certainty(data: ReportData) -> Judgement:
    """What intervals were made from, and what they hold for."""
    known = data.nominal(data.intervals).drop_nulls(["level", "resampled", "n_scenes"])
    if known.is_empty():
        text = "No intervals were computed: the numbers hold for these scenes only."
        return Judgement(answer(_GENERAL, Verdict.undecided, wished=Verdict.yes), text, "measured")
    kinds = known.group_by("resampled", "level").agg(pl.len(), pl.col("n_scenes").max())
    kinds = kinds.sort("len", "resampled", "level")
    row = kinds.row(-1, named=True)
    hold, verdict = _HOLD[row["resampled"]]
    few = row["n_scenes"] < _FEW and row["resampled"] != Resampled.blocks
    text = f"{sentence_case(interval_text(row['level'], row['resampled'], [row['n_scenes']]))}. {hold}"
    text += "; with few scenes they are less reliable." if few else "."
    return Judgement(answer(_GENERAL, verdict, wished=Verdict.yes), text, "measured")


def truth(data: ReportData) -> Judgement:
    """Whether the true positions can be trusted: doubts about the data, faults that were found, and the floor."""
    verdict, text = _doubts(data) or _fitted(data) or _faults(data) or _floor(data)
    return Judgement(answer(_RIGHT, verdict, wished=Verdict.yes), f"{text}{_unknown(data)}", "truth")


def _unknown(data: ReportData) -> str:
    """How many observations have no true position, where these are most; begins with a space."""
    statuses = data.nominal(data.counts).filter(kind="truth")
    total = int(statuses["n"].sum())
    without = total - int(statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum())
    if without <= _MOSTLY * total:
        return ""
    rest = "no error could be measured" if without == total else "errors are those of the rest"
    return f" {percent(without / total)} of the observations have no true position; {rest}."


def _doubts(data: ReportData) -> tuple[Verdict, str] | None:
    doubtful = [entry for entry in data.manifest.sequences.values() if entry.doubts]
    if not doubtful:
        return None
    noun = "sequence looks" if len(doubtful) == 1 else "sequences look"
    return Verdict.no, f"The data of {len(doubtful)} {noun} wrong. Errors may not be those of the trackers."


def _fitted(data: ReportData) -> tuple[Verdict, str] | None:
    if not data.truth_is_fitted:
        return None
    return Verdict.undecided, "True positions are fitted to the tracks, which hides drift along epipolar lines."


def _faults(data: ReportData) -> tuple[Verdict, str] | None:
    """The first fault of the audit."""
    faults = data.audit.filter(pl.col("rank").is_not_null()).unique("rank", keep="first")
    texts = faults.sort("rank")["text"].drop_nulls().to_list()
    if not texts:
        return None
    first = texts[0].partition(" (")[0].partition(":")[0].rstrip(".")
    others = f"; {count(len(texts) - 1, 'other fault')} as well" if len(texts) > 1 else ""
    return Verdict.no, f"{first}{others}. Correct this before using the numbers."


def _floor(data: ReportData) -> tuple[Verdict, str]:
    """Whether known errors of the truth are small beside the errors of the trackers."""
    audited, opening = _checked(data)
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=data.trimming,
        population=data.population,
    )
    known = points.drop_nulls(["floor_u", "floor_v"]).sort("since")
    if known.is_empty():
        return Verdict.undecided, f"{opening} Its accuracy is not stated."
    share, floor_px, row = max(
        (_share(known.filter(tracker=name)) for name in known["tracker"].unique().sort()), key=lambda found: found[:2]
    )
    if floor_px == 0.0:
        return Verdict.yes if audited else Verdict.undecided, f"{opening} It is stated to be exact."
    error_px = math.hypot(row["u"], row["v"])
    of = f"{pixels(error_px)} px RMS error of {row['tracker']} {data.axis.place(row['since'])}"
    text = f"{opening} Its errors can cause {pixels(min(floor_px, error_px))} of the {of}."
    return Verdict.no if share > _MOST_SHARE else Verdict.yes, text


def _checked(data: ReportData) -> tuple[bool, str]:
    """Whether the audit could have found a fault, and what it says where it found none."""
    about = data.audit.filter(pl.col("family") == Family.alone).unique("parameter", keep="first")
    if about.is_empty():
        return False, "The truth was not checked for faults."
    unknown = about.filter(verdict=str(AuditVerdict.undetermined)).height
    if unknown == about.height:
        return False, "The audit could determine no parameter of the truth."
    return True, f"{NO_FAULT} {unknown} of {about.height} parameters cannot be determined." if unknown else NO_FAULT


def _share(points: pl.DataFrame) -> tuple[float, float, dict[str, Any]]:
    """Share of the second moment that the floor can cause at the last age, its length in px, and that point."""
    row = points.row(-1, named=True)
    error_px, floor_px = math.hypot(row["u"], row["v"]), math.hypot(row["floor_u"], row["floor_v"])
    return min((floor_px / error_px) ** 2 if error_px else 1.0, 1.0), floor_px, row


_TRUTHS: Mapping[str, str] = {
    "raycast": "ray casting of the exact surface",
    "birth": "poses and depth",
    "scan": "scan and poses",
    "triangulated": "points fitted to the tracks",
}


def summarise(data: ReportData) -> Summary:
    """Answer what a reader asks first."""
    subjects = [Subject(data, tracker) for tracker in data.trackers]
    size = card_rows.size_name(subjects)
    cards = tuple(_card(subject, size) for subject in subjects)
    errors = {card.tracker: _size(card) for card in cards}
    accuracy = card_rows.accuracy(data, errors)
    return Summary(
        FORMAT,
        data.name,
        measured(data),
        accuracy,
        certainty(data),
        truth(data),
        cards,
        findings(data, cards, accuracy),
    )


def measured(data: ReportData) -> str:
    """What was measured: data, scenes, frames, what could not be measured, truth, speed and view."""
    entries = list(data.sequences.values())
    if not entries:
        return "No sequence was measured."
    scenes = len({entry.sequence.scene for entry in entries})
    frames = {entry.n_frames for entry in entries}
    sizes = sorted({f"{entry.width} {TIMES} {entry.height}" for entry in entries})
    lengths = f"{min(frames)}" if len(frames) == 1 else f"{min(frames)} to {max(frames)}"
    image = f"{sizes[0]} px" if len(sizes) == 1 else "several sizes"
    data_names = listing(sorted({entry.sequence.dataset for entry in entries}))
    truth = listing(_TRUTHS.get(kind, kind) for kind in sorted({entry.truth for entry in entries}))
    image += "".join(f", {count(len(values), name)}" for name, values in data.varied.items())
    shown = f"{data.errors_shown} at speed {data.slowest}{data.where}"
    made = f"{count(scenes, 'scene')} of {lengths} frames, {image}.{_missing(data)}"
    return f"Data: {data_names}, {made} Truth: {truth}. {shown}."


def _missing(data: ReportData) -> str:
    """How many scenes could not be measured; sequences, if some of their scenes were. Begins with a space."""
    failed, there = list(data.manifest.failures), list(data.manifest.sequences)
    if not failed:
        return ""
    without, scenes = ({key.partition("@")[0] for key in keys} for keys in (failed, there))
    if without & scenes:
        return f" {len(failed)} of {counted(len(failed) + len(there), 'sequence')} could not be measured."
    return f" {len(without)} of {counted(len(without | scenes), 'scene')} could not be measured."


def _card(subject: Subject, size: str) -> Card:
    data, tracker = subject.data, subject.tracker
    smallest, fewest, longest = (
        card_rows.best(data, tracker, role, question)
        for role, question in (("core", "smallest"), ("outlier_ratio", "fewest"), ("lifetime", "longest"))
    )
    about_errors = [card_rows.error(subject, smallest, name=size)]
    if not data.truth_is_fitted:
        about_errors += [make(subject) for make in (card_rows.bias, card_rows.tails, card_rows.growth)]
    found = [*about_errors, card_rows.outliers(subject, fewest), card_rows.lifetime(subject, longest)]
    measures = tuple(one for one in found if one is not None)
    return Card(tracker, data.colour[tracker], measures, sigma_sentence(data, tracker))


def _size(card: Card) -> Measure | None:
    return next((one for one in card.measures if one.name in ("error", "noise")), None)


def run_html(data: ReportData) -> str:
    """A part of an HTML page: what was measured, whether it can be trusted, and a card per tracker.

    Its style is limited to the part itself.
    """
    summary = summarise(data)
    scales = small_plots.scales(summary.cards)
    return template("notebook.html.j2").render(summary=summary, scales=scales, interval_plot=small_plots)
