import json
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.estimators.exports.models import lucas_kanade
from tests.estimators.models import TEXTURE, made

import tracknoise as tn
from tracknoise.cli.noise import _stems
from tracknoise.cli.terminal import WIDTH
from tracknoise.estimators.cpp_header import cpp_header
from tracknoise.estimators.equivalents import LENGTHS
from tracknoise.estimators.exports import in_words
from tracknoise.estimators.model import BiasKind, Landmark, Purpose
from tracknoise.estimators.training import training_tables
from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError
from tracknoise.report.noise_cells import model_sentences
from tracknoise.tables.store import RunFolder

MIDDLE = ((0.09 + 0.04) / 2) ** 0.5


@pytest.fixture
def model(planted_model: tn.NoiseModel) -> tn.NoiseModel:
    return planted_model


def test_planted_noise_comes_back(model: tn.NoiseModel) -> None:
    np.testing.assert_allclose(np.diag(model.white.covariance), [0.09, 0.04], rtol=0.05)
    assert model.white.sigma.low < MIDDLE < model.white.sigma.high
    for name in ("first", "walk", "drift"):
        assert getattr(model, name).why_dropped is not None
        assert not getattr(model, name).covariance.any()
    assert model.outlier_share == 0.0
    assert model.outliers_beyond_px == pytest.approx(10 * MIDDLE, rel=0.1)
    assert (model.tails.nu, model.tails.core_ratio) == (math.inf, 1.0)
    assert model.tails.core_sigma == pytest.approx(MIDDLE, rel=0.05)
    assert model.truth_floor_px == 0.0


def test_nothing_is_corrected_and_no_condition_is_kept_in_exact_simulations(model: tn.NoiseModel) -> None:
    assert model.bias.kind is BiasKind.REFUSED
    assert abs(model.bias.reduction.value) < 0.01
    assert model.conditions == ()


def test_training_and_camera_are_those_of_the_run(model: tn.NoiseModel) -> None:
    assert model.training.tracker_settings["options"]["n_features"] == 120
    assert len(model.training.scenes) == 8
    assert model.training.ages[0] == 1
    assert (model.camera.width, model.camera.height) == (160, 120)
    assert model.camera.focal_px == pytest.approx(80 / math.tan(math.radians(30)), rel=1e-6)


def test_white_noise_has_one_sigma_for_free_landmarks(model: tn.NoiseModel) -> None:
    assert len(model.equivalents) == len(LENGTHS) * (len(Landmark) - 1) * len(Purpose)  # none for known points
    for length in (5, 10, 11):
        sigmas = {purpose: model.sigma(window=length, purpose=purpose).value for purpose in Purpose}
        # the first position of an oracle has no noise, which an estimator of one sigma does not know
        assert 0.75 * MIDDLE < sigmas[Purpose.INNOVATIONS] < 1.01 * MIDDLE
    state = model.equivalent(landmark=Landmark.STATE, window=10, purpose=Purpose.NEWEST_POSE)
    assert 0.2 < state.sigma.value < 1.01 * MIDDLE  # noise in v turns poses, and has 0.2 px
    assert state.sigma.low < state.sigma.value < state.sigma.high
    # most tracks began before the window: their first observation there has noise, and is taken as exact
    exact = model.equivalent(landmark=Landmark.EXACT, window=10, purpose=Purpose.NEWEST_POSE)
    assert math.sqrt(2) * state.sigma.value < exact.sigma.value < 2.02 * MIDDLE


def test_speeds_are_fitted_apart_and_agree(fast_model: tn.NoiseModel, model: tn.NoiseModel) -> None:
    assert fast_model.training.speed == 2
    assert fast_model.white.sigma.value == pytest.approx(model.white.sigma.value, rel=0.05)


def test_only_the_named_scenes_are_fitted_to(planted_run: Path, model: tn.NoiseModel) -> None:
    some = tn.NoiseModel.fit(planted_run, tracker="oracle", scenes=model.training.scenes[:2])
    assert some.training.scenes == model.training.scenes[:2]
    assert some.training.n_tracks < model.training.n_tracks / 2
    assert some.white.sigma.low < some.white.sigma.value < some.white.sigma.high  # blocks of tracks are resampled


def test_groups_are_those_of_the_experiment_and_scales_of_tracks_need_sampled_tracks(
    planted_run: Path, model: tn.NoiseModel, tmp_path: Path
) -> None:
    folder = RunFolder(shutil.copytree(planted_run, tmp_path / "run"))
    text = folder.experiment_toml().replace("[dataset]", "[dataset]\ngroups = {}", 1)
    manifest = folder.manifest()
    folder.replace_experiment(text, manifest)
    del next(iter(manifest.sequences.values())).sha256["track_errors"]
    folder.write_manifest(manifest)
    known, found = (training_tables(one, tracker="oracle", speed=1).groups for one in (RunFolder(planted_run), folder))
    assert set(known.names.values()) == {"sideways", "forward"}
    assert found.names == {}
    other = tn.NoiseModel.fit(folder.path, tracker="oracle")
    assert model.track_scale is not None
    assert other.track_scale is None
    wide, narrow = model.white.sigma, other.white.sigma
    assert wide.value == narrow.value
    assert wide.low != narrow.low


def test_what_is_not_in_the_run_is_refused(planted_run: Path) -> None:
    with pytest.raises(UnknownNameError, match="oracle"):
        tn.NoiseModel.fit(planted_run, tracker="orakle")
    with pytest.raises(SettingsError, match="no speed 3 of oracle, expected one of 1, 2"):
        tn.NoiseModel.fit(planted_run, tracker="oracle", speed=3)
    with pytest.raises(UnknownNameError, match="scene"):
        tn.NoiseModel.fit(planted_run, tracker="oracle", scenes=["nowhere"])
    with pytest.raises(SettingsError, match="no scenes to fit to"):
        tn.NoiseModel.fit(planted_run, tracker="oracle", scenes=[])


def test_runs_of_earlier_versions_say_what_is_missing(planted_run: Path, tmp_path: Path) -> None:
    folder = RunFolder(shutil.copytree(planted_run, tmp_path / "run"))
    manifest = folder.manifest()
    for entry in manifest.sequences.values():
        for name in ("noise_sums", "noise_outliers", "noise_covariates", "noise_pairs"):
            del entry.sha256[name]
    folder.write_manifest(manifest)
    assert all(folder.has_sequence(entry) for entry in folder.manifest().sequences.values())
    with pytest.raises(StoreError, match="holds no sums for noise models"):
        tn.NoiseModel.fit(folder.path, tracker="oracle")


def test_commands(planted_run: Path, tmp_path: Path, tracknoise) -> None:
    code, out, _ = tracknoise("noise", "fit", planted_run, "--speed", "1", "-o", tmp_path)
    assert code == 0
    assert "Noise of oracle at speed 1." in out
    assert "each frame (W)" in out
    assert "the interval of its variance reaches 0" in out
    file = tmp_path / "oracle@1.noise.json"
    code, shown, _ = tracknoise("noise", "show", file)
    assert code == 0
    assert shown.strip() in out
    assert max(map(len, shown.splitlines())) <= WIDTH
    assert "gate .80  gate .95  gate .99" in shown
    code, out, _ = tracknoise("noise", "check", file, "--on", planted_run)
    assert code == 0
    assert "agrees with the covariance" in out
    assert "was fitted to 8 of these scenes" in out


def test_a_model_of_other_scenes_is_not_replaced_unless_that_is_asked_for(
    planted_run: Path, tmp_path: Path, tracknoise
) -> None:
    other, command = lucas_kanade(), ("noise", "fit", planted_run, "--speed", "1", "-o", tmp_path)
    other.write(tmp_path / "oracle@1.noise.json")
    code, _, error = tracknoise(*command)
    assert code == 1
    assert "found a model that was fitted to other data (" in error
    assert "expected another folder, or --force" in error
    assert tn.NoiseModel.read(tmp_path / "oracle@1.noise.json").sha256 == other.sha256
    for further in (["--force"], []):  # again: of the same scenes
        assert tracknoise(*command, *further)[0] == 0
        assert tn.NoiseModel.read(tmp_path / "oracle@1.noise.json").training.tracker == "oracle"


def test_a_speed_without_a_model_does_not_stop_the_others(
    planted_run: Path, tmp_path: Path, tracknoise, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = tn.NoiseModel.fit

    def with_few_errors_at_speed_2(run: Path, **options: object) -> tn.NoiseModel:
        if options["speed"] == 2:
            raise SettingsError("found too few errors")
        return fit(run, **options)

    monkeypatch.setattr(tn.NoiseModel, "fit", with_few_errors_at_speed_2)
    code, out, error = tracknoise("noise", "fit", planted_run, "-o", tmp_path)
    anew = "oracle at speed 2: fitted now, because the models of the run are those of speed 1\n"
    assert (code, error) == (0, f"{anew}tracknoise: warning: oracle at speed 2 has no model: found too few errors\n")
    assert "Noise of oracle at speed 1." in out
    assert [path.name for path in tmp_path.iterdir()] == ["oracle@1.noise.json"]
    code, _, error = tracknoise("noise", "fit", planted_run, "--speed", "2", "-o", tmp_path)
    assert (code, error.splitlines()[-1]) == (1, "tracknoise: error: found too few errors")


def test_names_of_trackers_stay_in_the_folder_and_in_the_comment() -> None:
    assert _stems([("lucas-kanade", 1), ("LK (8 px)", 2), ("../a/b", 1), ("a-b", 1), ("/a/b", 1)]) == {
        "lucas-kanade": "lucas-kanade",
        "LK (8 px)": "LK (8 px)",
        "a-b": "a-b",
        "../a/b": "a-b-1",
        "/a/b": "a-b-2",
    }
    model = made(0.1)
    named = replace(model, training=replace(model.training, tracker="lk\nint x = 1; //\\"))
    assert cpp_header(named).startswith("// Noise of lk_int x = 1; //_ at speed 1, by tracknoise. Model ")


def test_commands_refuse_what_they_cannot_do(planted_run: Path, tmp_path: Path, tracknoise) -> None:
    code, _, error = tracknoise("noise", "fit", planted_run, "--tracker", "lk")
    assert (code, "unknown tracker 'lk'" in error) == (1, True)
    code, _, error = tracknoise("noise", "fit", planted_run, "--speed", "7")
    assert (code, "expected one of 1, 2" in error) == (1, True)
    code, _, error = tracknoise("noise", "check", tmp_path / "none.json", "--on", planted_run)
    assert (code, "no such file" in error) == (1, True)
    code, _, error = tracknoise("noise", "check", "--on", planted_run, "--own", "cov", "--tracker", "oracle")
    assert (code, "found no column quality_cov_uu of oracle" in error) == (1, True)
    for option in (("--tracker", "oracle"), ("--speed", "2")):
        code, out, error = tracknoise("noise", "check", tmp_path / "none.json", "--on", planted_run, *option)
        assert (code, out) == (1, "")
        assert f"{option[0]}: found a noise model, which has its own, expected the option with --own alone" in error


def test_header_compiles_and_gives_the_same_numbers(tmp_path: Path, model: tn.NoiseModel) -> None:
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    named_like_a_type = replace(TEXTURE, of="double")
    conditioned = made(0.3, 0.2, 0.1, 0.02, conditions=(TEXTURE, named_like_a_type))
    (tmp_path / "noise.hpp").write_text(cpp_header(conditioned))
    (tmp_path / "main.cpp").write_text(
        '#include "noise.hpp"\n#include <cstdio>\nint main() {\n'
        "  const double f = tracknoise::factor_min_eigenvalue(3.0);\n"
        "  const auto c = tracknoise::covariance(4.0, 1.2, f), d = tracknoise::change_covariance(2.0, f);\n"
        '  const double unknown = tracknoise::factor_min_eigenvalue(std::nan(""));\n'
        "  const double born = tracknoise::covariance(0.0).uu;\n"
        "  const double s = tracknoise::sigma(0.2, 3.0), all = tracknoise::sigma(0.2);\n"
        '  std::printf("[%.9g, %.9g, %.9g, %.9g, %.9g, %.9g, %.9g, %.9g]",'
        " f, c.uu, c.uv, d.vv, unknown, born, s, all);\n}\n"
    )
    warnings = ["-Wall", "-Wextra", "-Werror", "-std=c++11"]
    subprocess.run([compiler, *warnings, "-o", tmp_path / "main", tmp_path / "main.cpp"], check=True)
    printed = json.loads(subprocess.run([tmp_path / "main"], check=True, capture_output=True).stdout)
    covariance = conditioned.covariance(age=4, magnification=1.2, min_eigenvalue=3.0)[0]
    change = conditioned.change_covariance(frames=2, min_eigenvalue=3.0)[0]
    factor = math.exp(1.0 - math.log(3.0))
    expected = [factor, covariance[0, 0], covariance[0, 1], change[1, 1], 1.0, 0.0, 0.2 * factor**0.5, 0.2]
    assert printed == pytest.approx(expected)
    assert len(cpp_header(model).splitlines()) <= 45


def test_windows_that_no_recording_is_long_enough_for_are_said_to_be_simulated(model: tn.NoiseModel) -> None:
    """Recordings of 14 frames."""
    assert {one.window for one in model.equivalents if one.simulated} == {20, 30}
    said = {window: in_words(model.advise("filter", window=window)) for window in (11, 20)}
    assert "in windows of 11 frames" in said[11]
    assert "in simulated windows of 20 frames" in said[20]


def test_an_estimator_without_one_sigma_is_said_to_take_the_components(model: tn.NoiseModel) -> None:
    with pytest.raises(SettingsError, match=r"ROVIO takes no single sigma, .* noise export MODEL --to rovio`"):
        model.advise("rovio")
    assert model_sentences(model, "rovio")[1] == "ROVIO takes the components, which `tracknoise noise export` writes."
