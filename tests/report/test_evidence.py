from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import StoreError
from tracknoise.report.evidence import Evidence
from tracknoise.tables.store import RunFolder


def test_points_are_uncut_and_second_moments_are_roots(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    where = {"tracker": "lucas-kanade", "speed": 1, "population": "visible", "trimming": "trimmed", "at": 5}
    row = evidence.points.filter(**where, statistic="Phi").row(0, named=True)
    curve = evidence.curves.filter(**where, statistic="Phi", weighting="features").row(0, named=True)
    assert row["u"] == pytest.approx(np.sqrt(curve["u"]))
    assert evidence.points["n"].min() >= 40


def test_the_first_lighting_is_the_reference_and_is_named(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(lightings=("z", "a"), scenes=("only",), speeds=(2, 4)))
    assert evidence.lightings == ["z", "a"]  # as the experiment has them
    assert evidence.where == " under lighting z"
    assert evidence.slowest == 2
    assert evidence.nominal(evidence.outliers).select("lighting", "speed").unique().rows() == [("z", 2)]


def test_one_lighting_needs_no_name(run: RunFolder) -> None:
    assert Evidence.of(run).where == ""


def test_slugs_differ_where_names_do(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(trackers=("a b", "a_b", "LK"), scenes=("only",), speeds=(1,)))
    assert [evidence.slug(name) for name in evidence.trackers] == ["a-b-1", "a-b-2", "lk"]


def test_nothing_trimmed_has_no_percentile(make_run: Callable[..., RunFolder]) -> None:
    assert Evidence.of(make_run()).percentile == 90
    assert Evidence.of(make_run(percentile=None)).percentile is None
    assert Evidence.of(make_run(percentile=100.0)).percentile is None


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="expected"):
        Evidence.of(RunFolder(tmp_path))


def test_a_damaged_experiment_is_refused(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("damaged",), speeds=(1,))
    (run.path / "experiment.toml").write_text("name = ")
    with pytest.raises(StoreError, match=r"experiment\.toml: damaged .*expected"):
        Evidence.of(run)


def test_every_tracker_has_one_colour_and_speeds_have_its_shades(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    assert len(set(evidence.colour.values())) == 2
    assert list(evidence.speed_colours("lucas-kanade")) == ["1", "2"]
    assert isinstance(evidence.points, pl.DataFrame)
