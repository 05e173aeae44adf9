import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.estimators.models import TEXTURE, made

import tracknoise
from tracknoise.estimators.exports import Target
from tracknoise.estimators.model import Bias, BiasKind, Interval, Landmark, Purpose, Tails
from tracknoise.estimators.noise_model import NoiseModel, document_schema
from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.report.noise_cells import model_sentences

EQUIVALENT = {
    "landmark": "free",
    "purpose": "newest_pose",
    "window": 11,
    "sigma": {"value": 0.3},
    "gate_95": 1.0,
    "gate_99": 1.0,
}
KERNEL = {
    "kind": "cauchy",
    "knee_px": 0.3,
    "windows": 20,
    "sigma_ratio": {"value": 0.8},
    "error_ratio": {"value": 0.9},
}
KNOTS = {"of": "x", "log_knots": [0, 1, 2], "log_factor": [0, 1, 2], "gain": {"value": 0.1}}


def simulated(ages: np.ndarray, magnification: np.ndarray, n: int = 50_000) -> np.ndarray:
    """Errors about birth of many tracks, one coordinate, (n, ages): first .3, white .2, walk .1, drift .02 px."""
    random = np.random.default_rng(7)
    first, drift = 0.3 * random.standard_normal(n), 0.02 * random.standard_normal(n)
    position, found, before = np.zeros(n), [], 0.0
    previous = 1.0
    for age, carried in zip(ages, magnification, strict=True):
        step = 0.1 * np.sqrt(age - before) * random.standard_normal(n)
        position = position * carried / previous + step
        found.append(carried * first + 0.2 * random.standard_normal(n) + position + age * drift)
        before, previous = age, carried
    return np.stack(found, axis=1)


def test_covariance_of_a_track_is_that_of_simulated_ones() -> None:
    ages, magnification = np.array([1.0, 2.0, 5.0]), np.array([1.1, 1.2, 1.6])
    errors = simulated(ages, magnification)
    found = made(0.3, 0.2, 0.1, 0.02).track_covariance(ages, magnification=magnification)
    np.testing.assert_allclose(found[::2, ::2], errors.T @ errors / len(errors), rtol=0.04)
    np.testing.assert_allclose(found[1::2, ::2], 0.0)


def test_free_form_gives_the_first_observation_its_own_error() -> None:
    found = made(0.3, 0.2, 0.1).track_covariance([0, 1, 2], reference="free")
    np.testing.assert_allclose(np.diag(found)[::2], [0.09, 0.05, 0.06])
    np.testing.assert_allclose(found[0, 2:], 0.0)
    np.testing.assert_allclose(found[2, 4], 0.01)


def test_covariances_of_errors_and_changes_agree_with_those_of_tracks() -> None:
    model = made(0.3, 0.2, 0.1, 0.02)
    track = model.track_covariance([1, 2, 3])[::2, ::2]
    np.testing.assert_allclose(model.covariance(age=[1, 2, 3])[:, 0, 0], np.diag(track))
    change = track[2, 2] + track[1, 1] - 2 * track[1, 2]
    np.testing.assert_allclose(model.change_covariance()[0, 0, 0], change)


def test_the_first_position_has_no_error_about_itself() -> None:
    model = made(0.3, 0.2, 0.1, 0.02)
    whole = model.track_covariance([0, 1, 2], magnification=[1.0, 1.1, 1.2])[::2, ::2]
    np.testing.assert_allclose(model.covariance(age=[0, 1])[:, 0, 0], [whole[0, 0], 0.09 + 0.04 + 0.01 + 0.0004])
    assert whole[0, 0] == 0.0


def test_conditions_scale_white_noise_and_walk_only() -> None:
    model = made(0.3, 0.2, 0.1)
    found = model.covariance(age=2, min_eigenvalue=[1.0, math.e, 1e9, np.nan])[:, 0, 0]
    factor = np.exp([1.0, 0.0, -1.0, 0.0])
    np.testing.assert_allclose(found, 0.09 + factor * (0.04 + 2 * 0.01))
    with pytest.raises(UnknownNameError, match="min_eigenvalue"):
        model.covariance(age=2, min_eigenvalues=1.0)


def test_whitened_errors_have_unit_covariance() -> None:
    ages = np.array([1.0, 2.0, 5.0])
    errors = np.kron(simulated(ages, np.ones(3)).T, np.array([[1.0], [0.0]]))
    whitened = made(0.3, 0.2, 0.1, 0.02).whiten(errors, ages, reference="birth")[::2]
    np.testing.assert_allclose(whitened @ whitened.T / errors.shape[1], np.eye(3), atol=0.03)


def test_age_zero_about_birth_cannot_be_whitened() -> None:
    with pytest.raises(SettingsError, match="singular covariance, expected noise"):
        made(0.3, 0.2).whiten(np.zeros(4), [0, 1], reference="birth")


@pytest.mark.parametrize(
    ("ages", "magnification"), [([1, 1], 1.0), ([-1, 1], 1.0), ([1, 2], 0.0), ([], 1.0), ([0, np.nan, 2], 1.0)]
)
def test_impossible_tracks_are_refused(ages: list[float], magnification: float) -> None:
    with pytest.raises(SettingsError, match="expected increasing ages"):
        made(0.1, 0.1).track_covariance(ages, magnification=magnification)


def test_impossible_errors_and_changes_are_refused() -> None:
    for age, magnification in ((-1, 1.0), (np.nan, 1.0), (1, 0.0), (1, -2.0)):
        with pytest.raises(SettingsError, match="expected ages from 0 on, and M > 0"):
            made(0.1, 0.1, 0.1).covariance(age=[1, age], magnification=magnification)
    with pytest.raises(SettingsError, match="found 0 frames in between"):
        made(0.1, 0.1, 0.1).change_covariance(frames=[1, 0])


@pytest.mark.parametrize(
    ("ages", "magnification", "texture", "message"),
    [
        ("abc", 1.0, 1.0, "ages is 'abc', expected numbers"),
        (None, 1.0, 1.0, "ages is None, expected numbers"),
        ([[0, 1]], 1.0, 1.0, "ages: found shape (1, 2), expected one number or (2,)"),
        ([0, math.inf], 1.0, 1.0, "ages: found inf, expected finite numbers"),
        ([0, 1], [1.0], 1.0, "magnification: found shape (1,), expected one number or (2,)"),
        ([0, 1], 1.0, [2.0], "min_eigenvalue: found shape (1,), expected one number or (2,)"),
        ([0, 1], 1.0, [2.0, [1.0]], "min_eigenvalue: setting an array element with a sequence"),
        ([0, 1], 1.0, math.inf, "min_eigenvalue: found inf, expected finite numbers, or NaN where unknown"),
    ],
)
def test_what_a_track_is_asked_with_is_named(ages, magnification, texture, message) -> None:
    with pytest.raises(SettingsError) as caught:
        made(0.1, 0.1).track_covariance(ages, magnification=magnification, min_eigenvalue=texture)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("residuals", "message"),
    [
        (np.zeros((2, 2)), r"residuals: found shape \(2, 2\), expected \(4,\) or \(4, n\): u and v"),
        (np.full(4, np.nan), "residuals: found NaN or infinity, expected finite numbers"),
        (None, "residuals is None, expected numbers"),
        ("x", "residuals is 'x', expected numbers"),
    ],
)
def test_wrong_residuals_are_not_whitened(residuals, message) -> None:
    with pytest.raises(SettingsError, match=message):
        made(0.3, 0.2).whiten(residuals, [0, 1])


@pytest.mark.parametrize("window", [-5, 1, 1.5, True, math.nan, "x"])
def test_a_window_is_a_whole_number_of_at_least_two(window) -> None:
    for ask in (made().sigma, made().advise):
        with pytest.raises(SettingsError, match=r"window is .*, expected a whole number of at least 2"):
            ask(window=window)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"run": None}, "run is None, expected a path"),
        ({"speed": "1"}, "speed is '1', expected a whole number of at least 1"),
        ({"scenes": "forward-00"}, "scenes is 'forward-00', expected a list of names"),
    ],
)
def test_what_is_fitted_is_stated_in_the_right_types(change, message) -> None:
    with pytest.raises(SettingsError, match=message):
        NoiseModel.fit(**{"run": "nothing", "tracker": "lk", **change})


def test_equivalents_are_of_the_nearest_window() -> None:
    model = made()
    assert model.equivalent(landmark=Landmark.FREE, window=11, purpose=Purpose.NEWEST_POSE).window == 10
    assert model.sigma(window=21).value == 0.3
    with pytest.raises(SettingsError, match="no sigma for landmark exact"):
        model.sigma(landmark="exact")
    with pytest.raises(UnknownNameError, match="purpose"):
        model.sigma(purpose="depth")


def test_corrections() -> None:
    uv = np.ones((3, 2))
    np.testing.assert_array_equal(made().correct(uv, [1, 2, 3]), uv)
    aged = Bias(kind=BiasKind.BY_AGE, why="they agree", ages=(2, 4), mean_px=((0.2, 0.0), (0.4, -0.1)))
    found = made(bias=aged).correct(uv, [1, 3, 9])
    np.testing.assert_allclose(found, [[0.9, 1.0], [0.7, 1.05], [0.6, 1.1]])
    along = made(bias=Bias(kind=BiasKind.ALONG_MOTION, why="they agree", per_motion=-0.1))
    np.testing.assert_allclose(along.correct(uv, [1, 2, 3], flow=2 * uv), 1.2)
    moved = along.correct(uv, [0, 0, 3], flow=[[np.nan, np.nan], [2, 2], [2, 2]])
    np.testing.assert_allclose(moved, [[1, 1], [1, 1], [1.2, 1.2]])  # first positions have no error about themselves
    with pytest.raises(SettingsError, match="no flow"):
        along.correct(uv, [1, 2, 3])
    with pytest.raises(SettingsError, match=r"found uv of shape \(3, 2\) and ages of shape \(2,\), expected \(n, 2\)"):
        made().correct(uv, [1, 2])


def test_documents_come_back(tmp_path: Path) -> None:
    model = made(0.3, 0.2, 0.1, 0.02, tails=Tails(nu=math.inf, core_sigma=0.2))
    model.write(tmp_path / "noise.json")
    found = tracknoise.NoiseModel.read(tmp_path / "noise.json")
    assert (found.text, found.sha256) == (model.text, model.sha256)
    np.testing.assert_array_equal(found.white.covariance, model.white.covariance)
    assert found.tails.nu == math.inf
    assert replace(model, outlier_share=0.5).sha256 != model.sha256


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "tracknoise.noise/0"}, "format is 'tracknoise.noise/0', expected 'tracknoise.noise/2'"),
        ({"outlier_shares": 0.1}, "outlier_shares"),
        ({"outlier_share": "much"}, "outlier_share: found 'much'"),
        ({"white": {"covariance": [[1, 2], [2, 1]], "sigma": {"value": 1}}}, "white.covariance: found"),
        ({"white": {"covariance": [[1, 2]], "sigma": {"value": 1}}}, "white.covariance: found"),
        ({"tails": {"nu": -1.0, "core_sigma": 0.1}}, "tails.nu: found -1.0"),
        ({"camera": {"width": 4, "height": 3, "focal_px": 0, "rate_hz": None}}, "camera.focal_px: found 0, expected"),
        ({"conditions": [{**KNOTS, "log_knots": [1, 2]}]}, "expected increasing knots and a factor at each"),
        ({"conditions": [{**KNOTS, "log_knots": [3, 2, 1]}]}, "expected increasing knots and a factor at each"),
        ({"conditions": [{**KNOTS, "log_knots": [], "log_factor": []}]}, "expected increasing knots and a factor"),
        ({"bias": {"kind": "by_age", "why": ""}}, "expected increasing ages and a mean error of each"),
        ({"bias": {"kind": "by_age", "why": "", "ages": [1, 2], "mean_px": [[0, 1]]}}, "a mean error of each"),
        ({"conditions": [{**KNOTS, "of": "x(double v) { return std::system(0); } int y"}]}, "expected of is 'x(double"),
        ({"conditions": [{**KNOTS, "of": "X"}]}, "a name of the form [a-z][a-z0-9_]*"),
        ({"conditions": [{**KNOTS, "log_factor": [0, 1, 1e4]}]}, "logarithm is 10000.0"),
        ({"equivalents": [{**EQUIVALENT, "gate_95": -1.0}]}, "gate_95"),
        ({"equivalents": [{**EQUIVALENT, "sigma": {"value": 1e300}}]}, "sigma is 1e+300"),
        (
            {"equivalents": [{**EQUIVALENT, "sigma": {"value": 0.2, "low": 0.3, "high": 0.1}}]},
            "a lower bound not above",
        ),
        ({"kernels": [{**KERNEL, "sigma_ratio": {"value": -0.8}}]}, "sigma_ratio is -0.8"),
        ({"kernels": [{**KERNEL, "knee_px": 1e300}]}, "knee_px: found 1e+300"),
        ({"walk": {"covariance": [[1e300, 0], [0, 1e300]], "sigma": {"value": 0.1}}}, "covariance is 1e+300"),
        ({"tails": {"nu": 1e-300, "core_sigma": 0.1}}, "tails.nu: found 1e-300"),
        ({"outlier_share": 1.5}, "outlier_share: found 1.5"),
    ],
)
def test_damaged_documents_are_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "noise.json"
    path.write_text(json.dumps({**json.loads(made(0.1).text), **change}))
    with pytest.raises(DataError, match=r"noise\.json") as caught:
        NoiseModel.read(path)
    assert message in str(caught.value)


@pytest.mark.parametrize("estimator", ["filter", "pnp", "rovio", "csv", "gtsam", "openvins"])
@pytest.mark.parametrize("target", [{"rate_hz": 1e-300}, {"rate_hz": 1e300}, {"focal_px": 1e-300}, {"focal_px": 1e300}])
def test_impossible_rates_and_focal_lengths_are_refused(estimator: str, target: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match="expected a number from"):
        made(0.3, 0.2, 0.1).export(estimator, target=Target(**target))


def test_documents_of_earlier_versions_are_read(tmp_path: Path) -> None:
    path = tmp_path / "noise.json"
    document = json.loads(made(0.1).text)
    assert document["common_share"] is None  # as all earlier ones
    earlier = {
        name: value for name, value in document.items() if name not in ("common_share", "kernels", "track_scale")
    }
    depth = {**document["equivalents"][0], "purpose": "depth"}
    earlier |= {"format": "tracknoise.noise/1", "equivalents": [depth, *document["equivalents"]]}
    path.write_text(json.dumps(earlier))
    assert NoiseModel.read(path).text == made(0.1).text


def test_the_share_in_common_is_written_with_its_interval(tmp_path: Path) -> None:
    share = Interval(value=0.1, low=0.05, high=0.2)
    made(0.1, common_share=share).write(tmp_path / "noise.json")
    assert NoiseModel.read(tmp_path / "noise.json").common_share == share


def test_a_second_condition_says_what_it_gains_beyond_the_first() -> None:
    motion = replace(TEXTURE, of="motion_px", gain=Interval(value=0.02))
    first, second = (
        line for line in model_sentences(made(0.1, conditions=(TEXTURE, motion)), "filter") if "nat per" in line
    )
    assert first.endswith("this gains 0.100 nat per change.")
    assert second.endswith("this gains 0.0200 nat per change beyond the first factor.")


def test_what_is_not_json_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "noise.json"
    lone_surrogate = made(0.1).text.replace('"lk"', '"\\ud800"')
    for text in ("{", "[" * 100_000, lone_surrogate):
        path.write_text(text)
        with pytest.raises(DataError, match="is not JSON"):
            NoiseModel.read(path)


def test_schema_in_the_documentation_is_that_of_models() -> None:
    published = Path(__file__).parents[2] / "docs" / "noise-model.schema.json"
    assert published.read_text(encoding="utf-8") == document_schema(NoiseModel)
