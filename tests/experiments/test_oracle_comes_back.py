"""The instrument measures itself: errors of known size go in, and come back within their sampling error."""

import numpy as np
import polars as pl
import pytest

from tracknoise.cli.app import main
from tracknoise.tables.store import RunFolder

BIAS_PX = np.array([0.31, -0.17])
DRIFT_PX = np.array([-0.021, 0.034])
COVARIANCE_PX2 = np.array([[0.50, 0.15], [0.15, 0.30]])
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
seed = SEED
[[trackers]]
kind = "oracle"
[trackers.options]
n_features = 150
bias_px = {BIAS_PX.tolist()}
drift_px_per_frame = {DRIFT_PX.tolist()}
covariance_px2 = {COVARIANCE_PX2.tolist()}
outlier_rate = {OUTLIER_RATE}
loss_rate = {LOSS_RATE}
seed = SEED
[truth]
population = "projected"
"""


@pytest.fixture(scope="module", params=range(5))
def run(request, tmp_path_factory) -> RunFolder:
    folder = tmp_path_factory.mktemp("oracle")
    (folder / "oracle.toml").write_text(TEXT.replace("SEED", str(request.param)))
    arguments = ["run", str(folder / "oracle.toml"), "--out", str(folder / "run"), "--quiet", "--no-report", "-w", "1"]
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 0
    return RunFolder(folder / "run")


def curve(run: RunFolder, statistic: str) -> pl.DataFrame:
    """One statistic of all features whose true position is known, by age, from the first age at which it varies."""
    return run.statistics("curves").filter(
        pl.col("statistic") == statistic,
        pl.col("population") == "projected",
        pl.col("trimming") == "untrimmed",
        pl.col("weighting") == "features",
        pl.col("at") > 0,
        pl.col("n") > 1,
    )


def test_bias_and_drift(run):
    nu = curve(run, "nu")
    n, age = nu["n"].to_numpy().astype(float), nu["at"].to_numpy().astype(float)
    design = np.column_stack([np.ones_like(age), age])
    information = design.T @ (design * n[:, None])
    for axis, column in enumerate("uv"):
        fitted = np.linalg.solve(information, design.T @ (n * nu[column].to_numpy()))
        standard_error = np.sqrt(COVARIANCE_PX2[axis, axis] * np.diag(np.linalg.inv(information)))
        assert np.all(abs(fitted - [BIAS_PX[axis], DRIFT_PX[axis]]) < 4 * standard_error)


def test_covariance(run):
    central = curve(run, "central")
    degrees = central["n"].to_numpy() - 1.0
    total = degrees.sum()
    assert total > 2000
    (uu, uv), (_, vv) = COVARIANCE_PX2
    expected = {"u": (uu, 2 * uu**2), "v": (vv, 2 * vv**2), "uv": (uv, uu * vv + uv**2)}
    for column, (value, variance) in expected.items():
        pooled = (central[column].to_numpy() * degrees).sum() / total
        assert abs(pooled - value) < 4 * np.sqrt(variance / total), column


def test_outlier_and_loss_rates(run):
    offered = run.statistics("outliers")["offered"].item()
    ratio = run.statistics("outliers")["pooled_ratio"].item()
    ends = dict(run.statistics("counts").filter(pl.col("kind") == "end").select("name", "n").iter_rows())
    assert offered > 5000
    for found, rate in ((ratio, OUTLIER_RATE), (ends["lost"] / offered, LOSS_RATE)):
        assert abs(found - rate) < 4 * np.sqrt(rate * (1 - rate) / offered)


def test_second_moment_about_zero_is_covariance_and_mean(run):
    phi, nu = curve(run, "Phi"), curve(run, "nu")
    age = nu["at"].to_numpy()
    mean = BIAS_PX + DRIFT_PX * age[:, None]
    n = nu["n"].to_numpy()
    for axis, column in enumerate("uv"):
        variance, square = COVARIANCE_PX2[axis, axis], mean[:, axis] ** 2
        standard_error = np.sqrt((2 * variance**2 + 4 * variance * square) / n)
        z = (phi[column].to_numpy() - (variance + square) * n / (n - 1)) / standard_error
        assert np.sqrt(np.mean(z**2)) < 2
