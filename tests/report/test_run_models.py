"""Models of a run: fitted by its analysis, and only read by its report."""

import dataclasses
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.fitted_curve import fitted_curve
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.run_models import RunModels, _fits, fitted_models, run_models
from tracknoise.estimators.training import RunTruth, all_training_tables
from tracknoise.exceptions import StoreError
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.processes import ONE_THREAD, process_pool
from tracknoise.report.figures import noise_models
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

PATH = "statistics/noise/oracle@1.noise.json"
MIDDLE = ((0.09 + 0.04) / 2) ** 0.5


def test_models_are_those_that_the_command_line_fits(fitted_run: RunFolder) -> None:
    found = run_models(fitted_run)
    assert (list(found.models), dict(found.missing), dict(found.paths)) == (["oracle"], {}, {"oracle": PATH})
    assert found.models["oracle"].training.speed == 1
    assert found.models["oracle"].white.sigma.value == pytest.approx(MIDDLE, rel=0.05)
    assert NoiseModel.read(fitted_run.path / PATH).text == found.models["oracle"].text


def test_a_report_fits_nothing(fitted_run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = RunFolder(shutil.copytree(fitted_run.path, tmp_path / "run"))

    def fitted(*_: object) -> None:
        raise AssertionError("a model was fitted")

    monkeypatch.setattr("tracknoise.estimators.noise_model.fitted_fields", fitted)
    monkeypatch.setattr("tracknoise.estimators.run_models.fitted_fields", fitted)
    assert list(run_models(run).models) == ["oracle"]
    assert isinstance(noise_models.model_fit_figures(ReportData.of(run))[0], Figure)


def test_a_damaged_model_is_refused(fitted_run: RunFolder, tmp_path: Path) -> None:
    run = RunFolder(shutil.copytree(fitted_run.path, tmp_path / "run"))
    (run.path / PATH).write_text("{}")
    with pytest.raises(StoreError, match=r"oracle@1\.noise\.json"):
        run_models(run)


def test_tables_are_read_once_for_all_models(fitted_run: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    read = Counter[str]()
    stacked = RunFolder.stacked_tables

    def counted(self: RunFolder, name: str, keys: Sequence[str], **options: Any) -> Iterator[pl.DataFrame]:
        read[name] += 1
        return stacked(self, name, keys, **options)

    monkeypatch.setattr(RunFolder, "stacked_tables", counted)
    assert fitted_models(fitted_run, ["oracle"], 1, RunTruth.of(fitted_run)).models
    assert read.pop("noise_sums") == 2  # for the names of the trackers, and for the fits
    assert set(read.values()) == {1}


def test_runs_without_sums_have_no_models_and_write_nothing(run: RunFolder) -> None:
    assert run_models(run) == RunModels()
    assert not (run.path / "statistics" / "noise").exists()


def test_the_curve_of_a_model_lies_over_the_errors_that_it_was_fitted_to(fitted_run: RunFolder) -> None:
    tables = [table.filter(tracker="oracle", speed=1) for table in fitted_run.stored_tables("noise_sums")]
    curve = fitted_curve(pl.concat(tables), run_models(fitted_run).models["oracle"].components)
    assert curve["age"].to_list() == list(range(1, 14))
    ratio = curve["modelled"].to_numpy() / curve["measured"].to_numpy()
    assert np.abs(ratio - 1.0).max() < 0.1
    assert (curve["low"] < curve["measured"]).all()
    assert (curve["measured"] < curve["high"]).all()
    twice = fitted_curve(pl.concat(tables), TrackNoise.isotropic(white=2.0 * MIDDLE))
    np.testing.assert_allclose(twice["modelled"].to_numpy(), 2.0 * MIDDLE)
    assert twice["measured"].equals(curve["measured"])


def test_the_figure_states_components_and_how_far_they_are_off(fitted_run: RunFolder) -> None:
    (figure,) = noise_models.model_fit_figures(ReportData.of(fitted_run))
    assert isinstance(figure, Figure)
    assert "oracle: each frame 0.2" in figure.look_for
    assert "off the measured errors." in figure.look_for
    assert figure.message == "The model is inside the intervals of the measured errors"


def test_ages_at_which_a_model_leaves_the_intervals_are_counted(
    fitted_run: RunFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = ReportData.of(fitted_run)
    (model,) = run_models(data.run).models.values()
    larger = dataclasses.replace(model.white, covariance=4.0 * model.white.covariance)
    twice = dataclasses.replace(model, white=larger)
    monkeypatch.setattr(noise_models, "run_models", lambda run: RunModels(1, {"oracle": twice}))
    (figure,) = noise_models.model_fit_figures(data)
    assert isinstance(figure, Figure)
    assert figure.message == "The model of oracle is outside the intervals at 13 of 13 ages"


def test_the_figure_is_absent_without_a_model(run: RunFolder, tmp_path: Path) -> None:
    (absent,) = noise_models.model_fit_figures(ReportData.of(run))
    assert not isinstance(absent, Figure)


def test_models_do_not_depend_on_the_process_that_fits(fitted_run: RunFolder) -> None:
    (tables,) = all_training_tables(fitted_run, [("oracle", 1)])
    alone = run_models(fitted_run).models["oracle"]
    with process_pool(1, ONE_THREAD) as pool:
        (other,) = pool.submit(_fits, [tables]).result()
    assert other.text == alone.text
