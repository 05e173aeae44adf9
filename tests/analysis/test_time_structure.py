from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.time_structure import TIME_STRUCTURE, lagged, time_structure
from tracknoise.exceptions import SchemaError
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.changes import increments
from tracknoise.statistics.moments import block_moments, scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.trimming import Trimmed
from tracknoise.tables.schema import INCREMENTS, MOMENTS, VIEW, empty

TRACKS, FRAMES = 200, 15
Errors = Callable[[np.random.Generator], np.ndarray]


def noise(rng: np.random.Generator, size_px: float) -> np.ndarray:
    """Independent from frame to frame, and none at birth."""
    errors = size_px * rng.standard_normal((TRACKS, FRAMES, 2))
    errors[:, 0] = 0
    return errors


def white(rng: np.random.Generator) -> np.ndarray:
    return noise(rng, 0.2)


def detected(rng: np.random.Generator) -> np.ndarray:
    errors = 0.2 * rng.standard_normal((TRACKS, FRAMES, 2))
    return errors - errors[:, :1]


def walk(rng: np.random.Generator) -> np.ndarray:
    return noise(rng, 0.1).cumsum(axis=1)


def drift(rng: np.random.Generator) -> np.ndarray:
    return noise(rng, 0.02) + 0.03 * np.arange(FRAMES)[:, None]


def offset(rng: np.random.Generator) -> np.ndarray:
    return 0.2 * rng.standard_normal((TRACKS, 1, 2)) * (np.arange(FRAMES) > 0)[:, None]


def structured(seen: Trimmed, **options) -> pl.DataFrame:
    observations = seen.observations
    moments, changes = (
        scene_moments(prepare_observations(observations)),
        increments(prepare_sequence(observations, seen.tracks)),
    )
    return time_structure(moments, changes, n_draws=300, **options)


def of_scenes(see_errors, errors: Errors, *, scenes: int = 8, seed: int = 0, **options) -> Trimmed:
    rng = np.random.default_rng(seed)
    return see_errors([errors(rng) * np.exp(0.15 * rng.standard_normal()) for _ in range(scenes)], **options)


@pytest.mark.parametrize(
    ("errors", "verdict", "column", "truth", "related"),
    [
        (white, "white", "white_px", 0.2, -0.5),
        (detected, "white", "white_px", 0.2 * 2**0.5, -0.5),
        (offset, "white", "white_px", 0.2, 0.0),
        (walk, "random walk", "walk_px_per_sqrt_frame", 0.1, 0.0),
        (drift, "drift", "drift_px_per_frame", 0.03, None),
    ],
)
def test_kinds_of_errors_are_told_apart_and_their_size_comes_back(
    see_errors, errors: Errors, verdict: str, column: str, truth: float, related: float | None
) -> None:
    for row in structured(of_scenes(see_errors, errors)).filter(trimming="untrimmed").iter_rows(named=True):
        assert row["verdict"] == verdict
        assert (row["n_ages"], row["n_scenes"], row["resampled"]) == (FRAMES - 1, 8, "scenes")
        assert row[f"{column}_low"] < truth < row[f"{column}_high"]
        assert row[column] == pytest.approx(truth, rel=0.15)
        if related is not None:
            assert row["autocorrelation"] == pytest.approx(related, abs=0.07)
            assert row["autocorrelation_low"] <= row["autocorrelation"] <= row["autocorrelation_high"]


def test_intervals_hold_the_truth_about_as_often_as_they_say(see_errors) -> None:
    held, n = 0, 20
    for seed in range(n):
        seen = of_scenes(see_errors, walk, seed=seed, percentile=None)
        rows = structured(seen).filter(trimming="untrimmed", coordinate="u")
        truth = 0.1 * np.exp(0.15**2)  # the root of the mean square over scenes
        held += rows["walk_px_per_sqrt_frame_low"].item() <= truth <= rows["walk_px_per_sqrt_frame_high"].item()
    assert held >= 15  # of 20; a binomial of 95 % is below 15 in 0.03 % of cases


def test_sentences_tell_white_errors_from_an_offset_that_stays(see_errors) -> None:
    said = {errors: structured(of_scenes(see_errors, errors))["why"][0] for errors in (white, offset, walk)}
    assert "independent" in said[white]
    assert "mostly the same offset" in said[offset]
    assert said[walk].startswith("random walk: 0.0")
    assert "px per sqrt(frame)" in said[walk]


def test_time_is_of_the_sequence_whatever_the_speed(see_errors) -> None:
    seen = of_scenes(see_errors, walk, speed=4)  # 0.1 px in a step of 4 frames
    row = structured(seen).filter(trimming="untrimmed", coordinate="u").row(0, named=True)
    assert row["verdict"] == "random walk"
    assert row["walk_px_per_sqrt_frame"] == pytest.approx(0.05, rel=0.15)


def test_with_few_scenes_blocks_are_resampled_and_without_them_nothing_is_decided(see_errors) -> None:
    seen = of_scenes(see_errors, walk, scenes=3)
    rows = structured(seen, blocks=block_moments(prepare_sequence(seen.observations, seen.tracks))).filter(
        trimming="untrimmed"
    )
    assert rows.select("verdict", "resampled", "n_scenes").rows() == [("random walk", "blocks", 3)] * 2
    bare = structured(seen)
    assert bare["verdict"].unique().to_list() == ["undecided"]
    assert bare["walk_px_per_sqrt_frame"].null_count() == 0
    unknown = bare.select("walk_px_per_sqrt_frame_low", "resampled", "autocorrelation_low")
    assert unknown.null_count().row(0) == (bare.height,) * 3


@pytest.mark.parametrize(("scenes", "count", "resampled"), [(6, 4, "blocks"), (8, 4, "within"), (12, 6, "groups")])
def test_scenes_of_one_group_are_not_taken_for_independent(see_errors, scenes: int, count: int, resampled: str) -> None:
    seen = of_scenes(see_errors, walk, scenes=scenes)
    groups = SceneGroups({("d", f"{place:02}"): f"place-{place % count}" for place in range(scenes)})
    blocks = block_moments(prepare_sequence(seen.observations, seen.tracks))
    rows = structured(seen, blocks=blocks, groups=groups).filter(trimming="untrimmed")
    assert rows.select("verdict", "resampled", "n_scenes").rows() == [("random walk", resampled, scenes)] * 2
    bounds = rows.select("walk_px_per_sqrt_frame_low", "autocorrelation_low", "walk_px_per_sqrt_frame_geometric_low")
    assert bounds.null_count().row(0) == (0, 0, 0)
    if resampled == "blocks":
        bare = structured(seen, groups=groups)
        assert bare["verdict"].unique().to_list() == ["undecided"]
        assert bare["walk_px_per_sqrt_frame_low"].null_count() == bare.height


def test_with_a_key_frame_time_is_the_distance_from_it(see_errors) -> None:
    rng, key = np.random.default_rng(1), 7
    steps = 0.1 * rng.standard_normal((8, TRACKS, FRAMES, 2))
    paths = steps.cumsum(axis=2)
    seen = see_errors(list(paths - paths[:, :, key : key + 1]))
    moments = scene_moments(prepare_observations(seen.observations, axis="frame"))
    found = time_structure(
        moments, increments(prepare_sequence(seen.observations, seen.tracks)), key_frames={"forward": key}, n_draws=300
    )
    rows = found.filter(trimming="untrimmed")
    assert rows.select("verdict", "n_ages").rows() == [("random walk", 7)] * 2
    held = pl.lit(0.1).is_between("walk_px_per_sqrt_frame_low", "walk_px_per_sqrt_frame_high")
    assert rows.select(held).to_series().all()
    assert rows["walk_px_per_sqrt_frame"].to_list() == pytest.approx([0.1, 0.1], rel=0.2)


@pytest.mark.parametrize(
    ("frames", "scale", "why"), [(4, 1.0, "only 3 ages with enough errors; at least 4"), (FRAMES, 0.0, "are zero at")]
)
def test_too_few_ages_or_no_errors_leave_it_undecided(see_errors, frames: int, scale: float, why: str) -> None:
    found = structured(of_scenes(see_errors, lambda rng: scale * walk(rng)[:, :frames]))
    assert found["verdict"].unique().to_list() == ["undecided"]
    assert found["white_px"].null_count() == found.height
    assert why in found["why"][0]


def test_ages_end_where_features_are_few(see_errors) -> None:
    seen = of_scenes(see_errors, walk)
    few = seen.observations.filter((pl.col("track") < 10) | (pl.col("age") < 8))
    found = structured(Trimmed(prepare_sequence(few, seen.tracks), seen.trims), min_features=100).filter(
        trimming="untrimmed"
    )
    assert found["n_ages"].to_list() == [7, 7]


def test_the_table_has_its_schema_and_does_not_depend_on_the_order_of_scenes(see_errors) -> None:
    seen = of_scenes(see_errors, walk, scenes=6)
    moments, changes = (
        scene_moments(prepare_observations(seen.observations)),
        increments(prepare_sequence(seen.observations, seen.tracks)),
    )
    once = time_structure(moments, changes, n_draws=50)
    assert once.schema == dict(TIME_STRUCTURE)
    backwards = [[table.filter(scene=f"{place:02}") for place in reversed(range(6))] for table in (moments, changes)]
    assert once.equals(time_structure(*backwards, n_draws=50))


def test_blocks_of_several_sequences_are_added_up_as_those_of_each_unless_their_view_has_few_scenes(see_errors) -> None:
    seen = of_scenes(see_errors, walk, scenes=3)
    changes = increments(prepare_sequence(seen.observations, seen.tracks))
    scenes = [changes.filter(scene=f"{place:02}") for place in (2, 0, 1)]
    together, views = pl.concat(scenes), changes.select("dataset", *VIEW).unique()
    summed = lagged(together, views.clear())
    assert summed.equals(pl.concat([lagged(scene, views.clear()) for scene in scenes]))
    assert summed["block"].unique().to_list() == [0]
    pairs = together.filter(pl.col("lag") > 0)
    assert summed["squares_uu"].sum() == pytest.approx(pairs["squares_uu"].sum())
    assert lagged(together, views).equals(pairs)


def test_without_errors_there_are_no_rows_and_wrong_tables_are_refused() -> None:
    assert time_structure(empty(MOMENTS), empty(INCREMENTS)).equals(empty(TIME_STRUCTURE))
    with pytest.raises(SchemaError, match="increments: column 0"):
        time_structure(empty(MOMENTS), empty(INCREMENTS).drop("dataset"))


def test_the_kind_that_is_asked_for_changes_bounds_alone_and_is_named(see_errors) -> None:
    seen = of_scenes(see_errors, walk)
    found = {kind: structured(seen, kind=kind) for kind in ("student", "percentile", "bca")}
    kinds = {kind: table.select("kind", "autocorrelation_kind").unique().rows() for kind, table in found.items()}
    assert kinds == {
        "student": [("bca", "student")],  # fits that may not be negative rule Student's out
        "percentile": [("percentile", "percentile")],
        "bca": [("bca", "bca")],
    }
    sizes = ["white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame", "autocorrelation"]
    student, percentile, bca = (found[kind] for kind in ("student", "percentile", "bca"))
    assert student.select(sizes).equals(percentile.select(sizes))
    fitted, related = ["walk_px_per_sqrt_frame_low", "walk_px_per_sqrt_frame_high"], "autocorrelation_low"
    assert student.select(fitted).equals(bca.select(fitted))
    assert (student[fitted[0]] != percentile[fitted[0]]).all()
    assert len({table[related][0] for table in found.values()}) == 3


@pytest.mark.parametrize(
    ("errors", "grows", "ratio"), [(white, "no", 1.0), (offset, "no", 1.0), (walk, "yes", 10**0.5), (drift, "yes", 8.4)]
)
def test_growth_is_shown_by_the_ratio_of_the_same_tracks(see_errors, errors: Errors, grows: str, ratio: float) -> None:
    for row in structured(of_scenes(see_errors, errors)).filter(trimming="untrimmed").iter_rows(named=True):
        assert row["grows"] == grows
        assert (row["growth_from"], row["growth_to"]) == (1, 10)
        assert row["growth_ratio_low"] <= row["growth_ratio"] <= row["growth_ratio_high"]
        assert row["growth_ratio"] == pytest.approx(ratio, rel=0.1)


def test_a_slow_walk_is_growth_within_a_wider_margin_only(see_errors) -> None:
    """RMS at age 10 is 1.19 times that at age 1: more than 1.1 times, less than 1.3 times."""

    def slow(rng: np.random.Generator) -> np.ndarray:
        return noise(rng, 0.2) + noise(rng, 0.044).cumsum(axis=1)

    seen = of_scenes(see_errors, slow, scenes=28)
    for margin, grows in ((0.1, "yes"), (0.3, "no")):
        rows = structured(seen, margin=margin).filter(trimming="untrimmed")
        assert rows["grows"].to_list() == [grows] * 2
        assert rows["verdict"].to_list() == ["random walk"] * 2
        assert all("constant part" in why for why in rows["why"])
