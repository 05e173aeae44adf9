"""The summary of a run, made from its tables."""

from collections.abc import Mapping

from tracknoise.findings.wording import TIMES, count, listing
from tracknoise.printable import counted
from tracknoise.report.answer import error_measures, ranking, track_measures, trust
from tracknoise.report.answer.sigma import sigma_sentence
from tracknoise.report.answer.statements import findings
from tracknoise.report.answer.subject import Subject
from tracknoise.report.answer.summary import FORMAT, Card, Measure, Summary
from tracknoise.report.report_data import ReportData

_TRUTHS: Mapping[str, str] = {
    "raycast": "ray casting of the exact surface",
    "birth": "poses and depth",
    "scan": "scan and poses",
    "triangulated": "points fitted to the tracks",
}


def summarise(data: ReportData) -> Summary:
    """Answer what a reader asks first."""
    subjects = [Subject(data, tracker) for tracker in data.trackers]
    size = error_measures.size_name(subjects)
    cards = tuple(_card(subject, size) for subject in subjects)
    errors = {card.tracker: _size(card) for card in cards}
    accuracy = ranking.accuracy(data, errors)
    return Summary(
        FORMAT,
        data.name,
        measured(data),
        accuracy,
        trust.certainty(data),
        trust.truth(data),
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
        ranking.best(data, tracker, role, question)
        for role, question in (("core", "smallest"), ("outlier_ratio", "fewest"), ("lifetime", "longest"))
    )
    about_errors = [error_measures.error(subject, smallest, name=size)]
    if not data.truth_is_fitted:
        about_errors += [make(subject) for make in (error_measures.bias, error_measures.tails, error_measures.growth)]
    found = [*about_errors, track_measures.outliers(subject, fewest), track_measures.lifetime(subject, longest)]
    measures = tuple(one for one in found if one is not None)
    return Card(tracker, data.colour[tracker], measures, sigma_sentence(data, tracker))


def _size(card: Card) -> Measure | None:
    return next((one for one in card.measures if one.name in ("error", "noise")), None)
