from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.curve_intervals import interval_table
from tracknoise.exceptions import SettingsError
from tracknoise.inference.survival import restricted_mean
from tracknoise.statistics.curves import curves
from tracknoise.statistics.lifetimes import RESTRICTED, count_ends, lifetimes_of_ends, mean_lifetime, median_survival
from tracknoise.statistics.moments import block_moments, scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.track_counts import outlier_ratios
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.schema import ASPECT, FRAME_COUNTS, OBSERVATIONS, TRACKS, Schema

SCENES = tuple(f"s{number}" for number in range(8))
VIEW = {"dataset": "d", "lighting": "nominal", "rotation": 0, "direction": "forward", "camera": ""}
POINT = ["lighting", "tracker", "speed", "trimming", "weighting", "statistic", "axis", "at"]
Tables = dict[str, pl.DataFrame]


def _typed(columns: dict[str, object], schema: Schema) -> pl.DataFrame:
    table = pl.DataFrame(columns)
    missing = [pl.lit(None).alias(name) for name in schema if name not in columns]
    return table.with_columns(missing).select(pl.col(name).cast(kind) for name, kind in schema.items())


def _scene(rng: np.random.Generator, scene: str, tracker: str, n_tracks: int) -> tuple[pl.DataFrame, ...]:
    """Tracks of one scene and condition, whose errors walk at random: tracks, observations and frames."""
    origin = VIEW | {"scene": scene, "tracker": tracker, "speed": 1}
    life = rng.geometric(0.2, n_tracks).clip(max=12)
    track = np.repeat(np.arange(n_tracks), life)
    age = np.concatenate([np.arange(length) for length in life])
    steps = np.where(age > 0, rng.normal(0.05 + 0.1 * rng.normal(), 0.3, size=(2, len(age))), 0.0)
    walk = steps.cumsum(axis=1)
    starts = walk[:, np.flatnonzero(age == 0)]
    error = walk - np.repeat(starts, life, axis=1)
    kept = rng.random(n_tracks) < 0.8
    tracks = {"track": np.arange(n_tracks), "first_frame": 0, "lifetime": life, "kept": kept}
    tracks |= {
        "end": np.where(life == 12, "sequence_end", np.array(["lost", "outlier", "masked"])[np.arange(n_tracks) % 3])
    }
    seen = {"track": track, "frame": age, "age": age, "kept": kept[track], "truth": "valid"}
    seen |= {"du_px": error[0], "dv_px": error[1], **dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), 0.0)}
    offered = np.append(0, rng.integers(20, 40, 12))
    counts = {"frame": np.arange(13), "offered": offered, "outliers": rng.binomial(offered, 0.1)}
    counts |= dict.fromkeys(("matched", "new", "alive"), 0)
    return _typed(origin | tracks, TRACKS), _typed(origin | seen, OBSERVATIONS), _typed(origin | counts, FRAME_COUNTS)


@cache
def _tables(n_scenes: int) -> Tables:
    """What a run has of scenes of two trackers, the second of which lacks a scene."""
    rng = np.random.default_rng(n_scenes)
    parts = [
        _scene(rng, f"s{number}", tracker, int(rng.integers(30, 60)))
        for tracker in ("a", "b")
        for number in range(n_scenes - (tracker == "b"))
    ]
    tracks, observations, frames = (pl.concat(tables) for tables in zip(*parts, strict=True))
    return {
        "tracks": tracks,
        "moments": scene_moments(prepare_observations(observations)),
        "blocks": block_moments(replace(prepare_sequence(observations, tracks), populations=("visible", "projected"))),
        "ends": count_ends(tracks),
        "frames": frames,
    }


def found_in(tables: Tables, **options: object) -> pl.DataFrame:
    chosen = {"blocks": tables["blocks"], "n_draws": 200} | options
    return interval_table(tables["moments"], tables["ends"], tables["frames"], **chosen)


def of_curves(found: pl.DataFrame) -> pl.DataFrame:
    return found.filter(pl.col("axis") == "age")


@pytest.mark.parametrize("n_scenes", [3, 8])
def test_values_are_those_of_the_curves(n_scenes):
    tables = _tables(n_scenes)
    points = curves(tables["moments"]).filter(population="visible")
    expected = points.unpivot(["u", "v", "uv"], index=[*POINT, "n_scenes"], variable_name="coordinate")
    expected = expected.filter(~(pl.col("statistic").is_in(["nu", "eta"]) & (pl.col("coordinate") == "uv")))
    expected = expected.with_columns(pl.col("axis").cast(pl.String), pl.col("at").cast(pl.Int64))
    found = of_curves(found_in(tables)).filter(pl.col("weighting") != "geometric")
    assert found.height == expected.height
    both = found.join(expected, on=[*POINT, "coordinate"], suffix="_curve", validate="1:1")
    assert both.height == found.height
    assert both["value"].is_null().equals(both["value_curve"].is_null())
    np.testing.assert_allclose(both["value"].to_numpy(), both["value_curve"].to_numpy(), rtol=1e-9, atol=1e-14)
    assert both["n_scenes"].equals(both["n_scenes_curve"])


@pytest.mark.parametrize("n_scenes", [3, 8])
def test_lifetimes_and_outlier_ratio_are_those_of_the_summary(n_scenes):
    tables, keys = _tables(n_scenes), ["tracker"]
    lived = lifetimes_of_ends(tables["ends"])
    values = {
        "mean_lifetime": mean_lifetime(lived).select(*keys, value="mean_lifetime"),
        "median_lifetime": median_survival(lived).select(*keys, value=pl.col("median_lifetime").cast(pl.Float64)),
        "median_until_failure": median_survival(lived).select(*keys, value=pl.col("median_until_failure").cast(float)),
        **{name: mean_lifetime(lived).select(*keys, value=name) for name in RESTRICTED},
        "outlier_ratio": outlier_ratios(tables["frames"]).select(*keys, value="pooled_ratio"),
    }
    found = found_in(tables)
    for statistic, expected in values.items():
        one = found.filter(statistic=statistic)
        assert one["value"].to_list() == pytest.approx(expected.sort(keys)["value"].to_list())
        assert (one["low"] <= one["value"]).all()
        assert (one["value"] <= one["high"]).all()
    for curve in ("survival", "survival_until_failure"):
        rows = found.filter(statistic=curve)
        assert rows["at"].to_list() == lived["lifetime"].to_list()
        assert rows["value"].to_list() == pytest.approx(lived[curve].to_list(), nan_ok=True)


def test_scenes_differ_in_restricted_means_by_the_spread_of_their_logarithms():
    ends = _tables(8)["ends"].filter(tracker="a")
    row = found_in(_tables(8)).filter(statistic="restricted_mean_lifetime", tracker="a").row(0, named=True)
    to = float(lifetimes_of_ends(_tables(8)["ends"])["followed_to"].min())
    logs = [
        np.log(mean_until(own, to))
        for own in ends.group_by("scene", "lifetime").agg(pl.col("n_ended", "n_censored").sum()).partition_by("scene")
    ]
    assert row["spread"] == pytest.approx(np.std(logs, ddof=1))


def mean_until(ends: pl.DataFrame, horizon: float) -> float:
    """Restricted mean of one scene."""
    ordered = ends.sort("lifetime")
    counts = (ordered[name].to_numpy() for name in ("n_ended", "n_censored"))
    return float(restricted_mean(*counts, horizon, lifetimes=ordered["lifetime"].to_numpy()))


def test_quartiles_are_where_survival_is_down_to_a_quarter_and_its_bounds_with_it():
    found = found_in(_tables(8)).filter(tracker="a")
    curve = found.filter(statistic="survival")
    for name, share in {"lower_quartile_lifetime": 0.75, "upper_quartile_lifetime": 0.25}.items():
        row = found.row(by_predicate=pl.col("statistic") == name, named=True)
        for bound in ("value", "low", "high"):
            assert row[bound] == curve.filter(pl.col(bound) <= share)["at"].min()


def test_enough_scenes_are_resampled_and_too_few_are_not():
    assert found_in(_tables(8))["resampled"].unique().to_list() == ["scenes"]
    found = found_in(_tables(6))  # of which the second tracker lacks one
    assert found.filter(tracker="a")["resampled"].unique().to_list() == ["scenes"]
    assert found.filter(tracker="b")["resampled"].unique().to_list() == ["blocks"]
    assert found.filter(tracker="b", statistic="mean_lifetime").select("n_units", "n_scenes").row(0) == (80, 5)


@pytest.mark.parametrize("kind", ["student", "percentile", "bca"])
def test_most_points_have_bounds_and_these_hold_the_value(kind):
    for n_scenes in (3, 8):
        found = of_curves(found_in(_tables(n_scenes), kind=kind)).filter(pl.col("at").is_between(1, 6))
        bounded = found.drop_nulls(["low", "high"])
        assert bounded.height > 0.95 * found.height
        assert (bounded["low"] < bounded["high"]).all()
        assert bounded["value"].is_between(bounded["low"], bounded["high"]).mean() > 0.99


def test_errors_that_are_zero_by_construction_have_no_width():
    born = of_curves(found_in(_tables(8))).filter(at=0)
    assert (born["low"] == 0).all()
    assert (born["high"] == 0).all()


def test_points_of_fewer_than_six_scenes_have_no_bounds():
    tables = _tables(8)
    late = tables["moments"].filter((pl.col("at") < 3) | pl.col("scene").is_in(["s0", "s1"]))
    found = of_curves(found_in(tables | {"moments": late}))
    assert found.filter(pl.col("at") < 3)["low"].null_count() == 0
    assert found.filter(pl.col("at") >= 3)["low"].null_count() == found.filter(pl.col("at") >= 3).height
    assert found.filter(pl.col("at") >= 3)["n_scenes"].max() == 2


def test_without_blocks_the_errors_of_few_scenes_have_no_bounds():
    found = found_in(_tables(3), blocks=())
    assert of_curves(found)["low"].null_count() == of_curves(found).height
    assert of_curves(found)["resampled"].null_count() == of_curves(found).height
    assert found.filter(statistic="outlier_ratio")["low"].null_count() == 0


def test_errors_of_few_scenes_have_bounds_by_blocks_of_the_same_population():
    found = of_curves(found_in(_tables(3), population="projected"))
    assert found["population"].unique().to_list() == ["projected"]
    assert set(found.filter(pl.col("low").is_not_null())["resampled"]) == {"blocks"}
    visible = _tables(3)["blocks"].filter(population="visible")
    of_others = of_curves(found_in(_tables(3) | {"blocks": visible}, population="projected"))
    assert of_others["low"].null_count() == of_others.height


def test_the_order_of_rows_changes_nothing():
    tables = _tables(8)
    expected = found_in(tables)
    shuffled = {name: table.sample(fraction=1.0, shuffle=True, seed=4) for name, table in tables.items()}
    assert found_in(shuffled).equals(expected)


def test_the_seed_of_the_bootstrap_decides_bounds_but_no_value():
    first, again, other = (found_in(_tables(8), kind="bca", seed=seed) for seed in (0, 0, 1))
    assert first.equals(again)
    assert not other.equals(first)
    assert other["value"].equals(first["value"])


def test_conditions_share_their_draws():
    tables = _tables(8)
    twins = [
        pl.concat([tables[name].filter(tracker=tracker).with_columns(tracker=pl.lit(called)) for called in ("x", "y")])
        for name, tracker in (("moments", "a"), ("ends", "a"), ("frames", "a"))
    ]
    found = interval_table(*twins, n_draws=200, kind="bca")
    one, other = (found.filter(tracker=called).drop("tracker") for called in ("x", "y"))
    assert one.equals(other)


def of_aspect(moments: pl.DataFrame, aspect: Aspect) -> pl.DataFrame:
    labels = pl.lit(aspect, dtype=ASPECT).alias("aspect"), pl.lit(None, dtype=pl.UInt32).alias("at_least")
    return moments.select(*labels, pl.all())


def test_aspects_stand_beside_all_errors():
    tables = _tables(8)
    visible = tables["moments"].filter(population="visible", trimming="untrimmed")
    aspects = of_aspect(visible, Aspect.motion)
    found = found_in(tables, aspects=aspects)
    motion = found.filter(aspect="motion")
    alone = of_curves(found.filter(aspect="all", trimming="untrimmed"))
    assert motion.drop("aspect").equals(alone.drop("aspect"))


def test_along_the_gradient_which_has_no_sign_there_is_no_mean():
    tables = _tables(8)
    visible = tables["moments"].filter(population="visible")
    found = found_in(tables, aspects=of_aspect(visible, Aspect.gradient))
    assert set(found.filter(aspect="gradient")["statistic"]) == {"eta", "Phi"}


def test_a_wider_level_and_the_other_kind_are_said():
    tables = _tables(8)
    narrow, wide = (found_in(tables, level=level, kind="percentile") for level in (0.5, 0.99))
    assert wide["kind"].unique().to_list() == ["percentile"]
    assert wide["level"].unique().to_list() == [0.99]
    both = narrow.join(wide, on=["tracker", *POINT[3:], "coordinate"], suffix="_wide", nulls_equal=True)
    both = both.drop_nulls(["low", "low_wide"]).filter(pl.col("low") < pl.col("high"))
    assert (both["low_wide"] <= both["low"]).all()
    assert (both["high_wide"] >= both["high"]).all()


def test_kinds_agree_where_scenes_are_many_and_alike():
    found = {kind: of_curves(found_in(_tables(8), kind=kind)).filter(at=3) for kind in ("student", "percentile")}
    width = {kind: (table["high"] - table["low"]).to_numpy() for kind, table in found.items()}
    assert 0.8 < np.median(width["student"] / width["percentile"]) < 1.25


def test_bounds_stay_where_values_can_be():
    found = found_in(_tables(3)).drop_nulls("low")
    never_negative = found.filter(~pl.col("statistic").is_in(["nu"]) & (pl.col("coordinate") != "uv").fill_null(True))
    assert (never_negative["low"] >= 0).all()
    assert (found.filter(unit="share")["high"] <= 1).all()


@pytest.mark.parametrize("options", [{"kind": "normal"}, {"level": 95}])
def test_a_kind_or_level_that_is_none_is_refused(options):
    with pytest.raises(SettingsError, match=next(iter(options))):
        found_in(_tables(3), **options)


def test_nothing_in_nothing_out():
    tables = {name: table.clear() for name, table in _tables(3).items()}
    assert found_in(tables).is_empty()


def test_the_next_scene_may_have_no_outliers_where_some_scenes_have_none():
    tables = _tables(8)
    none = {
        scenes: pl.when(pl.col("scene").is_in(scenes)).then(0).otherwise("outliers")
        for scenes in (("s0",), SCENES[:5], SCENES)
    }
    some, most, all_of_them = (
        found_in(tables | {"frames": tables["frames"].with_columns(outliers=without)}).filter(statistic="outlier_ratio")
        for without in none.values()
    )
    assert some["next_low"].to_list() == [0.0, 0.0]
    assert (some["next_high"] > some["value"]).all()
    assert all_of_them["value"].to_list() == [0.0, 0.0]
    for name in ("spread", "next_low", "next_high"):
        assert most[name].null_count() == all_of_them[name].null_count() == 2


def test_the_next_scene_is_nowhere_more_certain_than_the_mean():
    found = found_in(_tables(8)).drop_nulls(["low", "high", "next_low", "next_high"])
    assert found.height
    assert (found["next_low"] <= found["low"]).all()
    assert (found["next_high"] >= found["high"]).all()
