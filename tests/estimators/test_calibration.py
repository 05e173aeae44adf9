import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest
from benchmarks.noise import check
from benchmarks.noise.calibration import check_model, check_own
from benchmarks.noise.cells import calibration_sentences
from benchmarks.noise.reliability import reliability

import tracknoise as tn
from tracknoise.estimators.model import Interval
from tracknoise.exceptions import SettingsError
from tracknoise.inference.units import Resampled
from tracknoise.report.figure_files import specification
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder

OWN = ("quality_cov_uu", "quality_cov_uv", "quality_cov_vv")


@pytest.fixture(scope="module")
def model(planted_model: tn.NoiseModel) -> tn.NoiseModel:
    """Of white noise, which is as large at all ages."""
    return planted_model


@pytest.fixture(scope="module")
def growing(model: tn.NoiseModel) -> tn.NoiseModel:
    """With a walk that is not there."""
    walk = replace(model.walk, covariance=model.white.covariance, sigma=model.white.sigma)
    return replace(model, walk=walk)


def test_equal_predictions_are_one_class(planted_run: Path, model: tn.NoiseModel) -> None:
    found = check_model(model, RunFolder(planted_run))
    (one,) = found.reliability
    assert one.n == found.n
    assert one.predicted_px == pytest.approx(one.measured_px, rel=0.02)
    assert one.low_px < one.predicted_px < one.high_px
    assert found.ence == pytest.approx(abs(one.predicted_px - one.measured_px) / one.predicted_px)


def test_classes_show_where_a_model_is_wrong(planted_run: Path, growing: tn.NoiseModel) -> None:
    found = check_model(growing, RunFolder(planted_run))
    assert 5 <= len(found.reliability) <= 10
    assert sum(one.n for one in found.reliability) == found.n
    predicted = [one.predicted_px for one in found.reliability]
    assert predicted == sorted(predicted)
    for one in found.reliability:
        assert one.low_px < one.measured_px < one.high_px
        assert one.measured_px == pytest.approx(found.reliability[0].measured_px, rel=0.1)
        assert one.high_px < one.predicted_px


def test_a_run_without_errors_at_the_ages_of_the_model_is_an_error(planted_run: Path, model: tn.NoiseModel) -> None:
    later = replace(model, training=replace(model.training, ages=(500, 600)))
    with pytest.raises(SettingsError, match="found no errors at the ages of the model"):
        check_model(later, RunFolder(planted_run))


def changed(run: Path, path: Path, change: Callable[[SequenceEntry], SequenceEntry]) -> RunFolder:
    """A copy of a run with other entries of its sequences."""
    folder = RunFolder(shutil.copytree(run, path))
    manifest = folder.manifest()
    manifest.sequences = {key: change(entry) for key, entry in manifest.sequences.items()}
    folder.write_manifest(manifest)
    return folder


def test_errors_that_are_not_about_the_first_position_are_refused(
    planted_run: Path, model: tn.NoiseModel, tmp_path: Path
) -> None:
    fitted = changed(planted_run, tmp_path / "fitted", lambda entry: replace(entry, truth="triangulated"))
    scanned = changed(planted_run, tmp_path / "scanned", lambda entry: replace(entry, truth="scan", key_frame=5))
    for folder in (fitted, scanned):
        with pytest.raises(SettingsError, match="found errors that are not about the first position"):
            check_model(model, folder)
    with pytest.raises(SettingsError, match="true positions that are fitted to the tracks"):
        check_own(fitted, tracker="oracle", speed=1, name="cov")


def test_scenes_of_another_data_set_may_have_the_same_names(planted_run: Path, model: tn.NoiseModel) -> None:
    other = replace(model, training=replace(model.training, dataset="kitti, tum"))
    assert check_model(other, RunFolder(planted_run)).n_trained == 0
    both = replace(model, training=replace(model.training, dataset="kitti, simulated"))
    assert check_model(both, RunFolder(planted_run)).n_trained == 8


def test_covariances_of_a_front_end_are_checked_where_they_are_possible(
    planted_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = RunFolder.sequence_table

    def with_own(self: RunFolder, name: str, key: str) -> pl.DataFrame:
        table = read(self, name, key)
        if name != "observations":
            return table
        values = dict(zip(OWN, (0.09, 0.0, 0.04), strict=True))  # the oracle's first positions are exact
        part = pl.col("track") % 8
        later = pl.when(pl.col("age") > 0)
        made = table.with_columns(
            later.then(pl.lit(value, pl.Float32)).alias(column) for column, value in values.items()
        )
        return made.with_columns(
            pl.when(part == 0).then(0.0).when(part == 1).then(float("nan")).otherwise(OWN[2]).alias(OWN[2])
        )

    monkeypatch.setattr(RunFolder, "sequence_table", with_own)
    folder = RunFolder(planted_run)
    found = check_own(folder, tracker="oracle", speed=1, name="cov")
    assert found.nees.value == pytest.approx(1.0, abs=0.03)
    assert found.n_impossible == pytest.approx(found.n / 6, rel=0.2)
    expected = f"For {found.n_impossible} more errors, what is predicted is not positive definite; they do not count."
    assert expected in calibration_sentences(found)
    monkeypatch.setattr(
        RunFolder, "sequence_table", lambda *place: with_own(*place).with_columns(pl.lit(0.0).alias(OWN[0]))
    )
    with pytest.raises(SettingsError, match="found no covariance of oracle that is positive definite"):
        check_own(folder, tracker="oracle", speed=1, name="cov")


def test_errors_that_are_zero_in_the_key_frame_do_not_count(
    planted_run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Tracks that began before the key frame have an error in their first frame."""
    read = RunFolder.sequence_table
    scanned = changed(planted_run, tmp_path / "scanned", lambda entry: replace(entry, truth="scan", key_frame=5))

    def about_key_frame(self: RunFolder, name: str, key: str) -> pl.DataFrame:
        there = pl.col("frame") == 5
        made = read(self, name, key).with_columns(pl.when(~there).then(pl.lit(1.0, dtype=pl.Float32)).alias(OWN[0]))
        errors = [pl.when(there).then(0.0).otherwise(1.0).alias(column) for column in ("du_px", "dv_px")]
        return made.with_columns(errors).with_columns(
            pl.col(OWN[0]).alias(OWN[2]), (0.0 * pl.col(OWN[0])).alias(OWN[1])
        )

    monkeypatch.setattr(RunFolder, "sequence_table", about_key_frame)
    found = check_own(scanned, tracker="oracle", speed=1, name="cov")
    assert found.nees.value == pytest.approx(1.0)
    counted = [about_key_frame(scanned, "observations", key) for key in scanned.manifest().sequences]
    valid = pl.concat(counted).filter(truth="valid", tracker="oracle", speed=1)
    assert found.n == valid.filter(pl.col("frame") != 5).height
    assert valid.filter(pl.col("frame") == 0).height > 0


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (0.9, 1.1, "The size of the errors agrees with the covariance"),
        (0.5, 3.0, "whether the covariance is right is undecided"),
        (1.01, 1.02, "The size of the errors agrees with the covariance"),
        (1.01, 1.5, "The covariance is too small"),
        (0.8, 0.99, "The covariance is too large"),
        (None, None, "There are too few scenes for an interval"),
    ],
)
def test_a_wide_interval_decides_nothing(
    planted_run: Path, model: tn.NoiseModel, low: float | None, high: float | None, says: str
) -> None:
    found = check_model(model, RunFolder(planted_run))
    stated = replace(found, nees=Interval(value=1.0, low=low, high=high))
    assert says in calibration_sentences(stated)[0]


def test_the_figure_shows_the_classes_and_where_they_agree(planted_run: Path, growing: tn.NoiseModel) -> None:
    found = check_model(growing, RunFolder(planted_run))
    figure = reliability(found, title="with a walk")
    spec = specification(figure)
    diagonal, bars, points = spec["concat"][0]["layer"]
    assert diagonal["mark"]["type"] == "line"
    for layer in (bars, points):
        table = spec["datasets"][layer["data"]["name"]]
        assert table.count("\n") == len(found.reliability) + 1
        assert f"{found.reliability[0].measured_px:.4g}" in table
    for resampled, text in (
        ("within", "over 8 scenes, resampled within their groups"),
        ("groups", "over groups of 8 scenes"),
    ):
        shown = reliability(replace(found, resampled=Resampled(resampled)), title="").shows
        assert f"Bars are 95\xa0% intervals {text}. " in shown
    assert "8 scenes, resampled within their groups" in figure.shows  # those of one motion are a group
    alone = check_model(growing, RunFolder(planted_run), scenes=growing.training.scenes[:2])
    assert "Bars" not in reliability(alone, title="").shows


@pytest.mark.parametrize(("kind", "begins"), [("svg", b"<svg"), ("png", b"\x89PNG")])
def test_the_command_writes_the_figure(
    planted_run: Path, model: tn.NoiseModel, tmp_path: Path, capsys, kind: str, begins: bytes
) -> None:
    model.write(tmp_path / "model.json")
    drawn = tmp_path / "plots" / f"reliability.{kind}"
    assert check.main([str(tmp_path / "model.json"), "--on", str(planted_run), "--figure", str(drawn)]) == 0
    assert f"written: {drawn}" in capsys.readouterr().out
    assert drawn.read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("name", "message"),
    [("plot.gif", "ends in '.gif', expected .svg or .png"), ("run/plot.svg", "found a place in the run")],
)
def test_a_figure_of_another_kind_or_in_a_run_is_refused(
    planted_run: Path, tmp_path: Path, capsys, name: str, message: str
) -> None:
    figure = planted_run / "plot.svg" if name.startswith("run") else tmp_path / name
    assert check.main([str(tmp_path / "model.json"), "--on", str(planted_run), "--figure", str(figure)]) == 1
    assert message in capsys.readouterr().err


def test_what_is_checked_is_a_model_or_covariances_of_a_front_end(
    planted_run: Path, model, tmp_path: Path, capsys
) -> None:
    def error(*arguments: object) -> str:
        assert check.main([*map(str, arguments), "--on", str(planted_run)]) == 1
        return capsys.readouterr().err

    assert "no such file" in error(tmp_path / "none.json")
    assert "found no column quality_cov_uu of oracle" in error("--own", "cov", "--tracker", "oracle")
    assert "no MODEL, expected a noise model, or --own NAME" in error()
    for option in (("--tracker", "oracle"), ("--speed", "2")):
        said = f"{option[0]}: found a noise model, which has its own, expected the option with --own alone"
        assert said in error(tmp_path / "none.json", *option)
    model.write(tmp_path / "model.json")
    assert check.main([str(tmp_path / "model.json"), "--on", str(planted_run)]) == 0
    out = capsys.readouterr().out
    assert "agrees with the covariance" in out
    assert "was fitted to 8 of these scenes" in " ".join(out.split())
