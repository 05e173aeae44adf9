from itertools import combinations

import numpy as np
import polars as pl
import pytest
from tests.estimators.simulated_tracks import error_tracks, sums_of

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS, fit_components
from tracknoise.estimators.model import log_factor
from tracknoise.estimators.run_time_conditions import candidates, conditions_of, second_candidates
from tracknoise.inference.units import NO_GROUPS, SceneGroups
from tracknoise.statistics.noise_sums import ErrorTracks, class_of, products
from tracknoise.tables.enumerations import Product
from tracknoise.tables.schema import NOISE_PAIRS, empty

N_TRACKS, MOST, SCENES = 400, 12, 8
NO_PAIRS = empty(NOISE_PAIRS)


def summed(tracks: ErrorTracks, classes: dict[str, np.ndarray]) -> pl.DataFrame:
    """Sums over changes by these classes of all observations, at both ends."""
    changes = dict(products(tracks))[Product.change]
    ends = {"before": changes.rows - 1, "now": changes.rows}
    keys = {f"{name}{end}": values[rows] for name, values in classes.items() for end, rows in ends.items()}
    sums = {
        "squares": 0.5 * (changes.values[:, 0] + changes.values[:, 2]),
        "white_before": changes.factors[:, 1] - 1.0,
        "walk": changes.factors[:, 2],
        "drift": changes.factors[:, 3],
    }
    return pl.DataFrame({**keys, **sums}).group_by(*keys).agg(pl.len().alias("n"), pl.all().sum())


def table(scene: str, name: str, tracks: ErrorTracks, covariate: np.ndarray) -> pl.DataFrame:
    """Rows of `NOISE_COVARIATES` of one scene."""
    found = summed(tracks, {"": class_of(covariate[tracks.track, tracks.frame])})
    return found.with_columns(scene=pl.lit(scene), covariate=pl.lit(name))


def pair_table(scene: str, names: tuple[str, str], tracks: ErrorTracks, both: tuple[np.ndarray, ...]) -> pl.DataFrame:
    """Rows of `NOISE_PAIRS` of one scene."""
    classes = [class_of(covariate[tracks.track, tracks.frame]) // 2 for covariate in both]
    found = summed(tracks, dict(zip(("first_", "second_"), classes, strict=True)))
    return found.with_columns(scene=pl.lit(scene), first=pl.lit(names[0]), second=pl.lit(names[1]))


def simulated(power: float, **planted: float):
    """Fitted components, and covariates: `texture`, on which variances depend by this power, and it `permuted`."""
    random = np.random.default_rng(2)
    sums, covariates = [], []
    for number in range(SCENES):
        texture = np.exp(random.normal(0.0, 1.0, (N_TRACKS, 1)) + random.normal(0.0, 0.5, (N_TRACKS, MOST)))
        tracks = error_tracks(random, n_tracks=N_TRACKS, most=MOST, factor=texture**power, **planted)
        permuted = random.permutation(texture.ravel()).reshape(texture.shape)
        sums.append(sums_of(f"{number}", tracks))
        covariates += [
            table(f"{number}", name, tracks, x) for name, x in (("texture", texture), ("permuted", permuted))
        ]
    units = units_of(pl.concat(sums), points=["product", "age"], columns=COLUMNS)
    return fit_components(units, level=0.95), pl.concat(covariates, how="diagonal")


@pytest.mark.parametrize("planted", [{"white": 0.3}, {"walk": 0.1}, {"white": 0.2, "walk": 0.1}], ids=str)
def test_planted_factors_come_back_and_permuted_ones_gain_nothing(planted: dict[str, float]) -> None:
    fitted, covariates = simulated(-0.8, **planted)
    (kept,) = conditions_of(covariates, NO_PAIRS, fitted, level=0.95)
    assert kept.of == "texture"
    places = np.exp([-1.0, 0.0, 1.0])
    np.testing.assert_allclose(np.diff(log_factor(kept, places)), -0.8, atol=0.25)
    permuted = next(one for one in candidates(covariates, fitted, level=0.95) if one.of == "permuted")
    assert permuted.gain.value < 0.005


def test_the_gain_is_what_theory_says() -> None:
    # walks of variance q f: a Gaussian with the mean variance loses log(mean f) - mean(log f) nat per change
    fitted, covariates = simulated(-0.8, walk=0.1)
    (kept,) = conditions_of(covariates, NO_PAIRS, fitted, level=0.95)
    variance = 0.8**2 * (1.0 + 0.5**2)
    assert kept.gain.value == pytest.approx(variance / 2, rel=0.2)
    assert kept.gain.low < kept.gain.value < kept.gain.high


def test_noise_that_depends_on_nothing_has_no_conditions() -> None:
    fitted, covariates = simulated(0.0, white=0.3)
    assert conditions_of(covariates, NO_PAIRS, fitted, level=0.95) == ()


def test_a_factor_changes_in_the_direction_that_its_covariate_means() -> None:
    fitted, covariates = simulated(-0.8, white=0.3)
    falling = covariates.filter(pl.col("covariate") == "texture")
    named = {name: falling.with_columns(covariate=pl.lit(name)) for name in ("motion_px", "lk_min_eigenvalue")}
    (against,), (along,) = (candidates(table, fitted, level=0.95) for table in named.values())
    assert (np.diff(against.log_factor) >= 0.0).all()
    assert against.gain.value < 0.01
    assert (np.diff(along.log_factor) <= 0.0).all()
    assert along.gain.low > 0.01


def test_scenes_of_a_group_are_left_out_together() -> None:
    fitted, covariates = simulated(-0.8, white=0.3)
    texture = covariates.filter(pl.col("covariate") == "texture").with_columns(dataset=pl.lit("d"))
    copied = pl.concat([texture, texture.with_columns(scene=pl.col("scene") + "-again")])
    scenes = texture["scene"].unique().to_list()
    groups = SceneGroups({("d", scene + end): scene for scene in scenes for end in ("", "-again")})
    (once,), (apart,), (together,) = (
        candidates(table, fitted, groups=one, level=0.95)
        for table, one in ((texture, NO_GROUPS), (copied, NO_GROUPS), (copied, groups))
    )
    assert together.gain.low == pytest.approx(once.gain.low, rel=1e-3)
    assert together.gain.high - together.gain.low > 1.3 * (apart.gain.high - apart.gain.low)
    two = SceneGroups({("d", scene): str(int(scene) % 2) for scene in scenes})
    assert candidates(texture, fitted, groups=two, level=0.95) == [once]  # too few groups: scenes are left out


@pytest.fixture(scope="module")
def two():
    """Fitted components, covariates and pairs: walks depend on `texture` and on `motion_px`, not on `permuted`."""
    random = np.random.default_rng(4)
    sums, covariates, pairs = [], [], []
    for number in range(SCENES):
        texture, motion = (
            np.exp(random.normal(0.0, 1.0, (N_TRACKS, 1)) + random.normal(0.0, 0.5, (N_TRACKS, MOST))) for _ in range(2)
        )
        tracks = error_tracks(random, n_tracks=N_TRACKS, most=MOST, factor=motion**0.6 / texture**0.8, walk=0.1)
        values = {"motion_px": motion, "texture": texture}
        values["permuted"] = random.permutation(motion.ravel()).reshape(motion.shape)
        sums.append(sums_of(f"{number}", tracks))
        covariates += [table(f"{number}", name, tracks, each) for name, each in values.items()]
        pairs += [
            pair_table(f"{number}", names, tracks, tuple(values[name] for name in names))
            for names in combinations(values, 2)
        ]
    units = units_of(pl.concat(sums), points=["product", "age"], columns=COLUMNS)
    return fit_components(units, level=0.95), pl.concat(covariates), pl.concat(pairs)


def test_two_planted_factors_come_back_together(two) -> None:
    fitted, covariates, pairs = two
    kept = conditions_of(covariates, pairs, fitted, level=0.95)
    assert [one.of for one in kept] == ["texture", "motion_px"]
    places = np.exp([-1.0, 0.0, 1.0])
    for one, power in zip(kept, (-0.8, 0.6), strict=True):
        np.testing.assert_allclose(np.diff(log_factor(one, places)), power, atol=0.25)
        assert one.gain.value == pytest.approx(power**2 * (1.0 + 0.5**2) / 2, rel=0.25)
    assert conditions_of(covariates, NO_PAIRS, fitted, level=0.95)[0].gain == kept[0].gain


def test_a_permuted_second_factor_gains_nothing(two) -> None:
    fitted, covariates, pairs = two
    first = next(one for one in candidates(covariates, fitted, level=0.95) if one.of == "texture")
    found = second_candidates(pairs, first, fitted, level=0.95)
    assert {both[1].of for both in found} == {"motion_px", "permuted"}
    (permuted,) = (both[1] for both in found if both[1].of == "permuted")
    assert abs(permuted.gain.value) < 0.005


def test_what_two_covariates_have_in_common_counts_once(two) -> None:
    fitted, covariates, pairs = two
    first = next(one for one in candidates(covariates, fitted, level=0.95) if one.of == "texture")
    copied = pairs.filter(pl.col("first") == "motion_px", pl.col("second") == "texture").with_columns(
        first=pl.lit("copy"), first_before="second_before", first_now="second_now"
    )
    ((_, copy),) = second_candidates(copied, first, fitted, level=0.95)
    assert abs(copy.gain.value) < 0.005


def test_classes_are_half_octaves() -> None:
    assert class_of(np.array([1.0, 1.5, 2.0, 0.5, 0.0, 1e30])).tolist() == [0, 1, 2, -2, -40, 40]
