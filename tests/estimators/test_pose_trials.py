"""What the gate of a filter does to its covariance, and one pose from known points: with planted noise."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.stats import chi2
from tests.estimators.exports.models import lucas_kanade
from tests.estimators.test_kernels import SIGMA, WINDOWS, sigma, tracks

from tracknoise.estimators.advice import usual_knee
from tracknoise.estimators.export_render import export
from tracknoise.estimators.kernels import drawn_windows
from tracknoise.estimators.model import Interval, KnownPoints, LossKind, Purpose, Tails, TriedGate
from tracknoise.estimators.pose_trials import known_points, tried_gate
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.inference.units import NO_GROUPS


def gate(table: pl.DataFrame, gate_80: float) -> TriedGate:
    drawn, newest = list(drawn_windows(table, WINDOWS, np.inf)), replace(sigma(Purpose.NEWEST_POSE), gate_80=gate_80)
    found = tried_gate(drawn, newest, dataset="d", groups=NO_GROUPS, level=0.95)
    assert found is not None
    assert found.nees.low < found.nees.value < found.nees.high
    return found


def test_a_gate_makes_claimed_covariances_too_large_and_one_that_passes_all_does_not() -> None:
    white = tracks(np.full(80, SIGMA))
    found, every = gate(white, 1.0), gate(white, 100.0)
    freedom = 2 * 11 - 3
    truncated = chi2.cdf(chi2.ppf(0.8, freedom), freedom + 2) / 0.8  # second moment below the gate, at true poses
    assert found.passed.value == pytest.approx(0.8, abs=0.06)
    assert truncated - 0.1 < found.nees.value < 1.0
    assert every.nees.value == pytest.approx(1.0)
    assert every.passed.value == 1.0


def test_heavy_tails_of_tracks_make_more_of_it() -> None:
    random = np.random.default_rng(1)
    scales = SIGMA * np.sqrt(2.0 / random.chisquare(4, 400))
    assert gate(tracks(scales, scenes=8), 0.8).nees.value < gate(tracks(np.full(80, SIGMA)), 1.0).nees.value - 0.1


def test_an_export_says_what_the_gate_does_or_that_it_was_not_tried() -> None:
    nees, passed = Interval(value=0.61, low=0.5, high=0.72), Interval(value=0.8)
    tried = lucas_kanade(gate_trial=TriedGate(nees=nees, passed=passed, window=11, windows=36))
    text = export(tried, "openvins").text
    assert "where the gates reject nothing" in text
    assert (
        "With this track gate, the NEES of the newest pose was 0.61 (0.5 to 0.72). The trial had 36 windows of 11"
        in text
    )
    assert "Whether sigma is right with the gate was not tried" in export(lucas_kanade(), "openvins").text
    assert "gate" not in export(tried, "kimera").text.split("Truth")[0].split("right for")[1]


def points(scales: list[float], tails: Tails, nu: float = np.inf) -> dict[LossKind | None, KnownPoints]:
    """Sigmas of scenes with these standard deviations of errors at all ages."""
    random, parts = np.random.default_rng(0), []
    for place, scale in enumerate(scales):
        table = tracks(np.full(300, scale), scenes=1, seed=place).with_columns(scene=pl.lit(f"s{place:02}"))
        if np.isfinite(nu):
            heavy = np.sqrt((nu - 2.0) / random.chisquare(nu, table.height)).astype(np.float32)
            table = table.with_columns(pl.col("du_px", "dv_px") * pl.Series(heavy))
        parts.append(table)
    noise = TrackNoise.isotropic(white=float(np.sqrt(np.mean(np.square(scales)))))
    found = known_points(
        pl.concat(parts), noise, tails, lengths=[10], speed=1, most_px=np.inf, groups=NO_GROUPS, level=0.95
    )
    return {one.kernel: one for one in found}


def nees_of_poses(draw, knee: float, *, n: int = 150, poses: int = 250) -> float:
    """Mean NEES of poses with a sigma of 1 px under Cauchy's loss, by repeated weighting."""
    random, found = np.random.default_rng(9), []
    for _ in range(poses):
        x, y, z = random.uniform(-0.7, 0.7, n), random.uniform(-0.5, 0.5, n), random.uniform(2.0, 10.0, n)
        nothing = np.zeros(n)
        rows = np.array(
            [[x * y, -1 - x * x, y, 1 / z, nothing, -x / z], [1 + y * y, -x * y, -x, nothing, 1 / z, -y / z]]
        )
        by_pose, errors, move = 460.0 * rows.transpose(2, 0, 1), draw(random, n), np.zeros(6)
        for _ in range(20):
            left = errors - by_pose @ move
            weights = 1.0 / (1.0 + np.square(left).sum(axis=1) / knee**2)
            information = np.einsum("nij,n,nik->jk", by_pose, weights, by_pose)
            move = move + np.linalg.solve(information, np.einsum("nij,n,ni->j", by_pose, weights, left))
        found.append(move @ information @ move / 6.0)
    return float(np.mean(found))


@pytest.mark.parametrize(("nu", "core"), [(np.inf, 1.0), (4.0, 0.5**0.5)])
def test_sigma_of_known_points_makes_the_nees_of_a_pose_one(nu: float, core: float) -> None:
    scales = [0.2, 0.25, 0.3, 0.3, 0.35, 0.4]
    tails = Tails(nu=nu, core_sigma=0.3 * core, core_ratio=core)
    found = points(scales, tails, nu)
    cauchy, plain = found[LossKind.CAUCHY], found[None]

    def draw(random: np.random.Generator, n: int) -> np.ndarray:
        errors = random.choice(scales) * random.standard_normal((n, 2))
        return errors if np.isinf(nu) else errors * np.sqrt((nu - 2.0) / random.chisquare(nu, (n, 1)))

    rms = float(np.sqrt(np.mean(np.square(scales))))
    assert cauchy.knee_px == pytest.approx(usual_knee(tails, rms))
    assert nees_of_poses(draw, cauchy.knee_px) / cauchy.sigma.value**2 == pytest.approx(1.0, abs=0.12)
    assert cauchy.sigma.low < cauchy.sigma.value < cauchy.sigma.high < plain.sigma.high
    assert plain.sigma.value == pytest.approx(rms, rel=0.1)  # without a loss, the RMS
    assert cauchy.sigma.value < 0.95 * rms


def test_an_export_for_known_points_has_the_interval_and_does_not_call_it_the_rms() -> None:
    own = KnownPoints(window=10, kernel=LossKind.CAUCHY, knee_px=0.3, sigma=Interval(value=0.2, low=0.18, high=0.22))
    text = export(lucas_kanade(known_points=(own,)), "pnp").text
    assert "sigma 0.2 px (0.18 to 0.22), Cauchy loss at 1.5 sigma" in text
    assert "Sigma is the RMS" not in text
    assert "Sigma has no interval" in export(lucas_kanade(), "pnp").text
