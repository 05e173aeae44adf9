"""Options of trackers as factors: which there are, and what they are compared by."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.analysis.test_dependence import asked, moments
from tests.lean import without_audit, without_depths, without_geometry

from tracknoise.analysis.factors import DEPENDENCE, OptionFactor, option_factors
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.report import factor_section
from tracknoise.report.report_data import ReportData
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.store import RunFolder
from tracknoise.words import difference_sentences, level_text


def options(detector: str = "agast", window: int = 15, threshold: int = 10) -> dict[str, object]:
    return {"detection": {"detector": detector, "threshold": threshold}, "window_px": window}


def test_trackers_that_differ_in_one_option_are_levels_of_it() -> None:
    found = option_factors({"lk": ("lk", options()), "fast": ("lk", options("fast")), "m": ("match", options())})
    assert found == [OptionFactor("detection.detector", "lk", {"agast": "lk", "fast": "fast"})]


def test_trackers_that_differ_in_two_options_are_not_compared_by_either() -> None:
    assert option_factors({"lk": ("lk", options()), "other": ("lk", options("fast", 21))}) == []


def test_kinds_are_never_mixed_and_equal_trackers_are_no_factor() -> None:
    assert option_factors({"lk": ("lk", options()), "match": ("match", options("fast"))}) == []
    assert option_factors({"lk": ("lk", options()), "again": ("lk", options())}) == []


def test_a_tracker_may_be_compared_by_several_options() -> None:
    found = option_factors(
        {
            "a": ("lk", options()),
            "b": ("lk", options("fast")),
            "c": ("lk", options("sift")),
            "w": ("lk", options("agast", 21)),
        }
    )
    assert [(one.name, one.levels) for one in found] == [
        ("detection.detector", {"agast": "a", "fast": "b", "sift": "c"}),
        ("window_px", {"15": "a", "21": "w"}),
    ]


def test_several_sets_of_one_kind_are_told_by_their_names() -> None:
    trackers = {
        f"{detector}{window}": ("lk", options(detector, window))
        for window in (15, 21)
        for detector in ("agast", "fast")
    }
    detectors = [one for one in option_factors(trackers) if one.name == "detection.detector"]
    assert [one.of for one in detectors] == ["agast15, fast15", "agast21, fast21"]


def test_an_option_that_one_tracker_lacks_counts_as_none() -> None:
    found = option_factors({"a": ("lk", {"limit": 3}), "b": ("lk", {})})
    assert found == [OptionFactor("limit", "lk", {"3": "a", "none": "b"})]


def two_detectors(factor: float) -> pl.DataFrame:
    """Two trackers in the same scenes, whose errors differ by a factor."""
    first = moments({1: 1.0}, tracker="lk")
    second = moments({1: factor}, tracker="lk-fast")
    return pl.concat([first, second])


OPTIONS = option_factors({"lk": ("lucas-kanade", options("gftt")), "lk-fast": ("lucas-kanade", options("fast"))})


def test_an_option_has_the_effect_of_the_trackers_paired_by_scene() -> None:
    table = asked(two_detectors(1.4), options=OPTIONS)
    (row,) = table.filter(factor="detection.detector", statistic="Phi").to_dicts()
    (trackers,) = table.filter(factor="tracker", statistic="Phi").to_dicts()
    assert (row["tracker"], row["speed"], row["verdict"]) == ("lucas-kanade", 1, "yes")
    assert (row["larger"], row["better"], row["n_levels"]) == ("fast", "gftt", 2)
    assert row["effect"] == pytest.approx(1.4**2, rel=0.03)
    for name in ("effect", "low", "high", "most", "p_yes", "n_scenes", "margin"):
        assert row[name] == trackers[name]
    (text,) = (one.replace("\N{NO-BREAK SPACE}", " ") for one in difference_sentences(row, "second"))
    assert text.startswith("The second moment of lucas-kanade is 1.9")
    assert text.endswith("as large with detector fast as with detector gftt; detector gftt is better.")


def test_without_options_the_table_is_the_same() -> None:
    made = two_detectors(1.4)
    with_options = asked(made, options=OPTIONS)
    assert with_options.filter(pl.col("factor") != "detection.detector").equals(asked(made))


def test_a_mean_that_differs_names_the_option() -> None:
    (row,) = asked(two_detectors(1.4), options=OPTIONS).filter(factor="detection.detector", statistic="nu").to_dicts()
    assert "more positive with detector fast than with detector gftt" in difference_sentences(row, "mean")[0]


def test_levels_of_options_are_named_by_the_last_part() -> None:
    assert level_text("detection.detector", "fast") == "with detector fast"
    assert level_text("speed", "4") == "at speed 4"


TEXT = """
name = "detectors"
keep = "statistics"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "forward", "arvr"]
worlds = 2
frames = 5
width = 120
height = 90
supersampling = 1
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "lucas-kanade"
name = "lk-gftt"
options = { detection = { detector = "gftt" } }
[[trackers]]
kind = "correspondence"
[[trackers]]
kind = "correspondence"
name = "correspondence-orb"
options = { descriptor = "orb" }
[statistics]
min_features = 2
"""


class Silent:
    def planned(self, keys: object, done: object) -> None: ...

    def frame(self, key: object, done: object, total: object, first: object) -> None: ...

    def measured(self, key: object, entry: object) -> None: ...

    def failed(self, keys: object, cause: object) -> None:
        raise AssertionError(cause)

    def remark(self, text: str) -> None: ...


def test_a_run_compares_detectors_and_descriptors(tmp_path: Path) -> None:
    run = RunFolder(tmp_path / "run")
    with without_audit(), without_depths(), without_geometry():
        execute(parse_experiment(TEXT, place="detectors"), run, listener=Silent())
    dependence = run.statistics(DEPENDENCE)
    found = dependence.filter(statistic="Phi").select(
        "factor", "tracker", "level_a", "level_b", "effect", "low", "n_scenes"
    )
    rows = {row["factor"]: row for row in found.to_dicts()}
    assert rows["detection.detector"]["tracker"] == "lucas-kanade"
    assert (rows["detection.detector"]["level_a"], rows["detection.detector"]["level_b"]) == ("agast", "gftt")
    assert rows["descriptor"]["tracker"] == "correspondence"
    assert (rows["descriptor"]["level_a"], rows["descriptor"]["level_b"]) == ("sift", "orb")
    for name in ("detection.detector", "descriptor"):
        assert rows[name]["n_scenes"] == 6
        assert rows[name]["effect"] >= 1
        assert np.isfinite(rows[name]["low"])
    data = ReportData.of(run)
    asked_about = [(cells[0], cells[1], cells[4]) for cells in factor_section.intervals(data).rows]
    assert ("detection.detector", "lucas-kanade", "agast and gftt") in asked_about
    assert any(
        name.startswith("descriptor, correspondence") for name in factor_section.side_by_side(data.comparison).columns
    )
    texts = run.statistics(FINDINGS).filter(topic="factors")["text"]
    assert "the tracker, the descriptor or the detector" in texts[0]
