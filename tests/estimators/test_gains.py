import numpy as np
import polars as pl
import pytest
from benchmarks.noise.cells import noise_table_sentences
from benchmarks.noise.noise_table import NoiseTable
from tests.estimators.models import TRUSTED

from tracknoise.estimators.lookup_table import NOISE_LOOKUP, noise_lookup, scene_sums
from tracknoise.inference.units import NO_GROUPS, Resampled, SceneGroups
from tracknoise.tables.enumerations import Lookup, Product
from tracknoise.tables.schema import NOISE_SUMS
from tracknoise.topics.lookup_topic import lookup_sentences

N = 400
COVARIANCE = np.array([[1.0, 0.3], [0.3, 0.5]])


def sums(sizes: dict[tuple[str, str, int], float], *, rotation: int = 0, seed: int = 0) -> pl.DataFrame:
    """Sums of N errors at two ages by scene, tracker and speed, of the covariance times a size."""
    rng = np.random.default_rng(seed)
    rows = []
    for (scene, tracker, speed), size in sizes.items():
        for product in (Product.error, Product.change, Product.lagged):
            for age in (speed, 2 * speed):
                errors = rng.multivariate_normal([0.0, 0.0], size * COVARIANCE, N)
                uu, uv, vv = (float(one) for one in (errors.T @ errors)[[0, 0, 1], [0, 1, 1]])
                view = {"lighting": "", "rotation": rotation, "direction": "forward", "camera": ""}
                key = {"dataset": "made", "scene": scene, **view, "tracker": tracker, "speed": speed}
                rows.append({**key, "block": 0, "product": product, "age": age, "n": N, "uu": uu, "uv": uv, "vv": vv})
    return pl.DataFrame([{**dict.fromkeys(NOISE_SUMS), **row} for row in rows], schema=dict(NOISE_SUMS))


def motions(count: int, each: int) -> SceneGroups:
    return SceneGroups({("made", f"{place}"): f"motion {place % count}" for place in range(count * each)})


def by_motion(count: int, each: int, factor: float) -> dict[tuple[str, str, int], float]:
    """Sizes of two trackers: each motion has errors that are larger by a factor, and matching has 4 times them."""
    trackers = {"lk": 1.0, "matching": 4.0}
    places = range(count * each)
    return {(f"{p}", name, 1): own * factor ** (p % count) for p in places for name, own in trackers.items()}


def row(table: pl.DataFrame, lookup: Lookup, against: Lookup, product: Product = Product.error) -> dict[str, object]:
    return table.filter(product=product, lookup=lookup, against=against).row(0, named=True)


def test_the_gain_is_the_difference_of_gaussian_likelihoods_of_left_out_scenes():
    sizes = {(f"{p}", name, 1): own for p, _ in enumerate("abcdef") for name, own in (("lk", 1.0), ("m", 3.0))}
    made = sums(sizes)
    found = row(noise_lookup([made]), Lookup.tracker, Lookup.one)
    errors = made.filter(product=Product.error)

    def likelihood(one: dict[str, object], others: pl.DataFrame) -> float:
        total = others.select(pl.col("n", "uu", "uv", "vv").sum()).row(0, named=True)
        covariance = np.array([[total["uu"], total["uv"]], [total["uv"], total["vv"]]]) / total["n"]
        own = np.array([[one["uu"], one["uv"]], [one["uv"], one["vv"]]])
        return -0.5 * (one["n"] * np.linalg.slogdet(covariance)[1] + np.trace(np.linalg.solve(covariance, own)))

    gain = 0.0
    for one in errors.to_dicts():
        others = errors.filter(pl.col("scene") != one["scene"], age=one["age"])
        gain += likelihood(one, others.filter(tracker=one["tracker"])) - likelihood(one, others)
    assert found["gain_nats"] == pytest.approx(gain / (N * errors.height), rel=1e-9)
    assert found["n"] == N * errors.height
    assert found["established"]


def test_the_factor_is_how_far_second_moments_of_left_out_scenes_are_off():
    sizes = {(f"{p}", name, 1): own for p in range(8) for name, own in (("lk", 1.0), ("m", 3.0))}
    found = row(noise_lookup([sums(sizes)]), Lookup.tracker, Lookup.one)
    assert found["factor"] == pytest.approx(1.0, abs=0.1)
    assert found["factor_against"] == pytest.approx(np.sqrt(2.0 * 1.5), abs=0.1)
    assert found["factor_against_low"] < found["factor_against"] < found["factor_against_high"]


@pytest.mark.parametrize(
    ("count", "each", "units", "resampled"), [(10, 2, 10, Resampled.groups), (5, 4, 20, Resampled.within)]
)
def test_motion_gains_where_motions_differ(count, each, units, resampled):
    table = noise_lookup([sums(by_motion(count, each, 2.0))], groups=motions(count, each))
    found = row(table, Lookup.motion, Lookup.tracker)
    assert found["established"]
    assert found["gain_nats"] > 0.3
    assert found["factor"] < 1.2 < found["factor_against"]
    assert (found["n_units"], found["resampled"]) == (units, resampled)
    assert lookup_sentences(table, Product.error)[0].startswith("Use separate noise by tracker and motion: on unseen")
    assert "gain is" in lookup_sentences(table, Product.error)[0]


@pytest.mark.parametrize("each", [2, 4])
def test_motion_gains_nothing_where_scenes_differ_by_chance_alone(each):
    rng = np.random.default_rng(5)
    spread = dict(zip(map(str, range(5 * each)), np.exp(rng.normal(0.0, 0.4, 5 * each)), strict=True))
    sizes = {key: size * spread[key[0]] for key, size in by_motion(5, each, 1.0).items()}
    table = noise_lookup([sums(sizes)], groups=motions(5, each))
    assert row(table, Lookup.motion, Lookup.tracker)["established"] is False
    assert row(table, Lookup.tracker, Lookup.one)["established"] is True
    answer, added = lookup_sentences(table, Product.error)
    assert answer.startswith("Use separate noise by tracker: on unseen scenes its second moment is off by ")
    assert added.startswith("The motion of the scene adds")
    assert added.endswith("no gain is established.")


def test_one_scene_per_motion_cannot_be_judged_and_says_so():
    table = noise_lookup([sums(by_motion(6, 1, 2.0))], groups=motions(6, 1))
    found = row(table, Lookup.motion, Lookup.tracker)
    assert found["gain_nats"] is None
    assert found["established"] is None
    assert found["why"] == "each motion has only one scene, so that none can be left out"
    assert row(table, Lookup.tracker, Lookup.one)["established"]
    assert "is unknown: each motion has only one scene" in lookup_sentences(table, Product.error)[-1]


def test_motions_with_one_scene_take_no_part():
    sizes = by_motion(5, 2, 2.0) | {("lonely", name, 1): 50.0 for name in ("lk", "matching")}
    groups = SceneGroups({**motions(5, 2).names, ("made", "lonely"): "alone"})
    found = row(noise_lookup([sums(sizes)], groups=groups), Lookup.motion, Lookup.tracker)
    assert found["n_scenes"] == 10
    assert row(noise_lookup([sums(sizes)], groups=groups), Lookup.tracker, Lookup.one)["n_scenes"] == 11


def test_without_two_scenes_of_a_motion_the_factor_has_no_interval():
    """Scenes without any error have no factor. All others are the only ones of their motions."""
    trackers = {"lk": 1.0, "matching": 4.0}
    sizes = {(f"{place}", name, 1): own * (place < 4) for place in range(8) for name, own in trackers.items()}
    groups = SceneGroups({("made", f"{place}"): f"motion {min(place, 4)}" for place in range(8)})
    found = row(noise_lookup([sums(sizes)], groups=groups), Lookup.tracker, Lookup.one)
    assert found["factor"] > 1.0
    assert (found["factor_low"], found["factor_high"]) == (None, None)


def test_few_units_have_a_gain_without_an_interval():
    table = noise_lookup([sums(by_motion(3, 2, 2.0))], groups=motions(3, 2))
    found = row(table, Lookup.motion, Lookup.one)
    assert found["gain_nats"] > 0
    assert (found["low"], found["established"]) == (None, None)
    assert found["why"] == "only 3 groups of scenes can be left out; at least 4 are needed"


def test_a_scene_does_not_predict_itself():
    sizes = by_motion(3, 2, 2.0)
    (_, _, before), *_ = scene_sums(sums(sizes), motions(3, 2))
    (_, _, after), *_ = scene_sums(sums({**sizes, ("0", "lk", 1): 1e6}), motions(3, 2))
    for lookup in Lookup:
        changed = ~np.isclose(before.left_out(lookup), after.left_out(lookup), rtol=1e-6).all(axis=(1, 2, 3))
        assert not changed[0]
        assert changed[3]  # of the same motion


def test_speeds_are_compared_at_equal_ages():
    sizes = {(f"{p}", "lk", speed): 1.0 for p in range(6) for speed in (1, 2)}
    found = row(noise_lookup([sums(sizes)]), Lookup.speed, Lookup.one)
    assert found["established"] is False
    assert found["gain_nats"] == pytest.approx(0.0, abs=0.01)


def test_what_does_not_vary_is_not_looked_up_by():
    sizes = {(f"{p}", "lk", 1): 1.0 for p in range(6)}
    together = SceneGroups({("made", f"{p}"): "one motion" for p in range(6)})
    assert noise_lookup([sums(sizes)], groups=together).is_empty()
    assert noise_lookup([]).is_empty()
    assert lookup_sentences(noise_lookup([sums(sizes)], groups=NO_GROUPS), Product.error) == []


def test_turned_views_are_left_out():
    sizes = by_motion(5, 2, 2.0)
    turned = sums({key: 100.0 * size for key, size in sizes.items()}, rotation=90)
    upright = noise_lookup([sums(sizes)], groups=motions(5, 2))
    assert noise_lookup([sums(sizes), turned], groups=motions(5, 2)).equals(upright)


def test_changes_are_compared_as_well_as_errors():
    table = noise_lookup([sums(by_motion(5, 2, 2.0))], groups=motions(5, 2))
    assert table["product"].unique().sort().to_list() == [Product.error, Product.change]
    assert "changes of errors between observations" in lookup_sentences(table, Product.change)[0]


def test_a_gain_that_no_single_step_establishes_is_stated():
    """Tracker and speed together may be better than one for all, while neither step is by itself."""
    gains = {
        (Lookup.tracker, Lookup.one): (0.05, -0.02, 0.12),
        (Lookup.speed, Lookup.one): (0.10, 0.03, 0.17),
        (Lookup.speed, Lookup.tracker): (0.05, -0.01, 0.11),
    }
    rows = [
        {"product": Product.error, "lookup": lookup, "against": against, "gain_nats": gain, "low": low, "high": high,
         "established": low > 0, "factor": 1.2, "factor_against": 1.5}
        for (lookup, against), (gain, low, high) in gains.items()
    ]  # fmt: skip
    answer, *added = lookup_sentences(pl.DataFrame(rows, schema=dict(NOISE_LOOKUP)), Product.error)
    assert answer.startswith("Use separate noise by tracker and speed: ")
    assert "(0.030 to 0.170)" in answer
    assert added == []


def test_a_run_of_one_scene_does_not_say_that_nothing_varies():
    gains = noise_lookup([sums({("only", "lk", 1): 1.0, ("only", "matching", 1): 4.0})])
    first, _ = noise_table_sentences(NoiseTable(rows=(), gains=gains, window=10, level=0.95, truth=TRUSTED))
    assert first == (
        "It is unknown whether the noise depends on tracker, speed or motion: "
        "no covariance rests on 50 errors of other scenes."
    )
    alike = noise_lookup([sums({("only", "lk", 1): 1.0})])
    assert noise_table_sentences(NoiseTable(rows=(), gains=alike, window=10, level=0.95, truth=TRUSTED))[0] == (
        "The run varies neither tracker, speed nor motion."
    )
