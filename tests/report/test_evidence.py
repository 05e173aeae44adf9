import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import StoreError
from tracknoise.report.evidence import Evidence
from tracknoise.tables.store import RunFolder


def test_points_are_uncut_and_second_moments_are_roots(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    where = {"tracker": "lucas-kanade", "speed": 1, "population": "visible", "trimming": "trimmed", "at": 5}
    row = evidence.points.filter(**where, role="second").row(0, named=True)
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


def test_errors_are_zero_in_the_key_frame_of_a_scan(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(scenes=("only",), born=40, key_frame=8, truth="scan"))
    assert evidence.axis.name == "frame"
    assert evidence.key_frame("forward") == 8
    zero = evidence.points.filter(at=8)
    assert zero["since"].unique().to_list() == [0]
    assert zero.select(pl.max_horizontal("u", "v").max()).item() == 0
    row = evidence.points.filter(tracker="lucas-kanade", speed=1, trimming="trimmed", role="absolute", at=3)
    curve = evidence.curves.filter(
        tracker="lucas-kanade", speed=1, trimming="trimmed", statistic="kappa", at=3, weighting="features"
    )
    assert row.select("since", "u").rows() == [(-5, value) for value in curve["u"].unique()] * row.height


def test_ages_count_without_a_key_frame(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    assert (evidence.axis.name, evidence.key_frame("forward")) == ("age", None)
    assert (evidence.points["since"] == evidence.points["at"]).all()


def test_lightings_that_nobody_names_are_in_the_order_of_their_numbers_and_diffuse_first(
    make_run: Callable[..., RunFolder],
) -> None:
    run = make_run(scenes=("unnamed",), trackers=("one",), speeds=(1,), lightings=("LR10", "LR9", "diffuse", "BF0"))
    assert Evidence.of(run).lightings == ["LR10", "LR9", "diffuse", "BF0"]
    toml = run.path / "experiment.toml"
    toml.write_text(re.sub(r"lightings = .*", "", toml.read_text()))
    evidence = Evidence.of(run)
    assert evidence.lightings == ["diffuse", "BF0", "LR9", "LR10"]
    assert evidence.view["lighting"] == "diffuse"


def test_the_view_is_upright_and_forward_whatever_else_there_is(make_run: Callable[..., RunFolder]) -> None:
    views = ((90, "forward"), (0, "backward"), (0, "forward"))
    evidence = Evidence.of(make_run(scenes=("seen",), trackers=("one",), speeds=(1,), views=views))
    assert evidence.view == {"lighting": "default", "rotation": 0, "direction": "forward"}
    assert evidence.where == " at rotation 0° played forward"
    assert evidence.elsewhere("rotation") == " played forward"
    assert list(evidence.sequences) == ["seen@default"]
    across = evidence.across(evidence.outliers, "rotation")
    assert sorted(across.select("rotation", "direction").rows()) == [(0, "forward"), (90, "forward")]


def test_the_view_is_one_that_was_measured(make_run: Callable[..., RunFolder]) -> None:
    views = ((90, "forward"), (0, "backward"))
    evidence = Evidence.of(make_run(scenes=("odd",), trackers=("one",), speeds=(1,), views=views))
    assert (evidence.view["rotation"], evidence.view["direction"]) == (90, "forward")
    assert evidence.nominal(evidence.outliers).height == 1


def test_of_many_conditions_only_those_of_the_view_are_listed(
    make_run: Callable[..., RunFolder], synthetic: ModuleType, run: RunFolder
) -> None:
    evidence = Evidence.of(make_run(**synthetic.DEGENERATE["many conditions"]))
    assert evidence.is_large
    assert evidence.listed(evidence.summary)["lighting"].to_list() == ["LR0"]
    few = Evidence.of(run)
    assert few.listed(few.summary).height == few.summary.height
