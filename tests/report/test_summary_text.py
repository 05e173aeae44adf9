"""The summary that commands print is the report's, in plain text."""

from collections.abc import Callable
from types import ModuleType

import polars as pl

from tracknoise.cli.run_summary import summary_text
from tracknoise.report.measured import summary
from tracknoise.report.report_data import ReportData
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict


def _table(run: RunFolder) -> list[str]:
    """The lines between the verdict on the truth and what the columns are."""
    return summary_text(run).split("\n\n", 1)[1].split("mean: over")[0].splitlines()


def test_the_verdict_on_the_truth_comes_first(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("only",), speeds=(1,))
    assert summary_text(run).startswith(f"{TruthVerdict.of_run(run).sentence}\n")


def test_there_is_a_line_a_condition_in_the_order_of_the_experiment(make_run: Callable[..., RunFolder]) -> None:
    views = ((0, "forward"), (0, "backward"))
    run = make_run(scenes=("only",), speeds=(1,), views=views)
    lines = [line.split() for line in _table(run)]
    assert lines[1][:4] == ["tracker", "speed", "direction", "tracks"]
    assert [line[0] + " " + line[2] for line in lines[3:]] == [
        f"{tracker} {direction}"
        for tracker in ("lucas-kanade", "correspondence")
        for direction in ("forward", "backward")
    ]


def test_frames_are_called_so(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("only",), born=40, key_frame=8, truth="scan")
    assert "frame" in _table(run)[1].split()
    assert {tuple(line.split()[1:6:4]) for line in _table(run)[3:]} == {("1", "16"), ("2", "18")}  # of both trackers


def test_many_conditions_are_not_all_listed(make_run: Callable[..., RunFolder], synthetic: ModuleType) -> None:
    lines = _table(make_run(**synthetic.DEGENERATE["many conditions"]))
    assert len(lines) == 5
    assert lines[-1] == "(under lighting LR0; 40 other conditions are in the report's tables/summary.csv)"


def test_many_conditions_of_one_view_are_all_listed(make_run: Callable[..., RunFolder]) -> None:
    """There are no others then, and nothing is said about them."""
    world = {"scenes": ("only",), "n_frames": 8, "born": 4, "min_features": 2}
    run = make_run(**world, trackers=tuple(f"t{number}" for number in range(7)), speeds=(1, 2, 3, 4, 5, 6))
    assert _table(run)[-1].startswith("t6")
    assert summary(ReportData.of(run)).caption == "Key numbers of every condition"


def test_the_noise_to_set_in_an_estimator_stands_below_the_table(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("only",), speeds=(1,))
    row = {"rank": 1, "topic": "estimator", "text": "Set 0.2 px.", "figure": "findings", "table": "window_sigmas"}
    run.write_statistics({FINDINGS: pl.DataFrame([row], schema=dict(FINDINGS))})
    assert summary_text(run).splitlines()[-1] == "Set 0.2 px."


def test_means_are_those_of_the_finding_on_bias(run: RunFolder) -> None:
    """Scenes weigh equally, however many features they have."""
    data = ReportData.of(run)
    means = data["zero_mean"].filter(trimming=data.trimming, axis=data.axis.name)
    shown = data.in_order(data["summary"]).join(means, on=["tracker", "speed", "at"], how="left", maintain_order="left")
    assert shown["mean_u_px"].to_list() != shown[f"{data.trimming}_nu_u_px"].to_list()
    assert [line.split()[5:8] for line in _table(run)[3:]] == [
        [str(row["at"]), f"{row['mean_u_px']:+.3f}", f"{row['mean_v_px']:+.3f}"] for row in shown.to_dicts()
    ]
