"""The numbers in the sentences, and in the specifications, are those of the tables they are about."""

import io
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.report.synthetic import DEGENERATE

from tracknoise.report.figures import distributions, error_curves, levels, track_ends
from tracknoise.report.figures import frames as example_frames
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import SPACE, number, percent, px


def _by_id(items: Any) -> dict[str, Any]:
    return {item.id: item for item in items}


def _datasets(figure: Figure) -> list[pl.DataFrame]:
    texts = [data for data in figure.spec["datasets"].values() if isinstance(data, str)]
    return [pl.read_csv(io.StringIO(text)) for text in texts]


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def test_curves_quote_the_summary(data: ReportData) -> None:
    figure = _by_id(error_curves.curve_figures(data))["error-by-age"]
    rows = data["summary"].filter(speed=1)
    assert rows["at"].n_unique() == 1
    assert f"At age {rows['at'][0]}, " in figure.look_for
    for row in rows.to_dicts():
        bias = f"{px(row['trimmed_nu_u_px'])} in u and {px(row['trimmed_nu_v_px'])} in v"
        spread = f"{px(row['trimmed_rms_u_px'])} in u and {px(row['trimmed_rms_v_px'])} in v"
        told = f"{row['tracker']} has a mean error of {bias}. Its RMS is {spread}."
        assert told in figure.look_for


def test_curves_draw_what_is_in_the_tables(data: ReportData) -> None:
    figure = _by_id(error_curves.curve_figures(data))["error-by-age"]
    drawn = pl.concat(
        _drawn
        for _drawn in _datasets(figure)
        if "about zero" in (_drawn.get_column("of").to_list() if "of" in _drawn.columns else [])
    )
    expected = data["curves"].filter(
        ~pl.col("cut"), tracker="lucas-kanade", speed=1, population="visible", trimming="trimmed",
        weighting="features", statistic="Phi",
    )  # fmt: skip
    shown = drawn.filter(tracker="lucas-kanade", of="about zero").sort("at")
    assert shown["at"].to_list() == expected["at"].to_list()
    np.testing.assert_allclose(shown["v"], np.sqrt(expected["v"]), rtol=1e-3)


def test_causes_of_ends_are_those_of_the_table(data: ReportData) -> None:
    (figure,) = track_ends.incidence_figures(data)
    rows = data["incidence"].filter(tracker="lucas-kanade", speed=1)
    last = (
        rows.filter(pl.col("lifetime") == pl.col("lifetime").max())
        .sort("incidence", descending=True)
        .row(0, named=True)
    )
    assert f"Of the tracks of lucas-kanade, {percent(last['incidence'])} are " in figure.look_for
    drawn = [table for table in _datasets(figure) if "incidence" in table.columns]
    for cause in ("lost", "masked"):
        shown = drawn[data.place("lucas-kanade")].filter(series=cause).sort("lifetime")
        np.testing.assert_allclose(shown["incidence"], rows.filter(cause=cause)["incidence"], rtol=1e-3)


def test_lifetimes_quote_the_summary(data: ReportData) -> None:
    figure = _by_id(track_ends.lifetime_figures(data))["lifetimes"]
    row = data.nominal(data["summary"]).filter(tracker="lucas-kanade").row(0, named=True)
    means = [number(row[name]) for name in ("restricted_mean_lifetime", "restricted_mean_until_failure")]
    assert (
        f"Mean restricted to {row['restricted_to']} frames: {means[0]} frames, or {means[1]} until failure."
        in figure.look_for
    )


def test_without_trimming_one_figure_shows_all_tracks(make_run: Callable[..., RunFolder]) -> None:
    items = _by_id(error_curves.curve_figures(ReportData.of(make_run(percentile=None))))
    assert isinstance(items["error-by-age-untrimmed"], Absence)
    assert items["error-by-age"].shows.startswith("Errors of all tracks")


def test_speeds_are_read_at_an_age_that_all_have(data: ReportData) -> None:
    figure = _by_id(levels.speed_figures(data))["error-by-speed-lucas-kanade"]
    age = int(re.match(r"At age (\d+), ", figure.look_for).group(1))
    assert age % 2 == 0
    for speed in (1, 2):
        where = {"tracker": "lucas-kanade", "speed": speed, "population": "visible", "trimming": "trimmed", "at": age}
        row = data.points.filter(**where, role="second").row(0, named=True)
        assert re.search(f"(?i)for speed {speed} (it )?is {px(row['u'])} in u and {px(row['v'])} in v", figure.look_for)


def test_speeds_that_share_no_age_are_read_at_the_nearest_to_ten(make_run: Callable[..., RunFolder]) -> None:
    (figure,) = levels.speed_figures(
        ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(7, 9), born=60))
    )
    assert figure.look_for.startswith(
        "At age 10 or the nearest available (7 for speed 7 and 9 for speed 9), the RMS for "
    )


def test_speeds_that_were_trimmed_at_different_errors_have_a_warning(
    make_run: Callable[..., RunFolder], data: ReportData
) -> None:
    figure = _by_id(levels.speed_figures(data))["error-by-speed-correspondence"]
    trims = data["trims"].filter(tracker="correspondence")
    cuts = [trims.filter(speed=speed)["threshold_px"].median() for speed in (1, 2)]
    assert f"trimming cuts at {px(cuts[0])} at speed 1 and {px(cuts[1])} at speed 2" in figure.look_for
    for untrimmed in levels.speed_figures(ReportData.of(make_run(percentile=None))):
        assert "trimming" not in untrimmed.look_for
        assert untrimmed.shows.startswith("Errors of")


def test_one_speed_leaves_nothing_to_compare(make_run: Callable[..., RunFolder]) -> None:
    (absence,) = levels.speed_figures(ReportData.of(make_run(speeds=(3,))))
    assert absence.why == "Only speed 3 was run, so there are no speeds to compare."


def test_lightings_are_compared_where_there_are_several(make_run: Callable[..., RunFolder], data: ReportData) -> None:
    assert levels.lighting_figures(data) == []
    several = ReportData.of(make_run(lightings=("led-1", "led-2"), scenes=("only",), born=40))
    assert [item.id for item in levels.lighting_figures(several)] == [
        f"error-by-lighting-{tracker}-speed-{speed}"
        for tracker in ("lucas-kanade", "correspondence")
        for speed in (1, 2)
    ]


def test_lifetimes_quote_counts_and_censoring(data: ReportData, run: RunFolder) -> None:
    figure = _by_id(track_ends.lifetime_figures(data))["lifetimes"]
    tracks = pl.concat(run.sequence_tables("tracks")).filter(tracker="correspondence", speed=1)
    censored = (tracks["end"] == "sequence_end").mean()
    told = f"correspondence has {tracks.height} tracks. Mean lifetime: {number(tracks['lifetime'].mean())} frames."
    assert told in figure.look_for
    assert f"Censored: {percent(censored)}." in figure.look_for


def test_the_lifetime_histogram_holds_every_track(data: ReportData, run: RunFolder) -> None:
    figure = _by_id(track_ends.lifetime_figures(data))["lifetimes"]
    (histogram,) = [table for table in _datasets(figure) if "n" in table.columns]
    assert histogram["n"].sum() == pl.concat(run.sequence_tables("tracks")).filter(speed=1).height
    assert histogram.filter(pl.col("n") == 0)["drawn"].is_between(0.5, 1, closed="left").all()


def test_survival_starts_with_everyone(data: ReportData) -> None:
    figure = _by_id(track_ends.lifetime_figures(data))["lifetimes"]
    (survival,) = [table for table in _datasets(figure) if "survival" in table.columns]
    assert survival.filter(lifetime=0)["survival"].to_list() == [1.0, 1.0]


def test_a_survival_that_never_reaches_a_half_says_so(make_run: Callable[..., RunFolder]) -> None:
    (figure, *_) = track_ends.lifetime_figures(ReportData.of(make_run(**DEGENERATE["everything censored"])))
    assert "Median lifetime: longer than the data (more than half are censored)." in figure.look_for
    assert f"Censored: 100.0{SPACE}%." in figure.look_for


def test_errors_quote_the_cut_and_single_sightings(data: ReportData, run: RunFolder) -> None:
    (figure,) = distributions.trimming_figures(data)
    tracks = pl.concat(run.sequence_tables("tracks")).filter(tracker="lucas-kanade", speed=1)
    once = tracks.filter(lifetime=1).height
    assert (
        f"lucas-kanade has {tracks.height} tracks. {once} of them were seen only in their first frame"
        in figure.look_for
    )
    cuts = data["trims"].filter(tracker="lucas-kanade", speed=1)["threshold_px"]
    assert f"The threshold is between {px(cuts.min())} and {px(cuts.max())}, depending on the scene." in figure.look_for
    kept = tracks.drop_nulls("max_error_px")["kept"]
    assert f"drops {percent(1 - kept.mean())} of the tracks with a known error" in figure.look_for


def test_error_histograms_hold_every_measured_track(data: ReportData, run: RunFolder) -> None:
    (figure,) = distributions.trimming_figures(data)
    drawn = sum(table["n"].sum() for table in _datasets(figure) if "low" in table.columns)
    assert drawn == pl.concat(run.sequence_tables("tracks"))["max_error_px"].count()


def test_nothing_trimmed_has_no_cut(make_run: Callable[..., RunFolder]) -> None:
    (figure,) = distributions.trimming_figures(ReportData.of(make_run(percentile=None)))
    assert "Nothing was trimmed in this run." in figure.shows
    assert "threshold" not in figure.look_for
    assert not any("cut" in table.columns and table.height for table in _datasets(figure))


def test_feature_counts_quote_where_half_are_left(data: ReportData, run: RunFolder) -> None:
    (figure,) = track_ends.feature_count_figures(data)
    lived = pl.concat(run.sequence_tables("tracks")).filter(tracker="lucas-kanade", speed=1)["lifetime"]
    half = max(age for age in range(20) if 2 * (lived > age).sum() >= lived.len())
    last = max(age for age in range(20) if (lived > age).sum() >= 40)
    told = f"lucas-kanade started {lived.len()} features. At least half reach age {half}."
    assert f"{told} 40 or more remain up to age {last}." in figure.look_for


def test_outlier_ratios_are_the_pooled_ones(data: ReportData, run: RunFolder) -> None:
    (figure,) = track_ends.outlier_ratio_figures(data)
    frames = pl.concat(run.sequence_tables("frames")).filter(tracker="correspondence", speed=2)
    share = percent(frames["outliers"].sum() / frames["offered"].sum())
    assert re.search(f"correspondence rejected .* and {share} \\(.*\\) at speed 2", figure.look_for)


def test_occlusion_compares_both_populations_at_one_age(data: ReportData) -> None:
    table = error_curves.compare(data)
    row = table.filter(tracker="lucas-kanade", speed=1, role="second").row(0, named=True)
    assert row["n_projected"] > row["n_visible"]
    (figure,) = error_curves.occlusion_figures(data)
    hidden = row["n_projected"] - row["n_visible"]
    assert f"lucas-kanade has {hidden} occluded feature" in figure.look_for
    assert f"{px(row['u_projected'])} with them and {px(row['u_visible'])} without" in figure.look_for


def test_error_lines_lead_towards_the_truth(data: ReportData, run: RunFolder) -> None:
    (figure, _) = example_frames.example_frame_figures(data)
    times = int(re.search(r"magnified (\d+) times", figure.shows).group(1))
    (drawn,) = [table for table in _datasets(figure) if "u_tip" in table.columns and table.height][:1]
    seen = run.sequence_table("observations", "fixating@default").filter(frame=10, speed=1, tracker="lucas-kanade")
    for row in drawn.to_dicts():
        truth = seen.filter(track=row["track"]).row(0, named=True)
        shortened = min(1.0, 16 / times / row["error"])
        for axis in "uv":
            expected = truth[f"{axis}_px"] + shortened * times * (truth[f"{axis}_true_px"] - truth[f"{axis}_px"])
            assert row[f"{axis}_tip"] == pytest.approx(expected, rel=1e-3, abs=0.02)


def test_example_frames_span_the_image_with_pixel_centres_at_integers(data: ReportData) -> None:
    (figure, _) = example_frames.example_frame_figures(data)
    (image,) = figure.spec["datasets"]["image"]
    assert [image[side] for side in ("left", "right", "top", "bottom")] == [-0.5, 159.5, -0.5, 119.5]
    background = figure.spec["concat"][0]["layer"][0]["encoding"]
    assert background["x"]["scale"]["domain"] == [-0.5, 159.5]
    assert background["y"]["scale"]["domain"] == [119.5, -0.5]


def test_trails_are_broken_between_tracks(data: ReportData) -> None:
    (figure, _) = example_frames.example_frame_figures(data)
    (trails,) = [table for table in _datasets(figure) if table.columns == ["place", "u", "v"]][:1]
    (drawn,) = [table for table in _datasets(figure) if "u_tip" in table.columns][:1]
    assert trails["u"].null_count() == drawn.height


@pytest.mark.parametrize(
    ("typical_px", "width", "factor"), [(0.4, 480, 20), (0.0, 480, 1), (100.0, 480, 1), (12.0, 480, 1)]
)
def test_magnification_is_a_round_number(typical_px: float, width: int, factor: int) -> None:
    assert example_frames.magnification(pl.Series([typical_px] * 4), width) == factor


def test_many_scenes_are_not_all_drawn(make_run: Callable[..., RunFolder]) -> None:
    names = tuple(f"scene-{i}" for i in range(8))
    items = example_frames.example_frame_figures(
        ReportData.of(make_run(scenes=names, trackers=("one",), speeds=(1,), n_frames=6))
    )
    assert len(items) == example_frames.MOST_SCENES + 1
    assert items[-1].why == "Only the first 6 of 8 scenes are drawn. The statistics below cover all scenes."
