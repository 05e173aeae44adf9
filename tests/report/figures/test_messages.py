"""Titles that state what a figure shows: short, true to the tables, and none where nothing is established."""

import re
from collections.abc import Callable

import polars as pl
import pytest
from tests.report import made_up_findings
from tests.report.synthetic import DEGENERATE

from tracknoise.report.figures import error_curves, frames, growth_curves, levels, noise_models, track_ends
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.messages import MOST_NUMBERS, MOST_WORDS
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.store import RunFolder
from tracknoise.topics.growth_topic import growth_message
from tracknoise.words import percent, px, ratio

NAMES = ("a light stage", "a perfect tracker", "no depth", "no feature found", "turned, and played backward")
WORLDS: dict[str, dict[str, object]] = {"ordinary": {}, **{name: DEGENERATE[name] for name in NAMES}}


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def drawn(data: ReportData) -> list[Figure]:
    return [item for family in FAMILIES for item in family.figures(data) if isinstance(item, Figure)]


def judged(data: ReportData, verdict: str) -> ReportData:
    """The run, of which every paired comparison has a verdict."""
    return data.with_tables(dependence=made_up_findings.dependence(data["effects"], verdict=verdict, n_scenes=8))


def with_verdict(data: ReportData, verdict: str, grows: str = "yes") -> ReportData:
    """The run, of which every fit of growth has these verdicts."""
    kinds = data["time_structure"].schema
    fits = data["time_structure"].with_columns(
        verdict=pl.lit(verdict, dtype=kinds["verdict"]), grows=pl.lit(grows, dtype=kinds["grows"])
    )
    return data.with_tables(time_structure=fits)


def message(items: object, id: str) -> str:
    return next(item.message for item in items if item.id == id)  # type: ignore[attr-defined]


@pytest.mark.parametrize("world", WORLDS)
def test_messages_are_short(world: str, make_run: Callable[..., RunFolder]) -> None:
    data = judged(ReportData.of(make_run(**WORLDS[world])), "yes")
    names = [*data.trackers, *data.speeds, *(entry.sequence.scene for entry in data.manifest.sequences.values())]
    for figure in drawn(data):
        text = figure.message
        for name in names:
            text = text.replace(f"{name} ", "").removesuffix(str(name)) if isinstance(name, str) else text
        assert len(text.split()) <= MOST_WORDS, figure.message
        assert len(re.findall(r"\d[\d.,]*", text)) <= MOST_NUMBERS, figure.message
        assert not text.endswith("."), figure.message


def test_most_figures_of_an_ordinary_run_have_a_message(data: ReportData) -> None:
    figures = drawn(judged(data, "yes"))
    without = [figure.id for figure in figures if not figure.message]
    assert len(without) < len(figures) / 2, without


def test_growth_is_stated_only_where_it_is_established(data: ReportData) -> None:
    for verdict in ("random walk", "undecided"):
        grown = with_verdict(data, verdict)
        assert growth_message(grown).endswith(" becomes 1.50 times as large by age 10")
        assert message(error_curves.curve_figures(grown), "error-by-age") == growth_message(grown)
    for grows in ("no", "undecided"):
        assert growth_message(with_verdict(data, "white", grows)) == ""
    level = growth_curves.time_structure_figures(with_verdict(data, "white", "no"))
    assert message(level, "time-structure").endswith("is constant")
    assert message(growth_curves.time_structure_figures(with_verdict(data, "undecided")), "time-structure") == ""


def test_factors_are_stated_only_with_a_decided_verdict(data: ReportData) -> None:
    texts = {
        verdict: [item.message for item in levels.speed_figures(judged(data, verdict)) if isinstance(item, Figure)]
        for verdict in ("yes", "no", "undecided")
    }
    assert all("depends on speed; the clearest difference is 1.50\xa0times" in text for text in texts["yes"])
    assert all("depends on speed by less than" in text for text in texts["no"])
    assert set(texts["undecided"]) == {""}


def test_trackers_are_compared_by_the_paired_comparison(data: ReportData) -> None:
    found = judged(data, "yes")
    row = found["dependence"].filter(factor="tracker", statistic="lifetime", speed=data.slowest).row(0, named=True)
    text = message(track_ends.lifetime_figures(found), "lifetimes")
    assert text.startswith(f"Tracks of {row['larger']} live {ratio(row['effect'])} times as long as those of ")
    assert message(track_ends.lifetime_figures(judged(data, "undecided")), "lifetimes").startswith("Median lifetime: ")


def test_values_are_those_of_the_tables(data: ReportData) -> None:
    shares = data.nominal(data["outliers"]).select("tracker", "pooled_ratio")
    parts = [f"{percent(dict(shares.iter_rows())[name])} for {name}" for name in data.trackers]
    assert (
        message(track_ends.outlier_ratio_figures(data), "outlier-ratio") == f"Rejected features: {' and '.join(parts)}"
    )
    points = data.nominal(data.points).filter(
        role="second", population=data.population, tracker=data.trackers[0], since=REFERENCE_AGE
    )
    rows = {row["trimming"]: row for row in points.to_dicts()}
    ends = f"from {px(rows['untrimmed']['u'])} to {px(rows['trimmed']['u'])}"
    lies_apart = rows["untrimmed"]["u_low"] > rows["trimmed"]["u_high"]
    other = next(name for name in rows if name != data.trimming)
    assert message(error_curves.curve_figures(data), f"error-by-age-{other}").endswith(ends) == lies_apart


def test_the_sigma_to_set_is_stated_only_where_residuals_are_shown_to_mislead(data: ReportData) -> None:
    def with_low(low: float | None) -> ReportData:
        lows = pl.when(quantity="core_overconfidence").then(low).otherwise("low")
        return data.with_tables(window_sigmas=data["window_sigmas"].with_columns(low=lows))

    row = data.nominal(data["window_sigmas"]).filter(
        quantity="core_overconfidence", window=15, tracker=data.trackers[0]
    )
    times = ratio(row["value"][0])
    text = message(noise_models.window_sigma_figures(with_low(1.01)), "window-sigmas")
    assert text == f"In windows of 15 frames, depths need {times} times the residual core of {data.trackers[0]}"
    for low in (0.99, None):
        assert message(noise_models.window_sigma_figures(with_low(low)), "window-sigmas") == ""


def test_second_moments_in_u_and_v_are_compared_where_intervals_lie_apart(data: ReportData) -> None:
    def with_factor(factor: float) -> ReportData:
        """The run with other second moments in u."""
        own = (pl.col("statistic") == "Phi") & (pl.col("coordinate") == "u")
        bounds = [pl.when(own).then(pl.col(name) * factor).otherwise(name) for name in ("value", "low", "high")]
        u = pl.when(statistic="Phi").then(pl.col("u") * factor).otherwise("u")
        curves = data["curves"].with_columns(u=u)
        return data.with_tables(curves=curves, intervals=data["intervals"].with_columns(bounds))

    id = "second-moment-by-age"
    assert "times as large in u as in v" in message(error_curves.second_moment_figures(with_factor(100.0)), id)
    assert "times as large in v as in u" in message(error_curves.second_moment_figures(with_factor(0.01)), id)
    at = {"role": "second", "since": REFERENCE_AGE, "trimming": data.trimming, "population": data.population}
    first = data.nominal(data.points).filter(tracker=data.trackers[0], **at).row(0, named=True)
    equal = with_factor((first["v"] / first["u"]) ** 2)
    assert f"of {data.trackers[0]} is" not in message(error_curves.second_moment_figures(equal), id)


def test_the_light_stage_says_how_many_lightings_it_shows(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(**WORLDS["a light stage"]))
    (figure,) = frames.light_stage_figures(data)
    assert isinstance(figure, Figure)
    shown = sum(name.startswith("image_") for name in figure.spec["datasets"])
    assert figure.message.endswith(f" under {shown} of {len(data.lightings)} lightings")
