"""Every sentence about a run is short, in its findings and in its summary."""

import json
from collections.abc import Callable

import pytest
from tests.report.synthetic import DEGENERATE
from tests.topics.short import long_in_findings, too_long

from tracknoise.report.answer import summarise
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.topics.headlines import findings_json

WORLDS: dict[str, dict[str, object]] = {
    "ordinary": {},
    "recorded": {"dataset": "tum", "truth": "birth", "scenes": ("only",)},
    "fitted": {"truth": "triangulated", "scenes": tuple(f"s{place}" for place in range(8)), "speeds": (1,)},
    "eight scenes": {"scenes": tuple(f"s{place}" for place in range(8)), "speeds": (1, 2)},
    "errors of the truth": {"scenes": ("only",), "speeds": (1,), "born": 40, "floor_px": 0.3},
    **DEGENERATE,
}


@pytest.mark.parametrize("world", WORLDS)
def test_sentences_of_made_up_runs_are_short(make_run: Callable[..., RunFolder], world: str) -> None:
    data = ReportData.of(make_run(told=True, **WORLDS[world]))
    names = {*data.trackers, *(entry.sequence.scene for entry in data.sequences.values())}
    document = json.loads(findings_json(data.tables))
    assert long_in_findings(document["findings"], names) == []
    summary = summarise(data)
    texts = [summary.accuracy.text, summary.certainty.text, summary.truth.text]
    for card in summary.cards:
        texts += [card.sigma, *(one.sentence for one in card.measures)]
    for finding in summary.findings:
        texts += [finding.details, *(one.text for one in finding.statements)]
    assert [sentence for text in texts for sentence in too_long(text, names)] == []
