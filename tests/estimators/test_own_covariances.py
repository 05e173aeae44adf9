"""A file of tracks whose covariances are four times too small: results, finding, figure and `noise check` say so."""

import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from benchmarks.noise import check
from polars.testing import assert_frame_equal
from tests.estimators.conftest import TEXT, Silent
from tests.lean import only_topics

import tracknoise as tn
from tracknoise.analysis.covariance_verdicts import OWN_COVARIANCES
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.report.figures.noise_models import covariance_figures
from tracknoise.report.report_data import ReportData
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.result_rows import results_of
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import run_results
from tracknoise.topics.covariance_topic import COVARIANCES

CLAIMED = {"cov_uu": 0.09 / 4.0, "cov_uv": 0.0, "cov_vv": 0.04 / 4.0}


@pytest.fixture(scope="module")
def claimed(planted_run: Path, made_once: Callable[[str, Callable[[Path], object]], Path]) -> RunFolder:
    """The tracks of `planted_run`, read from files that state a quarter of the true covariance."""

    def measure(path: Path) -> None:
        path.mkdir()
        for key, entry in (planted := RunFolder(planted_run)).manifest().sequences.items():
            seen = planted.sequence_table("observations", key).filter(speed=1)
            later = pl.when(pl.col("age") > 0)
            stated = [later.then(value).otherwise(0.0).alias(name) for name, value in CLAIMED.items()]
            seen.select("track", "frame", "u_px", "v_px", *stated).write_csv(path / f"{entry.sequence.scene}.csv")
        text = TEXT.format(name="claimed", speeds=[1], option="").replace('kind = "oracle"', 'kind = "imported"')
        text = re.sub("\noptions = .*", '\noptions = { path = "{scene}.csv" }', text)
        (path / "x.toml").write_text(text)
        with only_topics(COVARIANCES):
            execute(load_experiment(path / "x.toml"), RunFolder(path / "run"), listener=Silent())

    return RunFolder(made_once("claimed-covariances", measure) / "run")


def test_results_have_the_factor_and_the_verdict(claimed: RunFolder) -> None:
    rows = run_results(claimed).filter(
        pl.col("at").is_null(), topic="own covariances", trimming="untrimmed", part="cov"
    )
    found = {(row["quantity"], row["of"]): row for row in rows.to_dicts()}
    nees = found["covariance_nees", None]
    assert nees["verdict"] == "no"
    assert nees["value"] == pytest.approx(4.0, rel=0.05)
    assert nees["low"] < 4.0 < nees["high"]
    held = found["covariance_coverage", "95 %"]
    assert held["value"] == pytest.approx(1.0 - 0.05**0.25, abs=0.02)
    assert found["covariance_gain", None]["verdict"] == "yes"  # u and v differ, which one sigma does not say
    again = results_of({OWN_COVARIANCES: claimed.statistics(OWN_COVARIANCES)})
    names = {"quantity": pl.String, "topic": pl.String}
    stored = run_results(claimed).filter(topic="own covariances").cast(names)
    assert_frame_equal(again.cast(names).sort("id"), stored.sort("id"))
    by_age = run_results(claimed).filter(quantity="covariance_nees", axis="age", trimming="untrimmed")
    assert by_age["value"].to_list() == pytest.approx([4.0] * by_age.height, rel=0.2)


def test_one_finding_says_so(claimed: RunFolder) -> None:
    found = claimed.statistics(FINDINGS).filter(topic="covariances").to_dicts()
    (text,) = (row["text"].replace("\N{NO-BREAK SPACE}", " ") for row in found)
    assert "imported's own covariances are too small: 95 % regions contain 5" in text
    assert "They would have to be multiplied by 4" in text.replace("by 3.9", "by 4")
    assert set(found[0]["rows"]) <= set(run_results(claimed)["id"])
    assert "multiply by" in found[0]["brief"]


def test_the_check_of_the_same_columns_agrees(claimed: RunFolder, capsys) -> None:
    assert check.main(["--own", "cov", "--tracker", "imported", "--on", str(claimed.path)]) == 0
    out = capsys.readouterr().out
    (line,) = (line for line in out.splitlines() if line.startswith("NEES"))
    rows = run_results(claimed).filter(pl.col("at").is_null(), quantity="covariance_nees", trimming="untrimmed")
    assert f"{rows['value'].item():.2f}" in line


def test_one_figure_shows_it_where_there_are_covariances(claimed: RunFolder, planted_run: Path) -> None:
    (figure,) = covariance_figures(ReportData.of(claimed))
    assert "too small" in figure.message
    assert len(figure.spec["concat"]) == 2
    assert covariance_figures(ReportData.of(RunFolder(planted_run))) == []
    assert "covariances" not in tn.open_run(planted_run).findings()["topic"].to_list()
