"""Errors along and across, and of survivors, against worlds in which they are known by hand."""

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.aspects import aspects
from tracknoise.statistics.curves import aspect_curves, curves
from tracknoise.statistics.definitions import LEAST_MOTION_PX, LONG_LIVED_AGES
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.findings_schema import ASPECT_CURVES
from tracknoise.tables.schema import ASPECTS, OBSERVATIONS, TRACKS, empty

TURN_FRAMES = 36
DRIFT_PX = -0.05


def aspect(table: pl.DataFrame, name: str, trimming: str = "untrimmed") -> pl.DataFrame:
    return table.filter(aspect=name, trimming=trimming).sort("speed", "at")


@pytest.fixture
def turning(observations, tracks) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Image motion of 3 px a frame whose direction turns by 10 degrees a frame, and tracks that lag behind it.

    A track begins in each of as many frames as a full turn takes; at age k its error is k DRIFT_PX along the motion.
    """
    length = 13
    direction = np.deg2rad(10) * np.arange(TURN_FRAMES + length)
    motion = np.column_stack([np.cos(direction), np.sin(direction)])
    place = 3 * np.cumsum(motion, axis=0)
    first, age = np.repeat(np.arange(TURN_FRAMES), length), np.tile(np.arange(length), TURN_FRAMES)
    error = DRIFT_PX * age[:, None] * motion[first + age]
    true = place[first + age]
    seen = observations(
        track=first.tolist(), frame=(first + age).tolist(), age=age.tolist(),
        u_true_px=true[:, 0].tolist(), v_true_px=true[:, 1].tolist(),
        du_px=error[:, 0].tolist(), dv_px=error[:, 1].tolist(),
    )  # fmt: skip
    return seen, tracks(track=list(range(TURN_FRAMES)), lifetime=length)


def test_a_drift_along_a_turning_motion_averages_out_in_u_and_v_and_not_along_the_motion(turning) -> None:
    seen, lived = turning
    image = scene_moments(prepare_observations(seen)).filter(population="visible", trimming="untrimmed").sort("at")
    assert image.select("mean_u", "mean_v").to_numpy() == pytest.approx(0, abs=1e-12)
    along = aspect(aspects(prepare_sequence(seen, lived)), Aspect.motion)
    assert along["at"].to_list() == list(range(1, 13))  # at age 0 there is no motion yet
    assert along["mean_u"].to_numpy() == pytest.approx(DRIFT_PX * along["at"].to_numpy(), abs=1e-12)
    assert along["mean_v"].to_numpy() == pytest.approx(0, abs=1e-12)
    assert along["n"].unique().to_list() == [TURN_FRAMES]


def test_across_is_positive_to_the_right_of_the_motion(observations, tracks) -> None:
    steps, errors = [(5, 0), (0, 5), (-5, 0), (0, -5)], [(2, 1), (-1, 2), (-2, -1), (1, -2)]  # ahead 2, right 1
    seen = observations(
        track=[0, 1, 2, 3] * 2, frame=[0] * 4 + [1] * 4, age=[0] * 4 + [1] * 4,
        u_true_px=[0] * 4 + [u for u, _ in steps], v_true_px=[0] * 4 + [v for _, v in steps],
        du_px=[0] * 4 + [u for u, _ in errors], dv_px=[0] * 4 + [v for _, v in errors],
    )  # fmt: skip
    row = aspect(aspects(prepare_sequence(seen, tracks(track=[0, 1, 2, 3]))), Aspect.motion).row(0, named=True)
    assert (row["n"], row["mean_u"], row["mean_v"]) == (4, 2.0, 1.0)
    assert (row["m_uu"], row["m_vv"]) == (0.0, 0.0)


def test_only_what_has_moved_since_the_frame_before_has_a_direction(observations, tracks) -> None:
    none, unknown = None, "no_depth"
    rows = [  # track, frame, age, u_true, truth
        (0, 0, 0, 0.0, "valid"), (0, 4, 4, 3.0, "valid"), (0, 8, 8, 6.0, "valid"),  # counts at ages 4 and 8
        (1, 0, 0, 0.0, "valid"), (1, 8, 8, 6.0, "valid"),  # not seen in the frame before
        (2, 0, 0, 0.0, "valid"), (2, 4, 4, 0.99 * LEAST_MOTION_PX, "valid"),  # hardly moved
        (3, 0, 0, none, unknown), (3, 4, 4, none, unknown),  # nobody knows
        (4, 4, 0, 0.0, "occluded"), (4, 8, 4, 3.0, "valid"), (4, 12, 8, 6.0, "occluded"),  # counts at age 4
    ]  # fmt: skip
    track, frame, age, u_true, truth = (list(column) for column in zip(*rows, strict=True))
    known = [value is not none for value in u_true]
    seen = observations(
        track=track, frame=frame, age=age, u_true_px=u_true, v_true_px=[0.0 if k else None for k in known],
        truth=truth, du_px=[1.0 if k else None for k in known], dv_px=[0.0 if k else None for k in known], speed=4,
    )  # fmt: skip
    found = aspect(aspects(prepare_sequence(seen, tracks(track=list(range(5)), speed=4))), Aspect.motion)
    assert found.select("at", "n").rows() == [(4, 2), (8, 1)]


def test_tracks_of_the_same_number_in_other_conditions_are_other_tracks(observations, tracks) -> None:
    conditions = [("a", "lk", 1), ("b", "lk", 1), ("a", "other", 1), ("a", "lk", 2)]
    parts = [
        observations(
            scene=scene, tracker=tracker, speed=speed, frame=[speed * k for k in range(3)],
            age=[speed * k for k in range(3)], u_true_px=[7.0 * i + 2 * k for k in range(3)], du_px=float(i),
        )
        for i, (scene, tracker, speed) in enumerate(conditions)
    ]  # fmt: skip
    mixed = pl.concat(parts).sample(fraction=1.0, shuffle=True, seed=1)
    lived = pl.concat([tracks(track=[0], scene=a, tracker=b, speed=c, gradient_rad=0.0) for a, b, c in conditions])
    apart = [aspects(prepare_sequence(part, one)) for part, one in zip(parts, lived.iter_slices(1), strict=True)]
    together = aspects(prepare_sequence(mixed, lived))
    assert_frame_equal(together, pl.concat(apart).sort(together.columns[: together.columns.index("n")]))


def test_errors_turn_into_the_axes_of_the_gradient_of_their_track(observations, tracks) -> None:
    """Sliding along edges: errors across the gradient alone, with either sign."""
    angle = np.array([0.0, 0.7, -1.2, np.pi / 2])
    size = np.array([1.0, -2.0, 3.0, -4.0])
    seen = observations(
        track=[0, 1, 2, 3, 4], du_px=[*(-size * np.sin(angle)), 50.0], dv_px=[*(size * np.cos(angle)), 50.0]
    )
    lived = tracks(track=[0, 1, 2, 3, 4], gradient_rad=[*angle.tolist(), None])
    row = aspect(aspects(prepare_sequence(seen, lived)), Aspect.gradient).row(0, named=True)
    assert row["n"] == 4  # one track began where no gradient dominates
    second = {name: row[f"m_{name}{name}"] + row["n"] * row[f"mean_{name}"] ** 2 for name in "uv"}
    assert second == pytest.approx({"u": 0.0, "v": np.sum(size**2)}, abs=1e-5)  # angles are float32
    assert row["mean_abs_v"] == pytest.approx(2.5)


@pytest.fixture(scope="module")
def many(observations, tracks) -> tuple[pl.DataFrame, pl.DataFrame]:
    """300 tracks at speed 1, some hidden or without depth or dropped, of up to 130 frames."""
    rng = np.random.default_rng(7)
    length = rng.geometric(1 / 25, 300).clip(max=130)
    track = np.repeat(np.arange(300), length)
    age = np.arange(len(track)) - np.repeat(np.cumsum(length) - length, length)
    truth = rng.choice(["valid", "occluded", "no_depth"], len(track), p=[0.7, 0.2, 0.1])
    place, error = 2.0 * age[:, None] + rng.normal(size=(len(track), 2)), rng.normal(size=(len(track), 2))
    numbers = np.where((truth == "no_depth")[:, None], None, np.column_stack([place, error])).T.tolist()
    seen = observations(
        track=track.tolist(), frame=age.tolist(), age=age.tolist(), truth=truth.tolist(),
        u_true_px=numbers[0], v_true_px=numbers[1], du_px=numbers[2], dv_px=numbers[3],
        kept=(track % 5 > 0).tolist(),
    )  # fmt: skip
    angles = np.where(rng.random(300) < 0.3, None, rng.uniform(-1.5, 1.5, 300)).tolist()
    return seen, tracks(track=list(range(300)), gradient_rad=angles)


def test_survivors_are_the_tracks_that_were_seen_at_an_age_or_later(many) -> None:
    seen, lived = many
    found = aspects(prepare_sequence(seen, lived))
    oldest = seen.group_by("track").agg(pl.col("age").max())
    for age in LONG_LIVED_AGES:
        chosen = oldest.filter(pl.col("age") >= age)["track"]
        direct = scene_moments(prepare_observations(seen.filter(pl.col("track").is_in(chosen.implode())))).filter(
            population="visible"
        )
        assert direct.height > 0
        assert_frame_equal(
            found.filter(aspect=Aspect.long_lived, at_least=age).drop("aspect", "at_least"),
            direct,
            rel_tol=1e-9,
            abs_tol=1e-9,
        )


def test_a_turn_of_the_axes_keeps_the_length_of_errors_and_counts_visible_and_kept_ones_alone(many) -> None:
    seen, lived = many
    found = aspects(prepare_sequence(seen, lived)).filter(aspect=Aspect.gradient)
    with_gradient = lived.filter(pl.col("gradient_rad").is_not_null())["track"]
    direct = seen.filter(pl.col("truth") == "valid", pl.col("track").is_in(with_gradient.implode()))
    for trimming, chosen in (("untrimmed", direct), ("trimmed", direct.filter("kept"))):
        length2 = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sum()
        expected = chosen.group_by(at="age").agg(n=pl.len(), length2=length2).sort("at")
        rows = found.filter(trimming=trimming)
        mean2 = rows["mean_u"] ** 2 + rows["mean_v"] ** 2
        assert rows["at"].to_list() == expected["at"].to_list()
        assert rows["n"].to_list() == expected["n"].to_list()
        total = (rows["m_uu"] + rows["m_vv"] + rows["n"] * mean2).to_numpy()
        assert total == pytest.approx(expected["length2"].to_numpy(), rel=1e-9)


def test_time_counts_where_a_key_frame_fixes_the_tracks(turning) -> None:
    seen, lived = turning
    along = aspect(aspects(prepare_sequence(seen, lived, axis="frame")), Aspect.motion)
    assert along["axis"].unique().to_list() == ["frame"]
    assert along["at"].to_list() == list(range(1, TURN_FRAMES + 12))


def test_results_do_not_depend_on_the_order_of_rows_and_the_input_stays_as_it_was(many) -> None:
    seen, lived = many
    before = seen.clone()
    found = aspects(prepare_sequence(seen, lived))
    shuffled = aspects(prepare_sequence(seen.sample(fraction=1.0, shuffle=True, seed=2), lived.reverse()))
    assert_frame_equal(shuffled, found, rel_tol=1e-9, abs_tol=1e-9)
    assert aspects(prepare_sequence(seen, lived)).equals(found)
    assert seen.equals(before)


def test_nothing_seen_has_no_aspects_and_wrong_tables_are_refused(many) -> None:
    seen, lived = many
    nothing = aspects(prepare_sequence(empty(OBSERVATIONS), empty(TRACKS)))
    assert nothing.equals(empty(ASPECTS))
    assert aspect_curves(nothing).equals(empty(ASPECT_CURVES))
    with pytest.raises(SchemaError, match="observations: column 9"):
        aspects(prepare_sequence(lived, seen))
    with pytest.raises(SchemaError, match="tracks: column 14"):
        aspects(prepare_sequence(seen, lived.drop("gradient_rad")))
    with pytest.raises(SchemaError, match="aspects: column 0"):
        aspect_curves(scene_moments(prepare_observations(seen)))


@pytest.fixture(scope="module")
def scenes(many) -> list[pl.DataFrame]:
    """Aspects of three scenes of two datasets, one of them of an awkward name."""
    seen, lived = many
    names = [("d", "a"), ("d", "b"), ("d/e", "a")]
    labelled = [[t.with_columns(dataset=pl.lit(d), scene=pl.lit(s)) for t in (seen, lived)] for d, s in names]
    return [aspects(prepare_sequence(*pair)) for pair in labelled]


def test_curves_of_an_aspect_are_the_curves_of_its_moments(scenes) -> None:
    stacked = pl.concat(scenes)
    found = aspect_curves(stacked, min_features=30)
    order = ["aspect", "at_least", "dataset"]
    labels = order[:2]
    for name, at_least in stacked.select(labels).unique().rows():
        chosen = (pl.col("aspect") == name) & pl.col("at_least").eq_missing(at_least)
        direct = curves(stacked.filter(chosen).drop(labels), min_features=30)
        if name == Aspect.gradient:
            direct = direct.filter(pl.col("statistic").is_in(["eta", "Phi"]))  # its axis has no sign, so no mean
        assert_frame_equal(found.filter(chosen).drop(labels), direct)
    assert found["cut"].any()
    assert found.select(order).equals(found.select(order).sort(order, maintain_order=True))
    assert found["dataset"].unique().sort().to_list() == ["d", "d/e"]


def test_scenes_may_come_one_by_one(scenes) -> None:
    assert_frame_equal(aspect_curves(iter(scenes)), aspect_curves(pl.concat(scenes)))
