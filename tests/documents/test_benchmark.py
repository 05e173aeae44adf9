"""The published results are those of the rounds, and of every preset."""

from pathlib import Path

from benchmarks.published.page import page

from tracknoise.report.results_file import read_results, standings
from tracknoise.trackers.tracker_registry import load_preset, preset_names

ROOT = Path(__file__).parents[2]
RESULTS = read_results(ROOT / "docs" / "benchmark.json")


def test_every_round_is_published_with_every_preset():
    rounds = {path.stem for path in (ROOT / "benchmarks" / "published").glob("*.toml")}
    assert set(RESULTS.rounds) == rounds
    of_pairs = {name for name in preset_names() if load_preset(name).tracker == "second-view"}
    for name, one in RESULTS.rounds.items():
        expected = of_pairs if name == "stereo" else set(preset_names()) - of_pairs
        assert expected <= set(one.trackers), name


def test_the_page_has_what_the_results_say():
    text = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    shown = page(RESULTS, {})
    table = [line for line in shown.splitlines() if line.startswith("|")]
    assert len(table) > 10
    assert all(line in text for line in table)
    assert shown.splitlines()[2] in text


def test_leaders_of_simulated_rounds_are_ranked():
    assert all(standings(one).is_ranked for one in RESULTS.rounds.values() if not one.folder)
