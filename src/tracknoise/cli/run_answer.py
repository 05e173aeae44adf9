"""The answer of a run in a few sentences: what to set, which tracker is better, and whether the truth is trusted."""

from collections.abc import Iterable, Sequence

from tracknoise.cli.terminal import wrapped
from tracknoise.estimators.exports import estimator
from tracknoise.estimators.run_models import run_models
from tracknoise.report.answer import accuracy, noise_to_set, summarise
from tracknoise.report.answer_plot import why_innovations_differ
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Verdict
from tracknoise.topics.factor_topic import changes
from tracknoise.topics.headline import MOST_TRACKERS
from tracknoise.topics.headlines import findings_of
from tracknoise.topics.measures import Subject
from tracknoise.topics.sentences import joined, sentences_of
from tracknoise.topics.size_topic import size_measure
from tracknoise.topics.truth_topic import depth_is_from_images, without_truth
from tracknoise.topics.window_topic import ABOUT_GATES, has_gates, sigma_sentence, windows_of_advice

_WITHOUT_MODELS = {"scan", "triangulated"}
"""Kinds of truth that no noise model is fitted by."""
_CLAIMS = ("growth", "bias", "tails")
"""Measures of a card that answer yes or no, the most important first."""


def answer_lines(data: ReportData, most: int, *, is_ranked: bool = False) -> list[str]:
    """The answer in lines; the verdict on the truth is the first where the truth is not trusted or unknown.

    Parameters
    ----------
    data
        The run.
    most
        How many lines there may be; fewer trackers are shown than there are where they would not fit.
    is_ranked
        Whether a leaderboard said what to set, and which tracker is better.
    """
    trust = _flat(map(wrapped, _trust(data)))
    if data.truth.are_tracks_wrong or is_ranked:
        return trust
    better = wrapped(_better(data))
    told = [wrapped(text) for text in sentences_to_set(data)]
    common = wrapped(_common(data)) if told else []
    room = most - len(trust) - len(common)
    if _fitting(told, room - len(better)) < _fitting(told, room):  # all that can be set goes before what is better
        better = []
    shown = _fitting(told, room - len(better))
    if shown < len(told):
        shown = _fitting(told, room - len(better) - 1)
    shown = max(shown, min(1, len(told)))
    left = len(told) - shown
    more = [f"{left} more: tracknoise report {data.run.path} --all"] if left else []
    return _in_order(data, [*_flat(told[:shown]), *more, *common, *better], trust)


def _in_order(data: ReportData, numbers: list[str], trust: list[str]) -> list[str]:
    """The verdict on the truth first where it forbids the numbers, otherwise last."""
    return [*numbers, *trust] if data.truth.is_usable else [*trust, *numbers]


def _fitting(told: Sequence[Sequence[str]], room: int) -> int:
    """How many of the first trackers fit into some lines, at most `MOST_TRACKERS`."""
    fitting = (n for n in range(len(told[:MOST_TRACKERS]), 0, -1) if len(_flat(told[:n])) <= room)
    return next(fitting, 0)


def _flat(told: Iterable[Iterable[str]]) -> list[str]:
    return [line for lines in told for line in lines]


def _common(data: ReportData) -> str:
    """For which windows the numbers to set are, and what gates are; empty where windows differ, or there are none.

    Also why innovations differ, of the first tracker of which they do.
    """
    windows = windows_of_advice(data)
    gates = f"; {ABOUT_GATES[0].lower()}{ABOUT_GATES[1:]}" if has_gates(data) else ""
    held = f"Numbers to set are for {windows}{gates}." if windows else ""
    landmark = estimator(data.estimator).landmark
    reasons = (why_innovations_differ(one, landmark) for one in noise_to_set(data))
    return " ".join(filter(None, [held, next(filter(None, reasons), "")]))


def sentences_to_set(data: ReportData) -> list[str]:
    """What to set in an estimator, a sentence for each tracker; the size of its errors where this is unknown."""
    with_windows = not windows_of_advice(data)
    return [_of_tracker(data, tracker, with_windows=with_windows) for tracker in data.trackers]


def _of_tracker(data: ReportData, tracker: str, *, with_windows: bool) -> str:
    if sentences := sentences_of(sigma_sentence(data, tracker)):
        text = joined(sentences[: 2 if with_windows else 1])
        return f"{tracker}: {text[0].lower()}{text[1:]}"
    subject = Subject(data, tracker)
    measure = size_measure(subject)
    if measure is None:
        return f"{tracker}: what to set is unknown, because too few errors were measured."
    return f"{subject.said(measure.sentence)}{_why_unknown(data, tracker)}"


def _why_unknown(data: ReportData, tracker: str) -> str:
    """Why there is no number to set where the kind of truth allows one, after a space; empty where it does not."""
    models = run_models(data.run)
    if tracker in models.models or {entry.truth for entry in data.manifest.sequences.values()} <= _WITHOUT_MODELS:
        return ""
    reason = models.missing.get(tracker, "true positions are known in too few successive frames")
    return f" What to set is unknown: {reason.removeprefix('noise model: ')}."


def _better(data: ReportData) -> str:
    """Which tracker is better, in a sentence; empty where there is one tracker."""
    return joined(sentences_of(accuracy(data))[:1])


def _trust(data: ReportData) -> list[str]:
    """Whether the truth is trusted and what would help, what that changes in a check, and that scenes are copies."""
    truth = data.truth
    why, step = sentences_of(truth.text)[:1], sentences_of(truth.step)[:1]
    verdict = joined([truth.opening, *why, *(f"Next: {text}" for text in step)])
    change = joined(sentences_of(data.truth_change or "")[:1])
    lost = without_truth(data).strip() if depth_is_from_images(data) else ""
    return [verdict, truth.poses, truth.stated, lost, change, *findings_of(data.tables, "copies")["brief"]]


def most_important(data: ReportData, most: int) -> list[str]:
    """The answer and what was shown, the most important first.

    Parameters
    ----------
    data
        The run.
    most
        How many sentences there may be in all.
    """
    if data.truth.are_tracks_wrong:
        return [text for text in _trust(data) if text]
    to_set, trust = [*sentences_to_set(data)[:MOST_TRACKERS], _common(data)], _trust(data)
    answers = _in_order(data, [*to_set, _better(data)], trust)
    shown = list(filter(None, [*answers, *changes(data), *_shown(data)]))
    chosen = list[str]()
    for text in dict.fromkeys([trust[0], *filter(None, to_set), *shown]):  # the answers go before their reasons
        if len(sentences_of(joined([*chosen, text]))) > most:
            break
        chosen.append(text)
    return [text for text in shown if text in chosen]


def _shown(data: ReportData) -> list[str]:
    """What cards say that was shown to be so."""
    cards = summarise(data).cards
    claims = [measure for name in _CLAIMS for card in cards for measure in card.measures if measure.name == name]
    return [claim.sentence for claim in claims if claim.answer is not None and claim.answer.verdict == Verdict.yes]
