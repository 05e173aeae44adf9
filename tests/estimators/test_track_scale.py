"""Planted worlds: all tracks of one scale, a scale of each track, and noise that depends on reported quality."""

import numpy as np
import polars as pl
import pytest
from scipy import stats
from tests.estimators.models import TEXTURE, component, made
from tests.estimators.simulated_tracks import error_tracks, errors_of, sums_of

from tracknoise.estimators.model import Interval, TrackScale, log_factor
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.track_likelihood import LEAST_NU, TrackErrors, TrackLaw
from tracknoise.estimators.track_scale import fit_track_scale
from tracknoise.exceptions import SettingsError
from tracknoise.inference.units import NO_GROUPS
from tracknoise.report.noise_cells import model_sentences

N_TRACKS, MOST, SCENES = 80, 10, 6
PLANTED = {"first": 0.2, "white": 0.15, "walk": 0.08}


def world(*, power: float = 0.0, nu: float = np.inf, scenes: int = SCENES, seed: int = 3) -> TrackScale:
    """What is found where the variances of W and Q depend on a power of `texture`, and not on `other`."""
    random = np.random.default_rng(seed)
    errors, sums = [], []
    for number in range(scenes):
        texture, other = (np.exp(random.normal(0.0, 0.7, (N_TRACKS, MOST))) for _ in range(2))
        tracks = error_tracks(random, n_tracks=N_TRACKS, most=MOST, factor=texture**power, nu=nu, **PLANTED)
        errors.append(errors_of(f"{number}", tracks, texture=texture, other=other))
        sums.append(sums_of(f"{number}", tracks))
    found = fit_track_scale(pl.concat(errors), pl.concat(sums), (), groups=NO_GROUPS, level=0.95)
    assert found is not None
    return found


def assert_components_are_planted(found: TrackScale) -> None:
    for name, sigma in PLANTED.items():
        interval = getattr(found, name).sigma
        assert interval.value == pytest.approx(sigma, rel=0.1)
        assert interval.low < interval.value < interval.high


def test_tracks_of_one_scale_have_no_scale_of_their_own() -> None:
    found = world()
    assert found.nu is None
    assert "not described better with a scale of each track" in found.why_one_scale
    assert found.conditions == ()
    assert "not described better with it instead of second moments" in found.why_refused
    assert_components_are_planted(found)


def test_a_planted_scale_of_each_track_comes_back() -> None:
    found = world(nu=3.0)
    assert found.nu.low < 3.0 < found.nu.high
    assert found.nu.value == pytest.approx(3.0, rel=0.25)
    assert found.conditions == ()
    assert found.why_refused is None
    assert found.gain.low > 0.5
    assert_components_are_planted(found)


def test_heavy_tails_in_each_frame_are_not_called_a_scale_of_each_track() -> None:
    random = np.random.default_rng(0)
    tracks = [error_tracks(random, white=0.3, factor=3.0 / random.chisquare(3.0, (150, 20))) for _ in range(6)]
    errors = pl.concat([errors_of(f"{number}", one) for number, one in enumerate(tracks)])
    sums = pl.concat([sums_of(f"{number}", one) for number, one in enumerate(tracks)])
    found = fit_track_scale(errors, sums, (), groups=NO_GROUPS, level=0.95)
    assert found is not None
    assert found.nu is not None
    said = " ".join(model_sentences(made(0.3, track_scale=found), "filter"))
    assert "as of a scale for each track, or of heavy tails in each frame" in said


def test_fewer_degrees_of_freedom_than_are_fitted_have_no_interval() -> None:
    found = world(nu=1.0)
    assert found.nu == Interval(value=pytest.approx(LEAST_NU))
    said = " ".join(model_sentences(made(0.3, track_scale=found), "filter"))
    assert "Student's t with at most 2.05 degrees of freedom" in said


def test_a_planted_quality_comes_back_and_another_one_does_not() -> None:
    found = world(power=-0.8)
    assert found.nu is None
    (kept,) = found.conditions
    assert kept.of == "texture"
    assert np.diff(log_factor(kept, np.exp([-0.5, 0.5]))) == pytest.approx(-0.8, abs=0.08)
    assert found.why_refused is None
    assert_components_are_planted(found)


def test_scale_and_quality_come_back_together() -> None:
    found = world(power=-0.8, nu=3.0)
    assert found.nu.value == pytest.approx(3.0, rel=0.25)
    assert [one.of for one in found.conditions] == ["texture"]
    assert np.diff(log_factor(found.conditions[0], np.exp([-0.5, 0.5]))) == pytest.approx(-0.8, abs=0.08)
    assert_components_are_planted(found)


def test_blocks_of_one_scene_are_left_out() -> None:
    found = world(nu=3.0, scenes=1)
    assert found.nu is not None
    assert found.nu.low < 3.0 < found.nu.high


def test_no_errors_and_few_tracks_have_no_law() -> None:
    random = np.random.default_rng(0)
    for tracks in (error_tracks(random), error_tracks(random, n_tracks=20, white=0.3)):
        errors, sums = errors_of("0", tracks), sums_of("0", tracks)
        assert fit_track_scale(errors, sums, (), groups=NO_GROUPS, level=0.95) is None


def drawn() -> TrackErrors:
    """Tracks of different lengths with two covariates, of which some began before."""
    random = np.random.default_rng(5)
    length = random.integers(2, 9, 30)
    track = np.repeat(np.arange(30), length)
    age = np.concatenate([np.arange(one) for one in length]) * 2.0
    born, covariates = random.random(30) < 0.6, random.normal(size=(len(track), 2))
    errors = 0.3 * random.normal(size=(len(track), 2))
    return TrackErrors.of_rows(track, errors, np.exp(0.02 * age), age, born, covariates)


@pytest.mark.parametrize("law", [TrackLaw(0.2, 0.3, 0.1), TrackLaw(0.2, 0.3, 0.1, 3.5, (0.3, -0.2))], ids=str)
def test_derivatives_are_those_of_differences(law: TrackLaw) -> None:
    tracks = drawn().with_covariates(range(len(law.powers)))
    _, slopes = law.with_slopes(tracks)
    steps = 1e-5 * np.eye(len(law.values))
    ends = [[law.with_values(law.values + sign * step).log_likelihoods(tracks) for sign in (1, -1)] for step in steps]
    differences = np.stack([(high - low) / 2e-5 for high, low in ends], axis=1)
    np.testing.assert_allclose(slopes, differences, atol=1e-7)


def test_the_filter_has_the_likelihood_of_the_covariance() -> None:
    tracks = drawn()
    own = tracks.chosen(tracks.born).with_covariates([])
    law = TrackLaw(0.2, 0.3, 0.1)
    dense = own.gaussian(law.noise, np.ones(own.covariates.shape[:2]))
    np.testing.assert_allclose(law.log_likelihoods(own), dense, atol=1e-5)


def scale(**more: object) -> TrackScale:
    parts = {name: component(sigma) for name, sigma in PLANTED.items()}
    gain = Interval(value=1.0, low=0.5, high=1.5)
    return TrackScale(**{"nu": Interval(value=3.0, low=2.5, high=4.0), "gain": gain, **parts, **more})


def test_the_likelihood_is_that_of_student_with_the_scale_matrix() -> None:
    model = made(track_scale=scale())
    ages, carried = np.array([1.0, 2.0, 5.0]), np.array([1.1, 1.2, 1.6])
    errors = np.random.default_rng(2).normal(size=(3, 2))
    matrix = model.scale_matrix(ages, reference="birth", magnification=carried)
    expected = stats.multivariate_t(shape=matrix, df=3.0).logpdf(errors.ravel())
    rows = TrackErrors.of_rows(
        np.zeros(4, dtype=np.intp),
        np.vstack([[0.0, 0.0], errors]),
        np.array([1.0, *carried]),
        np.array([0.0, *ages]),
        np.array([True]),
        np.zeros((4, 0)),
    )
    # what the walk adds in frames without an observation is magnified as in the next observed one, in both
    assert TrackLaw(**PLANTED, nu=3.0).log_likelihoods(rows)[0] == pytest.approx(expected)


def test_a_model_with_a_scale_of_tracks_is_written_and_read(tmp_path) -> None:
    model = made(0.3, 0.2, track_scale=scale())
    model.write(tmp_path / "model.json")
    found = NoiseModel.read(tmp_path / "model.json")
    assert found.text == model.text
    assert found.track_scale.nu == Interval(value=3.0, low=2.5, high=4.0)


def test_files_of_the_earlier_format_have_no_scale_of_tracks() -> None:
    text = (
        made(0.3, 0.2).text.replace("tracknoise.noise/2", "tracknoise.noise/1").replace(' "track_scale": null,\n', "")
    )
    assert "track_scale" not in text
    found = NoiseModel.parse(text, "model.json")
    assert found.track_scale is None
    with pytest.raises(SettingsError, match="no scale of tracks"):
        found.scale_matrix([0, 1])


def test_models_say_what_a_scale_of_each_track_gains() -> None:
    said = " ".join(model_sentences(made(0.3, track_scale=scale(conditions=(TEXTURE,))), "filter"))
    assert (
        "Student's t with 3.00 (2.50 to 4.00) degrees of freedom, as of a scale for each track, or of heavy tails in"
        in said
    )
    assert (
        "Q 0.0800 px per sqrt(frame); W and Q depend on min_eigenvalue. On held-out tracks, this model gains 1.00"
        in said
    )
    said = " ".join(model_sentences(made(0.3, track_scale=scale(nu=None)), "filter"))
    assert "tails are Gaussian: A 0.200 px" in said
    assert "Tails of whole tracks" not in said
    said = " ".join(model_sentences(made(0.3, track_scale=scale(why_refused="scenes do not agree")), "filter"))
    assert "The likelihood of whole tracks is not used: scenes do not agree." in said


def test_a_refused_scale_is_not_used() -> None:
    model = made(0.3, 0.2, track_scale=scale(why_refused="scenes do not agree"))
    with pytest.raises(SettingsError, match="scenes do not agree"):
        model.scale_matrix([0, 1])


def test_the_scale_matrix_is_smaller_than_the_second_moment() -> None:
    """Of the errors of tracks with Student's distribution."""
    random = np.random.default_rng(1)
    tracks = error_tracks(random, n_tracks=20_000, most=4, mean_length=50.0, nu=6.0, **PLANTED)
    last = tracks.error_px[tracks.age == 3.0]
    model = made(track_scale=scale()).scale_matrix([3.0], reference="birth")[0, 0]
    assert model == pytest.approx(PLANTED["first"] ** 2 + PLANTED["white"] ** 2 + 3 * PLANTED["walk"] ** 2)
    assert np.square(last).mean() == pytest.approx(model * 6.0 / 4.0, rel=0.05)
