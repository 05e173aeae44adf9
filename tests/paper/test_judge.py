"""Verdicts on claims, from tables whose answer is known: the sign decides, and what is not known is not judged."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import polars as pl
import pytest

from tracknoise.paper.claim_verdicts import Agreement, Claim, Judgement, cells, claims, judge
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import NAMES
from tracknoise.tables.store import RunFolder
from tracknoise.words import SPACE

LK, SIFT = "lucas-kanade", "correspondence"
WORLDS: dict[str, dict[str, Any]] = {
    "dtu": {"key_frame": 8, "lightings": ("diffuse", "LR0"), "truth": "scan"},
    "kitti": {},
    "gazebo-linear": {"views": ((0, "forward"), (0, "backward"))},
    "gazebo-arvr": {},
}
MakeData = Callable[..., ReportData]


@pytest.fixture
def made(make_run: Callable[..., RunFolder]) -> MakeData:
    """Data of a made-up run that repeats an experiment. Its intervals are a tenth of each value to either side."""
    return lambda name, **changes: ReportData.of(make_run(**{"paper": name, **WORLDS[name], **changes}))


def claim(experiment: str, name: str, tracker: str | None = None) -> Claim:
    found = [one for one in (*claims(), *cells()) if (one.experiment, one.id) == (experiment, name)]
    return next(one for one in found if tracker in (None, one.stated.get("tracker")))


def verdict(data: ReportData, name: str, tracker: str | None = None) -> Judgement:
    experiment = str(data.settings["paper"])
    return judge(claim(experiment, name, tracker), {experiment: data})


def changed(data: ReportData, table: str, where: pl.Expr, **columns: pl.Expr) -> ReportData:
    """The same data with other values in some rows of a table."""
    old: pl.DataFrame = data[table]
    new = {name: pl.when(where).then(value).otherwise(pl.col(name)).alias(name) for name, value in columns.items()}
    return data.with_tables(**{table: old.with_columns(*new.values()).cast(dict(old.schema))})


def scaled(data: ReportData, role: str, factor: float, where: pl.Expr | None = None) -> ReportData:
    """The same data with curves of a statistic, and their intervals, times a factor."""
    named = pl.col("statistic").is_in([names[role] for names in NAMES.values()])
    rows = named if where is None else named & where
    curves = changed(data, "curves", rows, u=pl.col("u") * factor, v=pl.col("v") * factor)
    ends = [pl.col("low") * factor, pl.col("high") * factor]
    bounds = {"value": pl.col("value") * factor, "low": pl.min_horizontal(ends), "high": pl.max_horizontal(ends)}
    return changed(curves, "intervals", rows, **bounds)


def paired(data: ReportData, **columns: object) -> ReportData:
    """The same data with other values in all paired comparisons of speeds."""
    known = {"unit": "ratio", "level_a": "1", "level_b": "2", "effect": 2.0, "low": 1.5, "high": 2.5, **columns}
    values = {name: pl.lit(value) for name, value in known.items()}
    return changed(data, "dependence", pl.col("factor") == "speed", **values)


@pytest.mark.parametrize("experiment", WORLDS)
def test_every_claim_of_an_experiment_can_be_judged(made: MakeData, experiment: str) -> None:
    data = made(experiment)
    for one in (*claims(), *cells()):
        found = judge(one, {experiment: data})
        if one.experiment != experiment:
            assert found == Judgement(Agreement.open, reason="the experiment was not repeated")
        assert found.value or found.reason


def test_a_change_in_the_other_direction_does_not_agree(made: MakeData) -> None:
    name = f"speed-absolute-{LK}"
    data = made("gazebo-linear")
    rising, falling = (paired(data, verdict="yes", larger=level) for level in ("2", "1"))
    assert verdict(rising, name).agreement is Agreement.agrees
    assert verdict(falling, name).agreement is Agreement.opposite
    assert verdict(falling, name).reason == "falls with speed"
    assert verdict(paired(data, verdict="no"), name).agreement is Agreement.disagrees
    undecided = verdict(paired(data, verdict="undecided", why="only 2 scenes"), name)
    assert (undecided.agreement, undecided.reason) == (Agreement.open, "only 2 scenes")


def test_a_cell_without_a_known_direction_says_so(made: MakeData) -> None:
    found = verdict(paired(made("kitti"), verdict="yes", larger="1"), f"speed-second-{LK}")
    assert found.agreement is Agreement.agrees
    assert found.reason == "falls with speed; the paper's direction is not on record"
    assert verdict(paired(made("kitti"), verdict="no"), f"speed-second-{SIFT}").agreement is Agreement.agrees


def test_factors_other_than_the_speed_have_no_direction(made: MakeData) -> None:
    known = {"verdict": "yes", "unit": "ratio", "level_a": LK, "level_b": SIFT, "larger": SIFT, "effect": 2.0}
    values = {name: pl.lit(value) for name, value in known.items()}
    found = verdict(changed(made("kitti"), "dependence", pl.lit(value=True), **values), "tracker-absolute")
    assert (found.agreement, found.reason) == (Agreement.agrees, "")


def test_what_a_run_does_not_vary_is_not_judged(made: MakeData) -> None:
    data = made("kitti", trackers=(LK,), speeds=(1,))
    assert verdict(data, "tracker-absolute").reason == "the run does not vary the tracker"
    assert verdict(data, f"speed-absolute-{LK}").reason == "the run does not vary the speed"
    assert verdict(data, "forward-correspondence").reason == f"no tracker of the kind {SIFT} was run"


def test_drift_has_a_sign(made: MakeData) -> None:
    data = made("gazebo-linear", bias_px=0.3)
    forward, backward = "drift-left-to-right", "drift-right-to-left"
    other = scaled(data, "mean", -1.0)
    for name, sign in ((forward, ""), (backward, "\N{MINUS SIGN}")):  # of what was made up: the paper's is the other
        assert verdict(data, name).agreement is Agreement.opposite
        assert verdict(other, name).agreement is Agreement.agrees
        assert verdict(data, name).value.startswith(f"u: {sign}3.")


def test_drift_is_judged_no_later_than_where_the_papers_curve_ends(made: MakeData) -> None:
    data = made("gazebo-linear", bias_px=0.3)
    asked = claim("gazebo-linear", "drift-right-to-left")
    early = dataclasses.replace(asked, stated={**asked.stated, "last_age": 3})
    assert judge(early, {"gazebo-linear": data}).value.endswith("at age 3")
    assert not verdict(data, "drift-right-to-left").value.endswith("at age 3")


def test_drift_that_is_slight_or_unknown_is_none(made: MakeData) -> None:
    data = made("gazebo-linear", bias_px=0.3)
    assert verdict(scaled(data, "mean", 1e-3), "drift-left-to-right").agreement is Agreement.disagrees
    wide = changed(data, "intervals", pl.lit(value=True), low=pl.lit(-1.0), high=pl.lit(1.0))
    assert verdict(wide, "drift-left-to-right").agreement is Agreement.open
    none = changed(data, "intervals", pl.lit(value=True), low=pl.lit(None), high=pl.lit(None))
    assert verdict(none, "drift-left-to-right").agreement is Agreement.open
    alone = made("gazebo-linear", views=((0, "forward"),))
    assert verdict(alone, "drift-right-to-left").reason == "not played backward"


def of_means(data: ReportData, u: tuple[float, float, float], v: tuple[float, float, float]) -> ReportData:
    """The same data with these mean errors and bounds at all ages, and a mean absolute error of 1 px."""
    for axis, (value, low, high) in {"u": u, "v": v}.items():
        rows = pl.col("statistic") == "nu"
        data = changed(data, "curves", rows, **{axis: pl.lit(value)})
        bounds = {"value": pl.lit(value), "low": pl.lit(low), "high": pl.lit(high)}
        data = changed(data, "intervals", rows & (pl.col("coordinate") == axis), **bounds)
    ones = {"u": pl.lit(1.0), "v": pl.lit(1.0)}
    return changed(data, "curves", pl.col("statistic") == "eta", **ones)


def test_a_drift_in_either_coordinate_allows_for_the_choice(made: MakeData) -> None:
    """The interval of one of two coordinates has 97.5 %: of 14 degrees of freedom it is 1.17 times as wide."""
    data = made("gazebo-arvr")
    barely, clearly = ((0.5, 0.03, 0.97), (0.5, 0.10, 0.90))
    none = (0.0, -0.3, 0.3)
    for pair in ((barely, none), (none, barely)):
        assert verdict(of_means(data, *pair), "drift").agreement is Agreement.open
    for pair in ((clearly, none), (none, clearly)):
        assert verdict(of_means(data, *pair), "drift").agreement is Agreement.agrees
    stated = {**claim("gazebo-arvr", "drift").stated, "coordinate": "u"}
    named = dataclasses.replace(claim("gazebo-arvr", "drift"), stated=stated)
    assert judge(named, {"gazebo-arvr": of_means(data, barely, none)}).agreement is Agreement.agrees


def test_there_is_no_drift_only_where_both_coordinates_are_small(made: MakeData) -> None:
    data, small, wide = made("gazebo-arvr"), (0.05, 0.02, 0.08), (0.01, -0.9, 0.92)
    assert verdict(of_means(data, small, small), "drift").agreement is Agreement.disagrees
    for pair in ((small, wide), (wide, small)):
        found = verdict(of_means(data, *pair), "drift")
        assert found.agreement is Agreement.open
        assert found.value.startswith("u: ")
        assert ", v: " in found.value


def test_trackers_that_drift_in_either_coordinate_allow_for_the_choice(made: MakeData) -> None:
    data, none = made("gazebo-arvr"), (0.0, -0.3, 0.3)
    for drift, agreement in (((0.5, 0.03, 0.97), Agreement.open), ((0.5, 0.10, 0.90), Agreement.agrees)):
        assert verdict(of_means(data, drift, none), "same-drift").agreement is agreement


def test_trackers_drift_alike_or_not(made: MakeData) -> None:
    data = made("gazebo-arvr", bias_px=0.3)
    of_sift = pl.col("tracker") == SIFT
    same = scaled(data, "mean", 0.0, of_sift)
    assert verdict(same, "same-drift").agreement is Agreement.open
    assert verdict(scaled(data, "mean", -1.0, of_sift), "same-drift").agreement is Agreement.opposite
    assert verdict(scaled(data, "mean", 5.0, of_sift), "same-drift").agreement is Agreement.disagrees


def test_the_error_at_higher_speeds_is_larger_or_smaller(made: MakeData) -> None:
    data = made("gazebo-linear")
    fast = pl.col("speed") == 2
    expected = {3.0: Agreement.agrees, 0.3: Agreement.opposite, 1.0: Agreement.open}
    for factor, agreement in expected.items():
        found = verdict(scaled(data, "absolute", factor, fast), "absolute-by-speed", LK)
        assert found.agreement is agreement
        assert found.value.endswith("px at speeds 1, 2")
        assert re.search(r"sizes are means of u and v at age \d+$", found.reason)


def test_one_step_from_the_key_frame_each_speed_has_its_own_place(made: MakeData) -> None:
    data = made("dtu", sigma_px=1.0, bias_px=0.0)
    known = data.nominal(data.points).filter(role="absolute", trimming="trimmed", tracker=SIFT, since=1)
    known = known.filter(population=data.population)
    found = verdict(data, "absolute-by-speed")
    (row,) = known.to_dicts()
    assert found.value.startswith(f"{(row['u'] + row['v']) / 2:.3g}")


def test_curves_end_where_the_paper_says_only_with_as_many_scenes(made: MakeData) -> None:
    few = made("gazebo-linear")
    assert verdict(few, "cut").agreement is Agreement.open
    assert verdict(few, "cut").reason == "2 of the paper's 11 scenes"
    ends = claim("gazebo-linear", "cut")
    ages = dict.fromkeys((LK, SIFT), 0) | {
        kind: few.nominal(few.points).filter(tracker=kind, role="mean", trimming="trimmed")["since"].max()
        for kind in (LK, SIFT)
    }
    for factor, agreement in {1.0: Agreement.agrees, 0.5: Agreement.disagrees, 4.0: Agreement.open}.items():
        stated = {"scenes": 2, "ages": {kind: age * factor for kind, age in ages.items()}}
        found = judge(dataclasses.replace(ends, stated=stated), {"gazebo-linear": few})
        assert found.agreement is agreement
    assert found.reason == "sequences of 20 frames have no such ages"  # a shorter sequence is no shorter curve
    swapped = {"scenes": 2, "ages": {LK: ages[SIFT], SIFT: ages[LK]}}
    found = judge(dataclasses.replace(ends, stated=swapped), {"gazebo-linear": few})
    assert found.agreement is Agreement.opposite


def test_outlier_ratios_have_the_papers_level_at_every_speed(made: MakeData) -> None:
    data, everywhere = made("gazebo-linear"), pl.lit(value=True)
    ratio = pl.col("statistic") == "outlier_ratio"

    def at(level: float, low: float, high: float) -> Judgement:
        found = changed(data, "outliers", everywhere, pooled_ratio=pl.lit(level))
        found = changed(found, "intervals", ratio, low=pl.lit(low), high=pl.lit(high))
        return verdict(found, "outlier-level")

    assert at(0.42, 0.3, 0.5).agreement is Agreement.agrees
    assert at(0.2, 0.1, 0.3).agreement is Agreement.disagrees
    assert at(0.2, 0.1, 0.3).reason.replace(SPACE, " ") == "outside 35.0 % to 45.0 % at speeds 1 and 2"
    assert at(0.5, 0.4, 0.6).agreement is Agreement.open


def test_zero_mean_and_gaussian_must_both_hold(made: MakeData) -> None:
    data, everywhere = made("kitti"), pl.lit(value=True)

    def judged(mean: str, shape: str, size: float = 1.0) -> tuple[Agreement, Agreement]:
        found = changed(scaled(data, "mean", size), "zero_mean", everywhere, verdict=pl.lit(mean))
        found = changed(found, "gaussianity", everywhere, verdict=pl.lit(shape))
        return verdict(found, "forward-correspondence").agreement, verdict(found, "abstract-errors").agreement

    assert judged("undecided", "Gaussian", size=0.001) == (Agreement.agrees, Agreement.disagrees)
    assert judged("yes", "Gaussian", size=0.001) == (Agreement.disagrees, Agreement.agrees)
    assert judged("undecided", "heavy-tailed", size=0.001) == (Agreement.disagrees, Agreement.agrees)
    assert judged("undecided", "Gaussian", size=10.0) == (Agreement.open, Agreement.open)
    assert judged("undecided", "undecided", size=0.001) == (Agreement.open, Agreement.open)


def test_a_mean_is_not_zero_because_the_strongest_evidence_is_of_a_small_one(made: MakeData) -> None:
    everywhere = pl.lit(value=True)
    old = pl.col("at") > 1
    data = scaled(scaled(made("kitti"), "mean", 0.001), "mean", 10000.0, old)
    data = changed(data, "zero_mean", everywhere, verdict=pl.lit("undecided"), share_of_second=pl.lit(1e-6))
    data = changed(data, "gaussianity", everywhere, verdict=pl.lit("Gaussian"))
    assert verdict(data, "forward-correspondence").agreement is Agreement.open


def test_two_motions_are_compared_where_both_were_measured(made: MakeData) -> None:
    one, other = made("gazebo-linear", views=((0, "forward"),)), made("gazebo-arvr")
    motion = claim("gazebo-linear", "abstract-motion")
    assert judge(motion, {"gazebo-linear": one}).reason == "gazebo-arvr was not measured"
    larger = scaled(other, "second", 9.0)
    assert judge(motion, {"gazebo-linear": one, "gazebo-arvr": larger}).agreement is Agreement.agrees
    alike = judge(motion, {"gazebo-linear": one, "gazebo-arvr": one})
    assert (alike.agreement, alike.reason) == (Agreement.open, "intervals overlap or are unknown")


def test_a_bound_on_an_effect(made: MakeData) -> None:
    data, everywhere = made("dtu"), pl.lit(value=True)
    small, large = (changed(data, "effects", everywhere, effect=pl.lit(effect)) for effect in (0.05, 0.2))
    assert verdict(small, "lighting-margin").agreement is Agreement.agrees
    assert verdict(large, "lighting-margin").agreement is Agreement.disagrees
    assert verdict(made("dtu", lightings=("diffuse",)), "lighting-margin").agreement is Agreement.open
