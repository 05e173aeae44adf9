"""Covariances that trackers predict: verdicts where they are right, too small, or say nothing, and parts by hand."""

from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import USUAL, Sampling
from tracknoise.analysis.covariance_verdicts import are_of_use, are_right, have_right_shape, own_covariances
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.projection import FrameGeometry
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.joining import Part, join
from tracknoise.statistics.own_covariances import covariance_sums, relative, sums_of_covariances
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.schema import COVARIANCE_SUMS

AGES, TRACKS = 6, 60
COLUMNS = ("quality_cov_uu", "quality_cov_uv", "quality_cov_vv")


def of_scene(observations, tracks, scene: str, seed: int, claim: Callable[[np.ndarray], np.ndarray]) -> pl.DataFrame:
    """Sums of a scene whose errors have variances from 0.01 to 1 px^2; `claim` makes of them what the tracker says."""
    rng = np.random.default_rng(seed)
    track, age = np.repeat(np.arange(TRACKS), AGES), np.tile(np.arange(AGES), TRACKS)
    variance = np.exp(rng.uniform(np.log(0.01), 0.0, size=(len(track), 2)))
    error = np.where(age[:, None] > 0, rng.normal(size=variance.shape) * np.sqrt(variance), 0.0)
    said = np.where(age[:, None] > 0, claim(variance), 0.0)
    seen = observations(
        scene=scene, track=track.tolist(), age=age.tolist(), frame=age.tolist(),
        du_px=error[:, 0].tolist(), dv_px=error[:, 1].tolist(), truth="valid",
    )  # fmt: skip
    entries = (said[:, 0], 0.0 * age, said[:, 1])
    table = seen.with_columns(pl.Series(name, part, pl.Float32) for name, part in zip(COLUMNS, entries, strict=True))
    return covariance_sums(prepare_sequence(table, tracks(scene=scene, track=list(range(TRACKS)), lifetime=AGES)))


def judged(observations, tracks, claim: Callable, sampling: Sampling = USUAL, scenes: int = 8) -> dict:
    """Rows at all ages together, by quantity."""
    made = [of_scene(observations, tracks, f"scene {place}", place, claim) for place in range(scenes)]
    found = own_covariances(made, sampling).filter(trimming="untrimmed")
    assert found["covariance"].unique().to_list() == ["cov"]
    return {row["quantity"]: row for row in found.filter(pl.col("at").is_null()).to_dicts()}


def test_right_covariances_are_right_and_of_use(observations, tracks) -> None:
    found = judged(observations, tracks, lambda variance: variance)
    assert found["nees"]["verdict"] == "yes"
    assert found["gain"]["verdict"] == "yes"
    for level in (50, 90, 95, 99):
        assert found[f"coverage_{level}"]["low"] < level / 100 < found[f"coverage_{level}"]["high"]
    assert found["impossible"]["value"] == 0.0
    assert found["nees"]["n"] == 8 * TRACKS * (AGES - 1)


def test_covariances_that_are_four_times_too_small_are_found_with_their_factor(observations, tracks) -> None:
    found = judged(observations, tracks, lambda variance: variance / 4.0)
    assert found["nees"]["verdict"] == "no"
    assert found["nees"]["low"] < 4.0 < found["nees"]["high"]
    assert found["coverage_95"]["value"] == pytest.approx(1.0 - 0.05**0.25, abs=0.02)  # chi square with two degrees
    right = judged(observations, tracks, lambda variance: variance)
    assert found["gain"]["value"] == pytest.approx(right["gain"]["value"], rel=1e-5)  # the factor is taken out


def test_covariances_without_information_are_of_no_use(observations, tracks) -> None:
    rng = np.random.default_rng(7)
    shuffled = judged(observations, tracks, lambda variance: rng.permutation(variance))
    assert shuffled["gain"]["verdict"] == "no"
    assert shuffled["gain"]["high"] < 0.0
    equal = judged(observations, tracks, lambda variance: np.full_like(variance, 0.215))
    assert equal["gain"]["verdict"] == "no"
    assert equal["gain"]["value"] == pytest.approx(0.0, abs=1e-6)
    assert equal["nees"]["verdict"] == "yes"


RATIO, VERDICTS = 2.0, {"size": "nees", "shape": "shape", "ranking": "ranking"}


def ellipses(variance: np.ndarray, angle: np.ndarray, ratio: float = RATIO) -> np.ndarray:
    """(n, 3): uu, uv, vv of these mean variances, and standard deviations of a ratio along axes at these angles."""
    turn = np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), 2, 0)
    along = np.array([ratio**2, 1.0]) * 2.0 / (ratio**2 + 1.0)
    found = variance[:, None, None] * (turn * along) @ np.swapaxes(turn, 1, 2)
    return np.stack([found[:, 0, 0], found[:, 0, 1], found[:, 1, 1]], axis=1)


PREDICTED = {
    "right": (lambda size, angle: ellipses(size, angle), ("yes", "yes", "yes")),
    "twice too large": (lambda size, angle: ellipses(2.0 * size, angle), ("no", "yes", "yes")),
    "circles": (lambda size, angle: ellipses(size, angle, 1.0), ("yes", "no", "yes")),
    "turned": (lambda size, angle: ellipses(size, angle + np.pi / 2.0), ("no", "no", "yes")),
    "turned by half": (lambda size, angle: ellipses(size, angle + np.pi / 4.0), ("no", "no", "yes")),
    "one size": (lambda size, angle: ellipses(np.full_like(size, size.mean()), angle), ("yes", "yes", "no")),
    "small, in order": (lambda size, angle: ellipses(size**0.5 / 9.0, angle), ("no", "yes", "yes")),
}


def planted(claim: Callable, scenes: int, *, scattered: bool = False, ratio: float = RATIO) -> dict[str, str]:
    """Verdicts on what is predicted for errors whose ellipses lie around the diagonal, or anywhere."""
    rng, rows, n = np.random.default_rng(5), [], 1500
    for scene in range(scenes):
        size, angle = np.exp(rng.uniform(np.log(0.01), 0.0, n)), np.pi / 4.0 + 0.2 * rng.standard_normal(n)
        angle = rng.uniform(0.0, np.pi, n) if scattered else angle
        uu, uv, vv = ellipses(size, angle, ratio).T
        first, second = rng.standard_normal((2, n))
        error = np.stack([np.sqrt(uu) * first, uv / np.sqrt(uu) * first + np.sqrt(vv - uv**2 / uu) * second], axis=1)
        view = {"lighting": "default", "rotation": 0, "direction": "forward", "camera": "", "block": 0}
        row = {"dataset": "d", "scene": f"{scene}", "tracker": "t", "speed": 1, "covariance": "cov", **view}
        sums = sums_of_covariances(claim(size, angle), error)
        rows.append(row | {"trimming": "untrimmed", "axis": "age", "impossible": 0.0, **sums})
    table = own_covariances([pl.DataFrame(rows, schema=dict(COVARIANCE_SUMS))])
    found = {row["quantity"]: row["verdict"] for row in table.to_dicts()}
    return {name: found.get(quantity) for name, quantity in VERDICTS.items()}


@pytest.mark.parametrize("name", PREDICTED)
def test_size_shape_and_ranking_are_judged_apart(name: str) -> None:
    claim, expected = PREDICTED[name]
    assert tuple(planted(claim, 8).values()) == expected


def test_circles_are_not_called_right_where_axes_of_errors_lie_anywhere() -> None:
    """No frame of axes shows them. Tails of the whitened errors do, and scales of errors make the same tails."""
    assert planted(PREDICTED["right"][0], 8, scattered=True)["shape"] == "yes"
    assert planted(PREDICTED["circles"][0], 8, scattered=True)["shape"] == "undecided"


def test_circles_are_right_where_errors_have_no_direction_and_ellipses_are_not() -> None:
    assert planted(PREDICTED["circles"][0], 8, ratio=1.0)["shape"] == "yes"
    assert planted(PREDICTED["right"][0], 8, ratio=1.0, scattered=True)["shape"] == "no"


def test_few_scenes_decide_nothing() -> None:
    assert set(planted(PREDICTED["right"][0], 2).values()) == {"undecided"}


def test_errors_of_the_truth_may_make_a_shape_look_wrong() -> None:
    bounds = [(1.0, 1.1), (1.3, 1.5)]
    of_truth = {share: have_right_shape(bounds, are_known=True, of_truth=share) for share in (0.0, 0.1, 0.4, None)}
    assert of_truth == {0.0: "no", 0.1: "no", 0.4: "undecided", None: "undecided"}
    assert have_right_shape([(0.95, 1.05)], are_known=True) == "yes"
    assert have_right_shape([(0.95, 1.05)], are_known=True, of_truth=0.3) == "undecided"
    assert have_right_shape([(0.95, 1.05)], are_known=False) == "undecided"
    assert have_right_shape([(0.95, 1.05), (None, None)], are_known=True) == "undecided"


def test_covariances_are_whitened_along_the_motion_too(observations, tracks) -> None:
    """Errors lag behind: they are three times as large along the motion of their point, which has any direction."""
    made = []
    for place in range(8):
        rng = np.random.default_rng(place)
        track, age = np.repeat(np.arange(TRACKS), AGES), np.tile(np.arange(AGES), TRACKS)
        angle = rng.uniform(0.0, 2.0 * np.pi, TRACKS)[track]
        way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        across = np.stack([-way[:, 1], way[:, 0]], axis=1)
        error = 0.3 * rng.normal(size=(len(track), 1)) * way + 0.1 * rng.normal(size=(len(track), 1)) * across
        error *= age[:, None] > 0
        seen = observations(
            scene=f"{place}", track=track.tolist(), age=age.tolist(), frame=age.tolist(),
            du_px=error[:, 0].tolist(), dv_px=error[:, 1].tolist(), truth="valid",
        )  # fmt: skip
        moved = [
            pl.Series(name, 100.0 + 2.0 * age * way[:, axis]) for axis, name in enumerate(("u_true_px", "v_true_px"))
        ]
        stated = [
            pl.Series(name, value * (age > 0), pl.Float32)
            for name, value in zip(COLUMNS, (0.05, 0.0, 0.05), strict=True)
        ]
        table = seen.with_columns(*moved, *stated)
        listed = tracks(scene=f"{place}", track=list(range(TRACKS)), lifetime=AGES)
        made.append(covariance_sums(prepare_sequence(table, listed)))
    found = own_covariances(made).filter(pl.col("at").is_null(), trimming="untrimmed")
    rows = {row["quantity"]: row for row in found.to_dicts()}
    assert rows["shape"]["verdict"] == "no"
    assert rows["shape"]["value"] == rows["shape_motion_along"]["value"] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [(None, None, "undecided"), (1e-17, 2e-17, "no"), (0.1, 0.2, "yes"), (-0.1, 0.2, "undecided"), (-0.2, -0.1, "no")],
)
def test_a_gain_is_of_use_where_it_is_more_than_rounding(low: float | None, high: float | None, says: str) -> None:
    assert are_of_use(low, high) == says


def test_groups_of_scenes_are_left_out_together(observations, tracks) -> None:
    groups = SceneGroups({("d", f"scene {place}"): f"group {place // 2}" for place in range(12)})
    found = judged(observations, tracks, lambda variance: variance, Sampling(groups=groups), scenes=12)
    assert (found["gain"]["resampled"], found["gain"]["n_units"], found["gain"]["n_scenes"]) == ("groups", 6, 12)


def test_one_scene_has_no_gain_and_nothing_is_decided_by_few(observations, tracks) -> None:
    found = judged(observations, tracks, lambda variance: variance, scenes=1)
    assert "gain" not in found
    assert found["nees"]["resampled"] == "blocks"


def test_sums_of_parts_are_those_of_the_whole(observations, tracks) -> None:
    whole = of_scene(observations, tracks, "a", 3, lambda variance: variance)
    parts = [(Part(place, 2, 0, {}), whole) for place in range(2)]
    twice = join("covariance_sums", parts, COVARIANCE_SUMS)
    sums = (table.select(pl.col(pl.Float64).sum()).row(0) for table in (twice, whole))
    assert next(sums) == pytest.approx([2.0 * value for value in next(sums)])
    assert twice.filter(pl.col("at").is_null())["n"].sum() == 2 * 2 * TRACKS * (AGES - 1)  # by trimming too


def test_what_no_tracker_predicts_is_in_no_table(observations, tracks) -> None:
    plain = observations(track=[0, 0], age=[0, 1], frame=[0, 1], du_px=[0.0, 1.0], dv_px=0.0, truth="valid")
    sums = covariance_sums(prepare_sequence(plain, tracks(track=[0], lifetime=2)))
    assert sums.is_empty()
    assert own_covariances([sums]).is_empty()


def test_an_error_has_the_covariance_of_both_positions() -> None:
    entries = np.array([[1.0, 0.5, 2.0], [3.0, 0.0, 1.0], [np.nan] * 3, [4.0, 1.0, 4.0], [-1.0, 0.0, 1.0]])
    track, first = np.array([0, 0, 1, 1, 1]), np.array([True, False, True, False, False])
    found = relative(entries, track, first)
    assert found[1].tolist() == [4.0, 0.5, 3.0]
    assert found[3].tolist() == [4.0, 1.0, 4.0]  # a first position without a covariance counts as exact
    assert np.isnan(found[4]).all()  # not positive definite


def test_the_error_of_the_first_position_is_magnified_with_the_image(observations, tracks) -> None:
    """A camera that halves the distance to a point: of the same noise in both images, the first counts twice."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 2, 3] = 2.0
    camera = Camera(width=640, height=480, fx=400.0, fy=400.0, cx=320.0, cy=240.0)
    geometry = FrameGeometry(poses, (camera,), np.zeros(2, np.intp))
    n = 4000
    track, age = np.repeat(np.arange(n), 2), np.tile([0, 1], n)
    noise = 0.3 * np.random.default_rng(1).standard_normal((n, 2, 2))
    error = np.stack([np.zeros((n, 2)), noise[:, 1] - 2.0 * noise[:, 0]], axis=1).reshape(-1, 2)
    table = observations(
        track=track.tolist(), age=age.tolist(), frame=age.tolist(), du_px=error[:, 0].tolist(),
        dv_px=error[:, 1].tolist(), u_true_px=330.0, v_true_px=250.0, truth="valid",
    )  # fmt: skip
    entries = dict(zip(COLUMNS, (0.09, 0.0, 0.09), strict=True))
    table = table.with_columns(pl.lit(value, pl.Float32).alias(name) for name, value in entries.items())
    prepared = prepare_sequence(table, tracks(track=list(range(n)), lifetime=2, depth_m=4.0))
    right, plain = (
        covariance_sums(prepared, of).filter(pl.col("at").is_null(), trimming="untrimmed") for of in (geometry, None)
    )
    assert right["squares"].sum() / right["n"].sum() / 2.0 == pytest.approx(1.0, abs=0.05)
    assert plain["squares"].sum() / plain["n"].sum() / 2.0 == pytest.approx(2.5, abs=0.12)


@pytest.mark.parametrize(
    ("low", "high", "share", "says"),
    [(2.0, 3.0, 0.3, "no"), (2.0, 3.0, 0.6, "undecided"), (2.0, 3.0, None, "undecided"), (0.2, 0.5, None, "no"),
     (0.95, 1.1, 0.01, "yes"), (0.95, 1.1, 0.4, "undecided"), (None, None, 0.0, "undecided")],
)  # fmt: skip
def test_covariances_are_not_blamed_for_errors_of_the_truth(low, high, share, says) -> None:
    assert are_right(low, high, share) == says
