"""Errors of known size are measured within their sampling error."""

import numpy as np
import polars as pl
import pytest
from tests.selfcheck.oracle_runs import compare

from tracknoise.cli.app import main
from tracknoise.tables.findings_schema import OUTLIERS
from tracknoise.tables.store import RunFolder

BIAS_PX = np.array([0.31, -0.17])
DRIFT_PX = np.array([-0.021, 0.034])
COVARIANCE_PX2 = [[0.50, 0.15], [0.15, 0.30]]
OUTLIER_RATE, LOSS_RATE = 0.03, 0.05
N_FRAMES = 25

TEXT = f"""
name = "oracle"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways"]
worlds = 2
frames = {N_FRAMES}
width = 96
height = 72
supersampling = 1
[[trackers]]
kind = "oracle"
[trackers.options]
n_features = 150
bias_px = {BIAS_PX.tolist()}
drift_px_per_frame = {DRIFT_PX.tolist()}
covariance_px2 = {COVARIANCE_PX2}
outlier_rate = {OUTLIER_RATE}
loss_rate = {LOSS_RATE}
seed = SEED
[truth]
population = "projected"
"""


@pytest.fixture(scope="module", params=range(1))
def run(request, tmp_path_factory) -> RunFolder:
    folder = tmp_path_factory.mktemp("oracle")
    (folder / "oracle.toml").write_text(TEXT.replace("SEED", str(request.param)))
    arguments = ["run", str(folder / "oracle.toml"), "--out", str(folder / "run"), "--quiet", "--no-report", "-w", "1"]
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 0
    return RunFolder(folder / "run")


def z_scores(run: RunFolder, *curves: str) -> pl.DataFrame:
    """Measured minus expected, in known standard errors: rates, and curves at every age."""
    return compare(run, curves=curves, ages=range(1, N_FRAMES))


def test_bias_and_drift(run):
    nu = compare(run, curves=["nu"], ages=range(1, N_FRAMES))
    for axis, column in enumerate("uv"):
        points = nu.filter(statistic="nu", coordinate=column)
        age, measured, error = (points[name].to_numpy() for name in ("at", "measured", "standard_error"))
        design = np.column_stack([np.ones(len(age)), age])
        covariance = np.linalg.inv(design.T @ (design / error[:, None] ** 2))
        fitted = covariance @ design.T @ (measured / error**2)
        assert np.all(abs(fitted - [BIAS_PX[axis], DRIFT_PX[axis]]) < 4 * np.sqrt(np.diag(covariance)))


@pytest.mark.parametrize("statistic", ["nu", "eta", "Phi", "central"])
def test_every_curve_at_every_age(run, statistic):
    found = z_scores(run, statistic).filter(statistic=statistic)
    coordinates = ["u", "v", "uv"] if statistic in ("Phi", "central") else ["u", "v"]
    assert found["coordinate"].unique(maintain_order=True).to_list() == coordinates
    for coordinate in coordinates:
        z = found.filter(coordinate=coordinate)["z"].to_numpy()
        assert len(z) == N_FRAMES - 1
        assert abs(z.sum()) < 4 * np.sqrt(len(z))  # errors at different ages are independent
        assert np.sqrt(np.mean(z**2)) < 2


def test_outlier_and_loss_rates(run):
    rates = z_scores(run).filter(pl.col("statistic").is_in(["outlier_ratio", "loss_ratio"]))
    assert rates["expected"].to_list() == [OUTLIER_RATE, LOSS_RATE]
    assert run.statistics(OUTLIERS)["offered"].item() > 5000
    assert (rates["z"].abs() < 4).all()
