import numpy as np
import polars as pl
import pytest
from tests.noise_models.simulated_tracks import error_tracks, sums_of

from tracknoise.findings.sampling.units import units_of
from tracknoise.noise_models.factors import log_factor
from tracknoise.noise_models.fitting.components import fit_components
from tracknoise.noise_models.fitting.conditions import candidates, conditions_of
from tracknoise.noise_models.fitting.equations import COLUMNS
from tracknoise.statistics.covariates import class_of
from tracknoise.statistics.error_products import products
from tracknoise.tables.enumerations import Product

N_TRACKS, MOST, SCENES = 400, 12, 8


def table(scene: str, name: str, tracks, covariate: np.ndarray) -> pl.DataFrame:
    """Rows of `NOISE_COVARIATES` of one scene."""
    changes = dict(products(tracks))[Product.change]
    values = covariate[tracks.track, tracks.frame]
    classes = [class_of(values[changes.rows - back]) for back in (1, 0)]
    columns = {
        "before": classes[0],
        "now": classes[1],
        "squares": 0.5 * (changes.values[:, 0] + changes.values[:, 2]),
        "white_before": changes.factors[:, 1] - 1.0,
        "walk": changes.factors[:, 2],
        "drift": changes.factors[:, 3],
    }
    grouped = pl.DataFrame(columns).group_by("before", "now").agg(pl.len().alias("n"), pl.all().sum())
    return grouped.with_columns(scene=pl.lit(scene), covariate=pl.lit(name))


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
    (kept,) = conditions_of(covariates, fitted, level=0.95)
    assert kept.of == "texture"
    places = np.exp([-1.0, 0.0, 1.0])
    np.testing.assert_allclose(np.diff(log_factor(kept, places)), -0.8, atol=0.25)
    permuted = next(one for one in candidates(covariates, fitted, level=0.95) if one.of == "permuted")
    assert permuted.gain.value < 0.005


def test_the_gain_is_what_theory_says() -> None:
    # walks of variance q f: a Gaussian with the mean variance loses log(mean f) - mean(log f) nat per change
    fitted, covariates = simulated(-0.8, walk=0.1)
    (kept,) = conditions_of(covariates, fitted, level=0.95)
    variance = 0.8**2 * (1.0 + 0.5**2)
    assert kept.gain.value == pytest.approx(variance / 2, rel=0.2)
    assert kept.gain.low < kept.gain.value < kept.gain.high


def test_noise_that_depends_on_nothing_has_no_conditions() -> None:
    fitted, covariates = simulated(0.0, white=0.3)
    assert conditions_of(covariates, fitted, level=0.95) == ()


def test_classes_are_half_octaves() -> None:
    assert class_of(np.array([1.0, 1.5, 2.0, 0.5, 0.0, 1e30])).tolist() == [0, 1, 2, -2, -40, 40]
