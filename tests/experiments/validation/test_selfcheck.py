"""The self-test passes for a correct program, and fails for each defect that is put in."""

import shutil
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from tracknoise.cli.app import main
from tracknoise.experiments.analysis import run_statistics
from tracknoise.experiments.running.execute import execute
from tracknoise.experiments.validation.selfcheck import N_NUMBERS, compare, furthest, judge, selfcheck_experiment
from tracknoise.statistics.curves import curves
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.oracle import OracleTracker
from tracknoise.truth.anchored import BirthSession

SETTINGS = ["white noise", "bias", "drift", "anisotropic", "outliers", "losses"]


@pytest.fixture
def check(tmp_path, told):
    """Runs the check on so many scenes and compares."""

    def go(scenes: int) -> pl.DataFrame:
        run = RunFolder(tmp_path / "run")
        execute(selfcheck_experiment(scenes=scenes, seed=1), run, listener=told())
        return compare(run)

    return go


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> RunFolder:
    path = tmp_path_factory.mktemp("selfcheck") / "run"
    with pytest.raises(SystemExit) as exit_:
        main(["selfcheck", "--scenes", "6", "--out", str(path), "--quiet", "-w", "1"])
    assert exit_.value.code == 0
    return RunFolder(path)


@pytest.fixture(scope="module")
def clean(run) -> pl.DataFrame:
    return compare(run)


def off(comparison: pl.DataFrame) -> set[tuple[str, str]]:
    """Settings and statistics of which a number is off."""
    return set(comparison.filter("off").select("setting", "statistic").iter_rows())


def test_a_correct_program_passes(clean):
    verdict = judge(clean)
    assert off(clean) == set()
    assert verdict.passes
    assert verdict.n_numbers == clean.height
    assert verdict.n_within >= verdict.n_least > 0.75 * verdict.n_intervals


def test_every_setting_and_speed_is_compared_in_every_way(clean):
    assert clean["setting"].unique(maintain_order=True).to_list() == SETTINGS
    numbers = clean.select("setting", "speed", "statistic", "coordinate", "at")
    assert numbers.n_unique() == numbers.height == N_NUMBERS == len(SETTINGS) * 2 * (2 * (2 + 2 + 3) + 2 + 1 + 2)
    assert clean["measured"].is_finite().all()
    assert clean.filter(pl.col("within").is_null())["statistic"].unique().to_list() == ["loss_ratio"]


def test_expected_values_are_those_of_the_settings(clean):
    def expected(setting, statistic, coordinate, at, speed=2):
        keys = {"setting": setting, "statistic": statistic, "speed": speed, "at": at, "coordinate": coordinate}
        same = [pl.col(name).eq_missing(value) for name, value in keys.items()]
        return clean.filter(same)["expected"].item()

    assert expected("drift", "nu", "u", 12) == pytest.approx(0.6)
    assert expected("drift", "nu", "v", 12) == pytest.approx(-0.36)
    assert expected("bias", "Phi", "uv", 4) == pytest.approx(-0.08, rel=0.01)
    assert expected("anisotropic", "Phi", "uv", 4) == pytest.approx(-0.18, rel=0.01)
    assert expected("losses", "survival", None, 6) == pytest.approx(0.83**6)
    assert expected("white noise", "eta", "u", 4) == pytest.approx(0.5 * np.sqrt(2 / np.pi))


def test_half_a_pixel_in_the_truth_is_noticed(check, monkeypatch):
    right = BirthSession.resolve

    def shifted(session):
        positions = right(session)
        return replace(positions, uv=positions.uv + 0.5)

    monkeypatch.setattr(BirthSession, "resolve", shifted)
    found = check(1)
    assert {(setting, "nu") for setting in SETTINGS} <= off(found)
    assert not {"survival", "mean_lifetime", "outlier_ratio", "loss_ratio"} & {name for _, name in off(found)}
    assert not judge(found).passes


def test_a_drift_of_the_wrong_sign_is_noticed(check, monkeypatch):
    right = OracleTracker._errors
    monkeypatch.setattr(OracleTracker, "_errors", lambda self, age: right(self, -age))
    found = check(1)
    assert {setting for setting, _ in off(found)} == {"drift"}
    assert not judge(found).passes


def test_second_moments_with_u_and_v_exchanged_are_noticed(run, tmp_path, monkeypatch):
    def exchanged(*arguments, **options):
        second = pl.col("statistic") == "Phi"
        swapped = [pl.when(second).then(b).otherwise(a).alias(a) for a, b in (("u", "v"), ("v", "u"))]
        return curves(*arguments, **options).with_columns(swapped)

    monkeypatch.setattr(run_statistics, "curves", exchanged)
    again = RunFolder(shutil.copytree(run.path, tmp_path / "run"))
    run_statistics.compute_statistics(again, selfcheck_experiment(scenes=6))
    found = compare(again)
    assert ("anisotropic", "Phi") in off(found)
    assert "white noise" not in {setting for setting, _ in off(found)}
    assert not judge(found).passes


@pytest.mark.parametrize("factor", [0.5, 0.0])
def test_intervals_that_are_too_narrow_are_noticed(clean, factor):
    narrow = [
        (pl.col("measured") + factor * (pl.col(side) - pl.col("measured"))).alias(side) for side in ("low", "high")
    ]
    verdict = judge(clean.with_columns(narrow).with_columns(within=pl.col("expected").is_between("low", "high")))
    assert verdict.n_off == 0
    assert not verdict.passes


def test_one_missed_interval_of_many_is_no_fault(clean):
    within = pl.Series([False] + [True] * (clean.height - 1))
    assert judge(clean.with_columns(within=within, off=pl.lit(value=False))).passes


def test_a_number_that_is_missing_is_a_fault(clean):
    verdict = judge(clean.filter(~((pl.col("setting") == "drift") & (pl.col("statistic") == "nu"))))
    assert (verdict.n_off, verdict.n_missing) == (0, 8)
    assert not verdict.passes


def test_a_number_that_is_null_is_off(run, tmp_path, monkeypatch):
    def emptied(*arguments, **options):
        nu = pl.when(pl.col("statistic") != "nu")
        return curves(*arguments, **options).with_columns(nu.then("u").alias("u"))

    monkeypatch.setattr(run_statistics, "curves", emptied)
    again = RunFolder(shutil.copytree(run.path, tmp_path / "run"))
    run_statistics.compute_statistics(again, selfcheck_experiment(scenes=6))
    assert off(compare(again)) == {(setting, "nu") for setting in SETTINGS}


def test_a_comparison_without_intervals_is_judged_by_its_numbers_alone(clean):
    verdict = judge(clean.with_columns(within=pl.lit(None, dtype=pl.Boolean)))
    assert (verdict.n_intervals, verdict.n_within, verdict.n_least) == (0, 0, 0)
    assert verdict.passes


def test_a_correct_program_has_a_number_beyond_the_limit_in_one_of_1000_self_tests():
    rng = np.random.default_rng(0)
    furthest_of_each = np.abs(rng.standard_normal((20000, 300))).max(axis=1)
    assert np.mean(furthest_of_each > furthest(300)) == pytest.approx(0.001, abs=0.001)
