from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.gaussianity import GAUSSIANITY, RADII, Shapes, gaussianity
from tracknoise.exceptions import SchemaError
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.samples import samples
from tracknoise.statistics.trimming import Trimmed
from tracknoise.tables.schema import MOMENTS, SAMPLES, empty

TRACKS, FRAMES = 400, 8


def shaped(seen: Trimmed, **options) -> Shapes:
    observations = seen.observations
    return gaussianity(
        scene_moments(prepare_observations(observations)),
        samples(prepare_sequence(observations, seen.tracks)),
        n_draws=300,
        **options,
    )


def errors(scale: Callable[[np.random.Generator, int], np.ndarray], *, scenes: int, seed: int) -> list[np.ndarray]:
    """Errors that grow with the root of age; those of a track are scaled together."""
    rng = np.random.default_rng(seed)
    grown = np.sqrt(np.arange(FRAMES))[:, None]
    normal = rng.standard_normal((scenes, TRACKS, FRAMES, 2)) @ np.array([[0.2, 0.05], [0.0, 0.1]])
    return [grown * values * scale(rng, TRACKS)[:, None, None] for values in normal]


def student(nu: float) -> Callable[[np.random.Generator, int], np.ndarray]:
    return lambda rng, n: np.sqrt(nu / rng.chisquare(nu, n))


def contaminated(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.where(rng.random(n) < 0.06, 4.0, 1.0)


def constant(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.ones(n)


@pytest.fixture(scope="module")
def found(see_errors) -> Callable[..., Shapes]:
    memo: dict[object, Shapes] = {}

    def shapes(scale, scenes: int = 8) -> Shapes:
        key = (scale, scenes)
        if key not in memo:
            memo[key] = shaped(see_errors(errors(scale, scenes=scenes, seed=1)))
        return memo[key]

    return shapes


STUDENT_3, STUDENT_5 = student(3), student(5)


@pytest.mark.parametrize(
    ("scale", "verdict"),
    [(constant, "Gaussian"), (STUDENT_3, "heavy-tailed"), (STUDENT_5, "heavy-tailed"), (contaminated, "contaminated")],
)
def test_kinds_of_errors_are_told_apart_with_scenes_and_with_blocks(found, scale, verdict: str) -> None:
    for scenes, resampled in ((8, "scenes"), (3, "blocks")):
        rows = found(scale, scenes).gaussianity.filter(trimming="untrimmed")
        assert rows.select("age_low", "age_high", "verdict", "resampled").rows() == [
            (1, 4, verdict, resampled),
            (5, 9, verdict, resampled),
        ]


@pytest.mark.parametrize(("scenes", "count", "resampled"), [(6, 4, "blocks"), (8, 4, "within"), (12, 6, "groups")])
def test_scenes_of_one_group_are_not_taken_for_independent(see_errors, scenes: int, count: int, resampled: str) -> None:
    groups = SceneGroups({("d", f"{place:02}"): f"place-{place % count}" for place in range(scenes)})
    rows = shaped(see_errors(errors(STUDENT_3, scenes=scenes, seed=1)), groups=groups).gaussianity
    known = rows.filter(trimming="untrimmed")
    assert known.select("verdict", "resampled", "n_scenes").rows() == [("heavy-tailed", resampled, scenes)] * 2
    bounds = known.select("kurtosis_low", "kurtosis_within_low", "gain_student_low", "gain_student_within_low")
    assert bounds.null_count().row(0) == (0, 0, 0, 0)
    if resampled == "within":  # rather too wide than beyond what a kurtosis can be
        alone = shaped(see_errors(errors(STUDENT_3, scenes=scenes, seed=1))).gaussianity
        assert rows.drop("resampled").equals(alone.drop("resampled"))


def test_trimming_drops_what_contaminates(found) -> None:
    rows = found(contaminated).gaussianity.filter(age_low=5).select("trimming", "verdict", "kurtosis", "tail_999")
    (_, before, heavy, far), (_, after, light, near) = rows.rows()
    assert (before, after) == ("contaminated", "Gaussian")
    assert heavy > 12 > light
    assert far > 10 > near


def test_numbers_are_those_that_went_in(found) -> None:
    row = found(STUDENT_5).gaussianity.filter(trimming="untrimmed", age_low=5).row(0, named=True)
    assert (row["n"], row["n_sampled"], row["n_scenes"]) == (8 * 400 * 3, 8 * 400, 8)
    assert row["student_nu"] == pytest.approx(5.0, abs=1.0)
    # the scale of a coordinate at ages 5 to 7, in a way of averaging in which 6 stands for them
    assert row["student_scale_px"] == pytest.approx(np.sqrt(6 * 0.2 * 0.1), rel=0.05)
    assert row["gain_student_low"] < row["gain_student_nats"] < row["gain_student_high"]
    mixed = found(contaminated).gaussianity.filter(trimming="untrimmed", age_low=5).row(0, named=True)
    assert mixed["mixture_share"] == pytest.approx(0.06, abs=0.02)
    assert mixed["mixture_ratio"] == pytest.approx(16.0, rel=0.25)


def test_quantiles_of_a_gaussian_are_as_expected_and_of_heavy_tails_farther_out(found) -> None:
    far_out = np.sqrt(0.005 ** (-2 / 3) - 1) / np.sqrt(-2 * np.log(0.005))  # P(d2 > x) = (1 + x / 3)^-1.5, variance 3
    for scale, far in ((constant, 1.0), (STUDENT_3, far_out)):
        rows = found(scale).radii.filter(trimming="untrimmed", age_low=1)
        last = rows.filter(probability=0.995).row(0, named=True)
        assert last["observed"] / last["expected"] == pytest.approx(far, rel=0.2)
        assert rows["observed"].is_sorted()


def test_tables_have_their_schemas_and_do_not_depend_on_the_order_of_scenes(see_errors) -> None:
    seen = see_errors(errors(constant, scenes=6, seed=2))
    moments, singles = (
        scene_moments(prepare_observations(seen.observations)),
        samples(prepare_sequence(seen.observations, seen.tracks)),
    )
    once = gaussianity(moments, singles, n_draws=50)
    assert once.gaussianity.schema == dict(GAUSSIANITY)
    assert once.radii.schema == dict(RADII)
    backwards = [[table.filter(scene=f"{place:02}") for place in reversed(range(6))] for table in (moments, singles)]
    again = gaussianity(*backwards, n_draws=50)
    assert once.gaussianity.equals(again.gaussianity)
    assert once.radii.equals(again.radii)


def test_conditions_are_looked_at_by_themselves(see_errors) -> None:
    one, other = (see_errors(errors(scale, scenes=6, seed=3), speed=1) for scale in (constant, STUDENT_3))
    tables = [
        table.with_columns(tracker=pl.lit(name))
        for name, seen in (("a", one), ("b", other))
        for table in (seen.observations, seen.tracks)
    ]
    observations, tracks = pl.concat(tables[::2]), pl.concat(tables[1::2])
    rows = shaped(Trimmed(prepare_sequence(observations, tracks), one.trims)).gaussianity.filter(
        trimming="untrimmed", age_low=1
    )
    assert rows.select("tracker", "verdict").rows() == [("a", "Gaussian"), ("b", "heavy-tailed")]


def test_frames_are_banded_by_their_distance_from_the_key_frame(see_errors) -> None:
    seen = see_errors(errors(constant, scenes=6, seed=4))
    moments = scene_moments(prepare_observations(seen.observations, axis="frame"))
    singles = samples(prepare_sequence(seen.observations, seen.tracks, key_frame=3))
    found = gaussianity(moments, singles, key_frames={"forward": 3}, n_draws=50).gaussianity
    # three frames before and four after, of which frame 0 has no errors that vary
    assert found.select("age_low", "n").rows() == [
        (1, 6 * 400 * 6),
        (1, 6 * 360 * 6),
    ]


@pytest.mark.parametrize(("tracks", "scale"), [(10, 1.0), (400, 0.0)])
def test_too_few_errors_or_none_that_vary_leave_it_undecided(see_errors, tracks: int, scale: float) -> None:
    few = [scale * values[:tracks] for values in errors(constant, scenes=6, seed=5)]
    shapes = shaped(see_errors(few), min_features=100)
    assert shapes.gaussianity["verdict"].unique().to_list() == ["undecided"]
    assert shapes.gaussianity["kurtosis"].null_count() == shapes.gaussianity.height
    assert shapes.gaussianity["n"].min() > 0
    assert shapes.radii.is_empty()


def test_without_errors_there_are_no_rows_and_wrong_tables_are_refused() -> None:
    nothing = gaussianity(empty(MOMENTS), empty(SAMPLES))
    assert nothing.gaussianity.equals(empty(GAUSSIANITY))
    with pytest.raises(SchemaError, match="samples: column 0"):
        gaussianity(empty(MOMENTS), empty(SAMPLES).drop("dataset"))


BOUNDS = ["kurtosis_low", "kurtosis_high", "gain_student_low", "gain_student_high", "gain_mixture_low"]


@pytest.mark.parametrize("scenes", [8, 3])
def test_the_kind_that_is_asked_for_changes_bounds_alone_and_is_named(see_errors, found, scenes: int) -> None:
    usual = found(STUDENT_5, scenes).gaussianity
    asked = shaped(see_errors(errors(STUDENT_5, scenes=scenes, seed=1)), kind="percentile").gaussianity
    assert usual["kind"].unique().to_list() == ["bca"]  # in place of Student's, which these statistics rule out
    assert asked["kind"].unique().to_list() == ["percentile"]
    values = ["skewness", "kurtosis", "gain_student_nats", "gain_mixture_nats", "tail_99", "student_nu"]
    assert usual.select(values).equals(asked.select(values))
    for bound in BOUNDS:
        assert (usual[bound] != asked[bound]).all()


def test_bca_and_student_are_the_same_here(see_errors, found) -> None:
    asked = shaped(see_errors(errors(STUDENT_5, scenes=8, seed=1)), kind="bca")
    assert asked.gaussianity.equals(found(STUDENT_5).gaussianity)
