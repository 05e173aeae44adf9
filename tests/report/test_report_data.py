import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import StoreError
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder


def test_points_are_uncut_and_second_moments_are_roots(run: RunFolder) -> None:
    data = ReportData.of(run)
    where = {"tracker": "lucas-kanade", "speed": 1, "population": "visible", "trimming": "trimmed", "at": 5}
    row = data.points.filter(**where, role="second").row(0, named=True)
    curve = data["curves"].filter(**where, statistic="Phi", weighting="features").row(0, named=True)
    assert row["u"] == pytest.approx(np.sqrt(curve["u"]))
    assert data.points["n"].min() >= 40


def test_the_first_lighting_is_the_reference_and_is_named(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(lightings=("z", "a"), scenes=("only",), speeds=(2, 4)))
    assert data.lightings == ["z", "a"]  # as the experiment has them
    assert data.where == " under lighting z"
    assert data.slowest == 2
    assert data.nominal(data["outliers"]).select("lighting", "speed").unique().rows() == [("z", 2)]


def test_one_lighting_needs_no_name(run: RunFolder) -> None:
    assert ReportData.of(run).where == ""


def test_slugs_differ_where_names_do(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(trackers=("a b", "a_b", "LK"), scenes=("only",), speeds=(1,)))
    assert [data.slug(name) for name in data.trackers] == ["a-b-1", "a-b-2", "lk"]


def test_nothing_trimmed_has_no_percentile(
    make_run: Callable[..., RunFolder], synthetic: ModuleType, run: RunFolder
) -> None:
    assert ReportData.of(run).percentile == 90
    assert ReportData.of(make_run(**synthetic.DEGENERATE["nothing trimmed"])).percentile is None


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="expected"):
        ReportData.of(RunFolder(tmp_path))


def test_a_damaged_experiment_is_refused(own_run: RunFolder) -> None:
    (own_run.path / "experiment.toml").write_text("name = ")
    with pytest.raises(StoreError, match=r"experiment\.toml: damaged .*expected"):
        ReportData.of(own_run)


def test_every_tracker_has_one_colour_and_speeds_have_its_shades(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert len(set(data.colour.values())) == 2
    assert list(data.speed_colours("lucas-kanade")) == ["1", "2"]
    assert isinstance(data.points, pl.DataFrame)


def test_errors_are_zero_in_the_key_frame_of_a_scan(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("only",), born=40, key_frame=8, truth="scan"))
    assert data.axis.name == "frame"
    assert data.key_frame("forward") == 8
    zero = data.points.filter(at=8)
    assert zero["since"].unique().to_list() == [0]
    assert zero.select(pl.max_horizontal("u", "v").max()).item() == 0
    row = data.points.filter(tracker="lucas-kanade", speed=1, trimming="trimmed", role="absolute", at=3)
    curve = data["curves"].filter(
        tracker="lucas-kanade", speed=1, trimming="trimmed", statistic="kappa", at=3, weighting="features"
    )
    assert row.select("since", "u").rows() == [(-5, value) for value in curve["u"].unique()] * row.height


def test_ages_count_without_a_key_frame(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert (data.axis.name, data.key_frame("forward")) == ("age", None)
    assert (data.points["since"] == data.points["at"]).all()


def test_lightings_that_nobody_names_are_in_the_order_of_their_numbers_and_diffuse_first(
    make_run: Callable[..., RunFolder],
) -> None:
    run = make_run(scenes=("unnamed",), trackers=("one",), speeds=(1,), lightings=("LR10", "LR9", "diffuse", "BF0"))
    assert ReportData.of(run).lightings == ["LR10", "LR9", "diffuse", "BF0"]
    manifest = run.manifest()
    run.replace_experiment(re.sub(r"lightings = .*", "", run.experiment_toml()), manifest)
    run.write_manifest(manifest)
    data = ReportData.of(run)
    assert data.lightings == ["diffuse", "BF0", "LR9", "LR10"]
    assert data.view["lighting"] == "diffuse"


def test_the_view_is_upright_and_forward_whatever_else_there_is(make_run: Callable[..., RunFolder]) -> None:
    views = ((90, "forward"), (0, "backward"), (0, "forward"))
    data = ReportData.of(make_run(scenes=("seen",), trackers=("one",), speeds=(1,), views=views))
    assert data.view == {"lighting": "default", "rotation": 0, "direction": "forward", "camera": ""}
    assert data.where == " at rotation 0° played forward"
    assert data.elsewhere("rotation") == " played forward"
    assert list(data.sequences) == ["seen@default"]
    across = data.across(data["outliers"], "rotation")
    assert sorted(across.select("rotation", "direction").rows()) == [(0, "forward"), (90, "forward")]


def test_the_view_is_one_that_was_measured(make_run: Callable[..., RunFolder]) -> None:
    views = ((90, "forward"), (0, "backward"))
    data = ReportData.of(make_run(scenes=("odd",), trackers=("one",), speeds=(1,), views=views))
    assert (data.view["rotation"], data.view["direction"]) == (90, "forward")
    assert data.nominal(data["outliers"]).height == 1


def test_of_many_conditions_only_those_of_the_view_are_listed(
    make_run: Callable[..., RunFolder], synthetic: ModuleType, run: RunFolder
) -> None:
    data = ReportData.of(make_run(**synthetic.DEGENERATE["many conditions"]))
    assert data.is_large
    assert data.listed(data["summary"])["lighting"].to_list() == ["LR0"]
    few = ReportData.of(run)
    assert few.listed(few["summary"]).height == few["summary"].height
