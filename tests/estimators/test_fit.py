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
from tracknoise.cli.terminal import WIDTH
from tracknoise.estimators.cpp_header import cpp_header
from tracknoise.estimators.equivalents import LENGTHS, STATE_LENGTH
from tracknoise.estimators.export_render import export
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
    of_all = len(LENGTHS) * (len(Landmark) - 1) * len(Purpose)  # none for known points
    assert len(model.equivalents) == of_all + len(Purpose)
    assert {one.landmark for one in model.equivalents if one.window == STATE_LENGTH} == {Landmark.FREE}
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
    file = tmp_path / "oracle.noise.json"
    code, out, told = tracknoise("export", planted_run, "--to", "text", "--model", file)
    assert (code, told) == (0, f"written: {file}\n")
    assert "Noise of oracle at speed 1." in out
    assert "each frame (W)" in out
    assert "the interval of its variance reaches 0" in out
    code, shown, _ = tracknoise("export", file, "--to", "text")
    assert (code, shown) == (0, out)
    assert "track gate .80  track gate .95  track gate .99" in shown
    prose, _ = shown.split("\n\n", 1)
    assert max(map(len, prose.splitlines())) <= WIDTH
    _, of_run, _ = tracknoise("export", planted_run, "--to", "openvins")
    _, of_model, _ = tracknoise("export", file, "--to", "openvins")
    assert of_run.replace("oracle@1.noise.json", file.name) == of_model
    code, header, _ = tracknoise("export", planted_run, "--to", "cpp")
    assert (code, header.rstrip()) == (0, cpp_header(tn.NoiseModel.read(file)).rstrip())


def test_a_model_of_other_scenes_is_not_replaced_unless_that_is_asked_for(
    planted_run: Path, tmp_path: Path, tracknoise
) -> None:
    file = tmp_path / "oracle.noise.json"
    other, command = lucas_kanade(), ("export", planted_run, "--to", "text", "--model", file)
    other.write(file)
    code, _, error = tracknoise(*command)
    assert code == 1
    assert "found a model that was fitted to other data (" in error
    assert "expected another file, or --force" in error
    assert tn.NoiseModel.read(file).sha256 == other.sha256
    for further in (["--force"], []):  # again: of the same scenes
        assert tracknoise(*command, *further)[0] == 0
        assert tn.NoiseModel.read(file).training.tracker == "oracle"


def test_a_model_that_the_run_did_not_fit_is_fitted_now_and_its_failure_is_said(
    planted_run: Path, tracknoise, monkeypatch: pytest.MonkeyPatch
) -> None:
    def with_few_errors(run: Path, **options: object) -> tn.NoiseModel:
        raise SettingsError("found too few errors")

    monkeypatch.setattr(tn.NoiseModel, "fit", with_few_errors)
    code, _, error = tracknoise("export", planted_run, "--to", "text")
    assert code == 0
    assert error == "", "that of the lowest speed is there"
    code, _, error = tracknoise("export", planted_run, "--to", "text", "--speed", "2")
    anew = "oracle at speed 2: fitted now, because the models of the run are those of speed 1\n"
    assert (code, error) == (1, f"{anew}tracknoise: error: found too few errors\n")


def test_names_of_trackers_stay_in_the_comment() -> None:
    model = made(0.1)
    named = replace(model, training=replace(model.training, tracker="lk\nint x = 1; //\\"))
    assert cpp_header(named).startswith("// Noise of lk_int x = 1; //_ at speed 1, by tracknoise. Model ")


def test_the_text_and_the_header_of_another_model_are_not_replaced(
    planted_run: Path, tmp_path: Path, tracknoise
) -> None:
    other = tmp_path / "other.noise.json"
    lucas_kanade().write(other)
    for form, name in (("text", "noise.txt"), ("cpp", "noise.hpp")):
        assert tracknoise("export", planted_run, "--to", form, "-o", tmp_path)[0] == 0
        assert tracknoise("export", planted_run, "--to", form, "-o", tmp_path)[0] == 0
        code, _, error = tracknoise("export", other, "--to", form, "-o", tmp_path)
        assert (code, f"found {name} of another model" in error) == (1, True)


def test_commands_refuse_what_they_cannot_do(planted_run: Path, tmp_path: Path, tracknoise) -> None:
    code, _, error = tracknoise("export", planted_run, "--to", "text", "--tracker", "lk")
    assert (code, "unknown tracker 'lk'" in error) == (1, True)
    code, _, error = tracknoise("export", planted_run, "--to", "text", "--speed", "7")
    assert (code, "expected one of 1, 2" in error) == (1, True)
    code, _, error = tracknoise("export", tmp_path / "none.json", "--to", "text")
    assert (code, "no such file" in error) == (1, True)


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
    assert {one.window for one in model.equivalents if one.simulated} == {20, 30, STATE_LENGTH}
    said = {window: in_words(model.advise("filter", window=window)) for window in (11, 20)}
    assert "in windows of 11 frames" in said[11]
    assert "in simulated windows of 20 frames" in said[20]


def test_exports_say_where_tracks_are_shorter_than_windows(model: tn.NoiseModel) -> None:
    """Tracks of the model live longer than 5 frames."""
    short = replace(model, training=replace(model.training, median_lifetime=2))
    assert model.training.median_lifetime is not None
    assert model.training.median_lifetime > 5
    sentence = "Half of its tracks live at most 2 frames."
    assert sentence in export(short, "filter").text
    assert sentence not in export(model, "filter").text


def test_an_estimator_without_one_sigma_is_said_to_take_the_components(model: tn.NoiseModel) -> None:
    with pytest.raises(SettingsError, match=r"ROVIO takes no single sigma, .* export MODEL --to rovio`"):
        model.advise("rovio")
    assert model_sentences(model, "rovio")[1] == "ROVIO takes the components, which `tracknoise export` writes."
