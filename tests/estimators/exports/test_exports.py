"""Each export, parsed as its estimator parses it, and with the numbers that it should have."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, f
from tests.estimators.exports.golden import NAMES, contents, stored
from tests.estimators.exports.models import component, detections, equivalents, kernels, lucas_kanade
from tests.estimators.exports.syntaxes import PARSERS

from tracknoise.estimators.advice import Advice, Gate
from tracknoise.estimators.export_render import export, number
from tracknoise.estimators.exports import (
    FAMILIES,
    Export,
    FocalChange,
    RateChange,
    Target,
    estimator,
    estimator_name,
    estimators,
    refused,
)
from tracknoise.estimators.model import Bias, BiasKind, Landmark, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError, UnknownNameError

CPP = Path(__file__).with_name("cpp")
COMPILER = shutil.which("g++")
HOSTILE = 'a\\\n*/ -->--> """ \' ; } "$(x)" \r{{ 1 }} {% x %}.json'


def made(name: str, *, model: object = None, **more: object) -> Export:
    return export(model or lucas_kanade(), name, source="lk.noise.json", **more)  # type: ignore[arg-type]


def values(name: str, file: str, **more: object) -> dict:
    return PARSERS[file](made(name, **more).files[file])


def sigma(landmark: Landmark = Landmark.FREE, purpose: Purpose = Purpose.NEWEST_POSE, window: int = 11) -> float:
    return lucas_kanade().equivalent(landmark=landmark, purpose=purpose, window=window).sigma.value


def advised(name: str, model: NoiseModel | None = None) -> Advice:
    return (model or lucas_kanade()).advise(name)


def rounded(value: float) -> object:
    """Files have three digits."""
    return pytest.approx(value, rel=5.1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_as_last_looked_at(name):
    assert contents(name, made(name)) == stored(name)


def test_the_estimators_of_the_specification():
    wanted = (
        "filter sliding_window mapping pnp "
        "openvins kimera basalt xivo rovio msckf_vio vins vins_fusion okvis2 orbslam3 stella svo maplab rtabmap "
        "opensfm hybvio cuvslam gtsam colmap pyceres symforce theseus pypose filterpy csv json"
    )
    assert set(estimators()) == set(wanted.split())
    assert set(refused()) == {"dso", "dm_vio", "pixsfm"}


@pytest.mark.parametrize("name", NAMES)
def test_all_that_must_be_said_is_said(name):
    about, found = estimator(name), made(name)
    assert about.family in FAMILIES
    assert about.unit in found.text
    assert about.place in found.text
    assert bool(about.checked_against) != (about.family == "kinds")
    assert all(source in found.text for source in about.checked_against)
    assert all(phrase in found.text for phrase in (*about.cannot, *about.without_effect, *about.notes))
    assert any("a bias" in sentence for sentence in found.caveats) != (about.family == "kinds")
    assert all(sentence in found.text for sentence in found.caveats)
    for file, text in found.files.items():
        assert "lk.noise.json sha256" in text
        if file != "basalt_noise.json":  # its parser knows no comments, but a key that it does not read
            assert "tracknoise 0" in "".join(text.splitlines()[:2])
    if about.purpose and about.landmark is not Landmark.KNOWN:
        used = advised(name).sigma
        assert f"{used.value:.3g} px ({used.low:.3g} to {used.high:.3g})" in found.text


@pytest.mark.parametrize("file", PARSERS)
@pytest.mark.parametrize("source", ["lk.noise.json", HOSTILE])
def test_settings_are_parsed(file, source):
    name = next(name for name, about in estimators().items() if file in about.files)
    text = export(lucas_kanade(), name, source=source).files[file]
    flat = list(PARSERS[file](text).values())
    while any(isinstance(value, dict) for value in flat):
        flat = [part for value in flat for part in (without_comment(value) if isinstance(value, dict) else [value])]
    assert flat
    assert all(np.isfinite(float(value)) for value in flat if value not in ("false", "HuberLoss"))


def without_comment(settings):
    return [value for key, value in settings.items() if key != "_comment"]


def test_openvins():
    slam = sigma(window=30)
    square = 0.49 * 2.0 * f.ppf(0.95 * 0.99, 2, 4.0) * 0.15**2 / slam**2  # Student's, of good observations
    track = 1.1 * 0.25 * chi2.ppf(0.8, 19) / chi2.ppf(0.95, 19)
    assert values("openvins", "openvins_noise.yaml") == {
        "up_msckf_sigma_px": rounded(sigma()),
        "up_msckf_chi2_multipler": rounded(track),
        "up_slam_sigma_px": rounded(slam),
        "up_slam_chi2_multipler": rounded(0.1),
    }
    assert track < 0.25
    assert square / chi2.ppf(0.95, 2) < 0.1  # a filter claims as much for errors of predicted poses
    without_outliers = values("openvins", "openvins_noise.yaml", model=lucas_kanade(outlier_share=0.0))
    square *= f.ppf(0.95, 2, 4.0) / f.ppf(0.95 * 0.99, 2, 4.0)
    assert square / chi2.ppf(0.95, 2) > 0.1
    assert without_outliers["up_slam_chi2_multipler"] == rounded(square / chi2.ppf(0.95, 2))


def test_gates_are_those_of_good_tracks_at_true_poses():
    gaussian = values("openvins", "openvins_noise.yaml", model=detections())
    gate = 1.1 * chi2.ppf(0.8, 19) / chi2.ppf(0.95, 19)
    assert gaussian["up_msckf_chi2_multipler"] == rounded(gate)
    assert gaussian["up_slam_chi2_multipler"] == rounded(1.0)
    earlier = tuple(replace(one, gate_80=None) for one in lucas_kanade().equivalents)  # files that have no such gate
    found = values("openvins", "openvins_noise.yaml", model=lucas_kanade(equivalents=earlier))
    expected = 1.2 * 0.25 * chi2.ppf(0.8, 19) / chi2.ppf(0.95, 19)
    assert found["up_msckf_chi2_multipler"] == rounded(expected)


def test_four_of_five_good_tracks_pass_at_true_poses():
    """Innovations of tracks of 19 degrees of freedom."""
    good = tuple(replace(one, gate_80=0.25) for one in lucas_kanade().equivalents)  # noise of half the sigma
    gate = advised("openvins", lucas_kanade(equivalents=good)).gates[Gate.TRACK]
    innovations = 0.25 * np.random.default_rng(0).chisquare(19, 20_000)
    assert (innovations <= gate * chi2.ppf(0.95, 19)).mean() == pytest.approx(0.8, abs=0.02)


def test_on_the_normalised_plane():
    found = values("msckf_vio", "msckf_vio_noise.launch")
    assert found == {"noise/feature": rounded(sigma(window=20) / 458.6)}
    text = made("vins").files["vins_mono_noise.cpp"]
    assert f"sigma_px = {number(advised('vins').sigma.value)}, focal_px = 458.600;" in text


def test_components_where_the_estimator_has_a_place_for_them():
    found = values("rovio", "rovio_noise.info")
    update, walk = found["ImgUpdate"], found["Prediction"]["PredictionNoise"]
    assert float(update["UpdateNoise"]["pix"]) == rounded(0.1**2)
    assert float(update["initCovFeature_1"]) == rounded((0.01 / 458.6) ** 2)
    assert float(walk["nor"]) == rounded(0.08**2 * 20.0 / 458.6**2)
    assert float(update["MahalanobisTh"]) > 9.21
    prior = values("xivo", "xivo_noise.json", model=detections())
    assert prior["initial_std_x"] == prior["initial_std_y"] == rounded(0.4)
    assert prior["subfilter"]["visual_meas_std"] == rounded(0.4)


def test_what_is_written_instead_of_zero_is_stated():
    first, white = (f"no noise of {phrase}: 0.01 px" for phrase in ("a first position", "a single frame"))
    for name in ("rovio", "xivo", "gtsam", "openvins"):
        assert first in made(name).text
        assert white not in made(name).text
    assert white in made("rovio", model=lucas_kanade(white=component(0.0))).text
    for name in ("kimera", "json"):
        assert "written instead" not in made(name).text


def test_what_is_written_instead_of_less_is_stated():
    """The first line of the file says what the model has, and what stands below it."""
    small = lucas_kanade(white=component(0.004), first=component(0.1))
    found = made("rovio", model=small)
    assert "each frame 0.004 px (0.0036 to 0.0044), written as 0.01 px" in found.files["rovio_noise.info"]
    assert "0.004 px noise of a single frame. In directions with less than 0.01 px, 0.01 px are written" in found.text
    assert "first position 0.1 px (0.09 to 0.11), each frame" in found.text
    narrow = lucas_kanade(white=component(0.015, 4.0), first=component(0.1))
    assert "0.015 px noise of a single frame" in made("openvins", model=narrow).text
    assert "single frame" not in made("rovio", model=narrow).text


def test_sigma_and_knee_of_a_loss_are_those_that_were_tried():
    """The largest knee whose errors are within 2 % of the smallest, and the sigma that belongs to it."""
    for name, window, purpose, ratio in (
        ("gtsam", 11, "newest_pose", 0.5),
        ("basalt", 10, "newest_pose", 0.5),
        ("colmap", 30, "all_poses", 0.6),
    ):
        found = advised(name)
        assert found.knee_px == pytest.approx(0.15)
        assert found.sigma.value == pytest.approx(ratio * sigma(purpose=Purpose(purpose), window=window))
        assert found.sigma.low == pytest.approx(0.9 * found.sigma.value)
    settings = values("basalt", "basalt_noise.json")["value0"]
    assert settings["config.vio_obs_huber_thresh"] == rounded(0.15)
    assert settings["config.vio_obs_std_dev"] == rounded(0.5 * sigma(window=10))
    assert f"Cauchy.Create({number(0.15 / (0.5 * sigma()))})" in made("gtsam").files["gtsam_noise.py"]


def test_a_knee_that_an_estimator_fixes_decides_on_sigma():
    found = advised("okvis2")
    assert found.knee_px == pytest.approx(found.sigma.value)
    # r = .5 (knee / .15)^.25 with a knee of r times the sigma of least squares
    assert found.sigma.value == pytest.approx((0.5 * sigma(window=10) * (1 / 0.15) ** 0.25) ** (1 / 0.75), rel=0.01)
    beyond = advised("orbslam3", lucas_kanade(kernels=kernels(15.0)))  # the smallest knee that was tried is 4.5 px
    assert beyond.sigma.value == pytest.approx(0.5 * 0.3**0.25 * sigma(window=10))


def test_models_of_earlier_versions_have_no_loss_for_all_poses():
    earlier = tuple(replace(one, all_poses_ratio=None) for one in lucas_kanade().kernels)
    found = advised("colmap", lucas_kanade(kernels=earlier))
    assert found.is_without_trial
    assert found.sigma.value == pytest.approx(sigma(purpose=Purpose.ALL_POSES, window=30))


def test_without_tried_losses_sigma_is_that_of_least_squares():
    """Residuals would promise too much. They decide on the knee, and with it on the poses."""
    untried = lucas_kanade(kernels=())
    for name, window, purpose, knee in (
        ("gtsam", 11, "newest_pose", 0.15),
        ("basalt", 10, "newest_pose", 1.345 * 0.15),
        ("colmap", 30, "all_poses", 0.15),
        ("okvis2", 10, "newest_pose", sigma(window=10)),
    ):
        found = advised(name, untried)
        assert found.sigma.value == pytest.approx(sigma(purpose=Purpose(purpose), window=window))
        assert (found.knee_px, found.windows) == (pytest.approx(knee), 0)
    written = made("gtsam", model=untried)
    assert "Cauchy loss at 0.5 sigma (not tried)\nright for the covariance of the newest pose" in written.text
    assert "The loss was not tried" in written.text
    assert "not tried" not in made("gtsam").text


def test_a_known_point_leaves_the_whole_error_in_the_image():
    """White noise and first position of .4 px each; the loss takes a part of the claimed information."""
    found = advised("pnp", detections())
    random = np.random.default_rng(0)
    errors = np.sqrt(2.0) * 0.4 * random.standard_normal((400_000, 2))
    square = np.square(errors).sum(axis=1)
    weight = 1.0 / (1.0 + square / found.knee_px**2)
    slope = np.mean(weight - weight**2 * square / found.knee_px**2)  # half the trace of the derivative
    actual = np.mean(weight**2 * square) / 2.0 / slope**2
    assert found.sigma.value**2 == pytest.approx(actual * weight.mean(), rel=0.01)


def test_kimeras_bound_lets_good_tracks_pass():
    bound = values("kimera", "kimera_noise.yaml", model=detections())["outlierRejection"]
    random = np.random.default_rng(0)
    largest = np.linalg.norm(0.4 * random.standard_normal((100_000, 30, 2)), axis=2).max(axis=1)
    assert bound / np.sqrt(1.4) == pytest.approx(np.quantile(largest, 0.999), rel=0.02)


def test_variances_and_shares_of_the_image():
    all_poses = {window: sigma(purpose=Purpose.ALL_POSES, window=window) for window in (10, 30)}
    assert values("rtabmap", "rtabmap_noise.txt")["g2o/PixelVariance"] == rounded(all_poses[10] ** 2)
    assert values("opensfm", "opensfm_noise.yaml")["reprojection_error_sd"] == rounded(0.6 * all_poses[30] / 752)
    assert values("hybvio", "hybvio_noise.txt") == {
        "visualR": rounded(sigma(window=20)),
        "trackChiTestOutlierR": rounded(sigma(window=20) * advised("hybvio").gates[Gate.TRACK] ** 0.5),
    }


def test_window_and_purpose_can_be_chosen():
    chosen = Target(window=20, purpose=Purpose.ALL_POSES)
    found = values("openvins", "openvins_noise.yaml", target=chosen)
    assert found["up_msckf_sigma_px"] == rounded(sigma(purpose=Purpose.ALL_POSES, window=20))
    text = made("openvins", target=chosen).text
    assert (
        "right for the covariance of all poses on average where the gates reject nothing, in windows of 20 frames"
        in text
    )


def test_a_bias_is_stated():
    bias = Bias(kind=BiasKind.ALONG_MOTION, why="scenes agree", per_motion=-0.01)
    assert "The model has a bias" in made("openvins", model=lucas_kanade(bias=bias)).text


@pytest.mark.parametrize("name", NAMES)
def test_python_is_compiled(name):
    for source in ("lk.noise.json", HOSTILE):
        for file, text in export(lucas_kanade(), name, source=source).files.items():
            if file.endswith(".py"):
                compile(text, file, "exec")


def test_the_covariance_of_a_track_in_python_is_that_of_the_model():
    for model in (lucas_kanade(), detections()):
        names: dict = {}
        exec(made("filterpy", model=model).files["filterpy_noise.py"], names)
        depths = np.array([4.0, 3.0, 2.5, 2.4])
        expected = model.track_covariance(np.arange(4), reference="free", magnification=depths[0] / depths)
        expected[:2, :2] = np.maximum(model.first.covariance, 1e-4 * np.eye(2))
        np.testing.assert_allclose(names["track_covariance"](depths), expected, rtol=1e-5, atol=1e-12)


def test_the_covariance_of_an_observation_has_the_variance_of_sigma():
    names: dict = {}
    exec(made("filterpy").files["filterpy_noise.py"], names)
    assert np.trace(names["R"]) / 2.0 == pytest.approx(sigma() ** 2, rel=1e-4)
    assert names["R"][0, 0] > names["R"][1, 1]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """All fragments of C++, with hostile names in their comments, as the files around them include them."""
    folder = tmp_path_factory.mktemp("fragments") / "exported"
    folder.mkdir()
    for name in NAMES:
        found = export(lucas_kanade(), name, source=HOSTILE)
        for file, text in contents(name, found).items():
            (folder / file).write_text(text)
    return folder


def test_all_fragments_have_their_surroundings(exported):
    written = {path.name for path in exported.iterdir() if path.suffix in (".cpp", ".hpp")} | {"openvins.patch"}
    included = {
        found for path in CPP.iterdir() if path.is_file() for found in re.findall('"exported/(.*)"', path.read_text())
    }
    assert written == included


@pytest.mark.skipif(COMPILER is None, reason="no compiler of C++")
@pytest.mark.parametrize("path", sorted(CPP.glob("*.cpp")), ids=lambda path: path.stem)
def test_fragments_are_compiled(exported, path):
    command = [COMPILER, "-std=c++17", "-Wall", "-fsyntax-only", f"-I{CPP}", f"-I{exported.parent}", str(path)]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (found.returncode, "error" in found.stderr) == (0, False), found.stderr


@pytest.mark.skipif(COMPILER is None, reason="no compiler of C++")
def test_the_covariance_of_a_track_in_cpp_is_that_of_the_model(exported, tmp_path):
    program = tmp_path / "program"
    source = CPP / "openvins_track_covariance.cpp"
    command = [COMPILER, "-std=c++17", f"-I{CPP}", f"-I{exported.parent}", str(source), "-o", str(program)]
    subprocess.run(command, check=True)
    printed = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    depths = np.array([4.0, 3.0, 2.5])
    expected = lucas_kanade().track_covariance(np.arange(3), reference="free", magnification=depths[0] / depths)
    expected[:2, :2] = 1e-4 * np.eye(2)
    found = np.array(printed.split(), dtype=float).reshape(6, 6)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12)


@pytest.mark.skipif(COMPILER is None, reason="no compiler of C++")
def test_the_lines_for_orbslam3_need_the_scale_factors_that_its_loop_fills(exported, tmp_path):
    """In place of that loop they would leave variances of 0 at all levels but the first."""
    assert "after the loop" in estimator("orbslam3").place
    program = tmp_path / "program"
    command = [COMPILER, f"-I{CPP}", f"-I{exported.parent}", str(CPP / "orbslam3_noise.cpp"), "-o", str(program)]
    subprocess.run(command, check=True)
    printed = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    expected = advised("orbslam3").sigma.value ** 2 * np.array([1.0, 4.0, 16.0])
    np.testing.assert_allclose(np.array(printed.split(), dtype=float), expected, rtol=1e-2)


def test_all_places_of_cuvslams_constant_are_given():
    """A constant of the source code, which the kernels repeat, and which inertial bundle adjustment divides out."""
    files = made("cuvslam").files
    assert f"constexpr auto stdPx = float{{{number(advised('cuvslam').sigma.value)}f}};" in files["cuvslam_sigma.cpp"]
    assert "libs/camera/observation.cpp" in files["cuvslam_sigma.cpp"]
    information = re.search(r"= 1\.f / \((.*)f \* (.*)f\);", files["cuvslam_kernels.cpp"])
    assert information is not None
    assert float(information[1]) == float(information[2]) == rounded(advised("cuvslam").sigma.value)
    assert f"robustifier_scale = {number(advised('cuvslam').knee ** 2)}f;" in files["cuvslam_bundle.cpp"]
    assert "visual_noise_px = 3.0f;" in files["cuvslam_bundle.cpp"]
    assert "closed" not in made("cuvslam").text


@pytest.mark.skipif(shutil.which("patch") is None, reason="no patch")
def test_the_patch_of_msckf_vio_applies(tmp_path):
    before = {
        221: "      boost::math::quantile(chi_squared_dist, 0.05);",
        1110: "    if (gatingTest(H_xj, r_j, cam_state_ids.size()-1)) {",
        1254: "    if (gatingTest(H_xj, r_j, involved_cam_state_ids.size())) {",
    }
    file = tmp_path / "src" / "msckf_vio.cpp"
    file.parent.mkdir()
    file.write_text("".join(f"{before.get(line, '//')}\n" for line in range(1, 1300)))
    patch = export(lucas_kanade(), "msckf_vio", source=HOSTILE).patch
    subprocess.run(["patch", "-p1"], input=patch, text=True, check=True, cwd=tmp_path, stdout=subprocess.DEVNULL)
    after = file.read_text().splitlines()
    factor, quantile = after[220].split(" * ")
    assert 0.0 < float(factor) < 1.0
    assert quantile == "boost::math::quantile(chi_squared_dist, 0.95);"
    assert after[1109] == after[1253] == "    if (gatingTest(H_xj, r_j, r_j.rows())) {"


@pytest.mark.parametrize("name", ["dso", "DM-VIO", "pixsfm", "Pixel-Perfect SfM"])
def test_estimators_without_noise_of_tracks_are_refused(name):
    with pytest.raises(SettingsError, match=r": It[s ]"):
        made(name)


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("vins-mono", "vins"),
        ("VINS-Fusion", "vins_fusion"),
        ("vins_fusion", "vins_fusion"),
        ("VinsMono", "vins"),
        ("orb-slam3", "orbslam3"),
        ("ORB_SLAM3", "orbslam3"),
        ("ORB SLAM 2", "orbslam3"),
        ("msckf-vio", "msckf_vio"),
        ("MSCKF_VIO", "msckf_vio"),
        ("OpenVINS", "openvins"),
        ("open_vins", "openvins"),
        ("Kimera-VIO", "kimera"),
        ("RTAB-Map", "rtabmap"),
        ("Stella-VSLAM", "stella"),
        ("SVO Pro", "svo"),
        ("OKVIS2-X", "okvis2"),
        ("pycolmap", "colmap"),
        ("PyCuVSLAM", "cuvslam"),
    ],
)
def test_names_are_understood_as_they_are_spelled(written, name):
    assert estimator(written) is estimators()[name]


def test_titles_are_names_too_and_no_two_estimators_have_the_same_name():
    every = {**estimators(), **refused()}
    plain = [re.sub(r"[\W_]", "", alias).lower() for name, about in every.items() for alias in {name, *about.aliases}]
    assert len(set(plain)) == len(plain)
    for name, about in estimators().items():
        for title in (
            []
            if name in ("csv", "json", "pyceres") or about.family == "kinds"
            else re.sub(r" \(.*", "", about.title).split(", ")
        ):
            assert estimator_name(title) == name


@pytest.mark.parametrize(
    ("written", "meant"),
    [("openvin", "openvins"), ("OpenVINZ", "openvins"), ("vins-mno", "vins-mono"), ("orbslam", "orbslam3")],
)
def test_an_unknown_estimator_names_the_known(written, meant):
    with pytest.raises(UnknownNameError, match=f"did you mean '{meant}'.*; known: basalt, .*vins, vins-mono"):
        made(written)


def test_a_model_exports_itself():
    target = Target(window=20)
    assert lucas_kanade().export("openvins", target=target) == export(lucas_kanade(), "openvins", target=target)


RUNS = {
    "gtsam": "observation_noise(), smart_noise(), track_noise([4.0, 3.0, 2.5])",
    "filterpy": "R, track_covariance([4.0, 3.0, 2.5])",
    "symforce": "whitened.__doc__, noise",
}


@pytest.mark.parametrize("name", RUNS)
def test_python_runs_with_the_library(name):
    pytest.importorskip(name)
    names: dict = {}
    exec(made(name).files[f"{name}_noise.py"], names)
    assert eval(RUNS[name], names)


def test_colmap_adjusts_with_what_is_exported():
    colmap = pytest.importorskip("pycolmap")
    names: dict = {}
    exec(made("colmap").files["colmap_noise.py"], names)
    adjusted = _reconstruction(colmap)
    options = colmap.BundleAdjustmentOptions()
    names["set_loss"](options)
    assert options.ceres.loss_function_type == colmap.LossFunctionType.CAUCHY
    chosen = colmap.BundleAdjustmentConfig()
    for image in adjusted.reg_image_ids():
        chosen.add_image(image)
    chosen.fix_gauge(colmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    work = colmap.create_default_ceres_bundle_adjuster(options, chosen, adjusted)
    work.solve()
    found = colmap.estimate_ba_covariance(colmap.BACovarianceOptions(), adjusted, work)
    last = max(adjusted.reg_image_ids())
    assert np.allclose(names["pose_covariance"](found, last), 0.178**2 * found.get_cam_cov_from_world(last))


def test_ceres_takes_observations_with_what_is_exported():
    ceres, colmap = pytest.importorskip("pyceres"), pytest.importorskip("pycolmap")
    names: dict = {}
    exec(made("pyceres").files["pyceres_noise.py"], names)
    seen = _reconstruction(colmap)
    image = seen.images[max(seen.reg_image_ids())]
    problem, points = ceres.Problem(), [point for point in image.points2D if point.has_point3D()]
    for point in points:
        names["add_observation"](problem, point.xy - 0.5, seen.points3D[point.point3D_id], image, image.camera)
    assert problem.num_residual_blocks() == len(points) > 50


def test_pypose_finds_a_pose_beside_outliers_with_what_is_exported():
    torch, pose = pytest.importorskip("torch"), pytest.importorskip("pypose")
    names: dict = {}
    exec(made("pypose").files["pypose_noise.py"], names)
    rng = np.random.default_rng(0)
    points = torch.tensor(rng.uniform((-2.0, -1.5, 3.0), (2.0, 1.5, 8.0), (80, 3)), dtype=torch.float32)
    true = pose.se3(torch.tensor([[0.1, -0.05, 0.2, 0.02, -0.03, 0.01]])).Exp()

    def projected(camera):
        seen = camera.Act(points)
        return 300.0 * seen[..., :2] / seen[..., 2:]

    uv = projected(true) + torch.tensor(rng.normal(0.0, 0.15, (80, 2)), dtype=torch.float32)
    uv[:8] += 30.0

    class Reprojection(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.pose = pose.Parameter(pose.identity_SE3(1))

        def forward(self):
            return projected(self.pose) - uv

    model = Reprojection()
    optimiser = names["optimiser"](model)
    for _ in range(15):
        optimiser.step(input=())
    assert float((model.pose.Inv() @ true).Log().tensor().detach().norm()) < 0.01
    assert names["track_information"]([4.0, 3.0, 2.5]).shape == (6, 6)


def _reconstruction(colmap):
    options = colmap.SyntheticDatasetOptions()
    options.num_frames_per_rig, options.num_points3D = 6, 200
    return colmap.synthesize_dataset(options)


def test_a_sigma_of_zero_is_refused():
    exact = lucas_kanade(equivalents=equivalents(0.0, 0.5))
    with pytest.raises(SettingsError, match="newest_pose, windows of 11 frames, is 0 px, expected a number above 0"):
        made("openvins", model=exact)
    assert made("json", model=exact).files


def test_without_errors_the_reason_is_that_no_noise_was_measured():
    none = dict.fromkeys(("first", "white", "walk", "drift"), component(0.0))
    exact = lucas_kanade(**none, equivalents=equivalents(0.0, 0.5))
    for name in ("openvins", "gtsam", "pnp"):
        with pytest.raises(SettingsError, match="no noise of lucas-kanade was measured: found components of 0 px only"):
            advised(name, exact)


def test_a_reason_needs_a_number():
    with pytest.raises(SettingsError, match="no focal length"):
        Target(focal_change=FocalChange.LENS)
    with pytest.raises(SettingsError, match="no rate"):
        Target(rate_change=RateChange.THINNED, focal_px=458.6)


def test_a_window_has_two_frames():
    with pytest.raises(SettingsError, match="window is 1, expected a whole number of at least 2"):
        Target(window=1)


def test_names_as_people_write_them():
    assert made("MSCKF-VIO").files == made("msckf_vio").files


def test_numbers_are_read_alike_everywhere():
    assert [number(value) for value in (0.1, 2.0, 123.4, 1234.5, 1e-5, 0.0)] == [
        "0.100",
        "2.00",
        "123.0",
        "1.23e+03",
        "1.00e-05",
        "0.00",
    ]
