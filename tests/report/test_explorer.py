"""What the explorer and the tracks behind its points are made of: the curves and tables of the run."""

import dataclasses
import json
from collections.abc import Callable
from types import ModuleType

import numpy as np
import polars as pl
import pytest

from tracknoise.report import looks
from tracknoise.report.explorer import SCENE_FEATURES, charts, explored
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.samples import KINDS
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def run(make_run: Callable[..., RunFolder]) -> RunFolder:
    return make_run(scenes=("fixating", "forward"), n_frames=20, born=20, min_features=20, patches=True)


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def test_pooled_curves_are_those_of_the_report(data: ReportData) -> None:
    chosen = {"tracker": "correspondence", "speed": 2, "population": "projected", "trimming": "untrimmed"}
    (curve,) = [one for one in explored(data)["errors"] if chosen.items() <= one.items()]
    points = data.points.filter(**chosen, role="second").sort("at")
    assert curve["second"]["at"] == points["at"].to_list()
    for column in ("u", "v", "u_low", "v_high"):
        expected = points[column].to_list()
        assert curve["second"].get(column, [None] * len(expected)) == [
            None if value is None else pytest.approx(value, rel=1e-3) for value in expected
        ]


def test_curves_of_a_scene_are_those_of_its_observations(run: RunFolder, data: ReportData) -> None:
    chosen = {"tracker": "lucas-kanade", "speed": 1, "trimming": "untrimmed", "scene": "forward"}
    (curve,) = [one for one in explored(data)["scenes"] if chosen.items() <= one.items()]
    observed = pl.concat(run.sequence_tables("observations")).filter(
        tracker="lucas-kanade", speed=1, scene="forward", truth="valid"
    )
    for place, age in enumerate(curve["mean"]["at"]):
        errors = observed.filter(age=age)["du_px"].to_numpy()
        assert curve["mean"]["n"][place] == len(errors) >= SCENE_FEATURES
        if age:
            assert curve["mean"]["u"][place] == pytest.approx(errors.mean(), rel=1e-3)
            assert curve["absolute"]["u"][place] == pytest.approx(np.abs(errors).mean(), rel=1e-3)
            assert curve["second"]["u"][place] == pytest.approx(np.sqrt((errors**2).mean()), rel=1e-3)


def test_the_only_scene_has_the_curves_of_the_run(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("one",), speeds=(1,), n_frames=12, born=20, min_features=20))
    chosen = {"tracker": "lucas-kanade", "population": data.population, "trimming": "untrimmed"}
    pooled, alone = (
        [one for one in explored(data)[name] if chosen.items() <= one.items()] for name in ("errors", "scenes")
    )
    for role in ("mean", "absolute", "second"):
        whole = dict(zip(pooled[0][role]["at"], pooled[0][role]["u"], strict=True))
        same = dict(zip(alone[0][role]["at"], alone[0][role]["u"], strict=True))
        assert {at: same[at] for at in whole} == pytest.approx(whole, rel=1e-3)


def test_everything_can_be_written_as_json(make_run: Callable[..., RunFolder], synthetic: ModuleType) -> None:
    for world in ("odd names", "no feature found", "a perfect tracker", "a light stage"):
        data = ReportData.of(make_run(**synthetic.DEGENERATE[world]))
        json.dumps([explored(data), looks.looks(data)], allow_nan=False)


def test_a_large_run_has_only_the_errors_that_it_is_about(
    make_run: Callable[..., RunFolder], synthetic: ModuleType
) -> None:
    data = ReportData.of(make_run(**synthetic.DEGENERATE["many conditions"]))
    found = explored(data)
    assert found["choices"]["trimming"] == [data.trimming]
    assert {one["population"] for one in found["errors"]} == {data.population}
    assert {one["lighting"] for one in found["errors"]} == set(data.lightings)
    assert {one["lighting"] for one in found["scenes"]} <= {data.view["lighting"]}


def test_fitted_points_have_no_curves_of_errors(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("one",), truth="triangulated", speeds=(1,), n_frames=12))
    assert explored(data)["errors"] == explored(data)["scenes"] == []
    assert [chart.id for chart in charts(data)] == ["survival"]


def test_tracks_have_the_end_the_truth_and_the_path_of_the_tables(run: RunFolder, data: ReportData) -> None:
    found = looks.looks(data)
    assert {group["scene"] for group in found["groups"]} == {"fixating", "forward"}
    for group in found["groups"][::3]:
        key = f"{group['scene']}@default"
        observed = run.sequence_table("observations", key).filter(tracker=group["tracker"], speed=1)
        ends = run.sequence_table("tracks", key).filter(tracker=group["tracker"], speed=1)
        kinds = [track["kind"] for track in group["tracks"]]
        assert kinds == sorted(kinds, key=KINDS.index)
        for track in group["tracks"]:
            own = observed.filter(track=track["track"]).sort("frame")
            now = own.filter(frame=track["frame"]).row(0, named=True)
            assert track["error"] == [now["du_px"], now["dv_px"]]
            assert track["truth"] == now["truth"].replace("_", " ")
            assert track["end"] == ends.filter(track=track["track"])["end"].cast(pl.String)[0].replace("_", " ")
            path = own.filter(pl.col("frame").is_between(track["anchor_frame"], track["frame"]))["du_px"].drop_nulls()
            assert track["path"]["du_px"] == pytest.approx(path.to_list(), rel=1e-2)


def test_ends_that_a_tracker_does_not_report_are_not_recorded(
    data: ReportData, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = type(data.run).rows

    def without_causes(self: RunFolder, name: str, key: str, *chosen: pl.Expr) -> pl.DataFrame:
        table = read(self, name, key, *chosen)
        causes = pl.when(pl.col("end") == "sequence_end").then("end") if name == "tracks" else None
        return table if causes is None else table.with_columns(causes.alias("end"))

    monkeypatch.setattr(type(data.run), "rows", without_causes)
    ends = {track["end"] for group in looks.looks(data)["groups"] for track in group["tracks"]}
    assert ends == {"sequence end", "not recorded"}


def test_pictures_of_further_scenes_are_left_out(data: ReportData, monkeypatch: pytest.MonkeyPatch) -> None:
    size = len(json.dumps(looks.looks(data)["groups"]))
    monkeypatch.setattr(looks, "MOST_BYTES", 0.7 * size)
    assert {group["scene"] for group in looks.looks(data)["groups"]} == {"fixating"}


def test_a_run_without_patches_has_none(data: ReportData) -> None:
    sequences = {
        key: dataclasses.replace(entry, sha256={name: one for name, one in entry.sha256.items() if name != "patches"})
        for key, entry in data.manifest.sequences.items()
    }
    without = dataclasses.replace(data, manifest=dataclasses.replace(data.manifest, sequences=sequences))
    assert looks.looks(without)["groups"] == []
