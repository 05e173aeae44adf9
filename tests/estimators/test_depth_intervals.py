"""Intervals of depths of planted tracks: which noise makes them hold the true depths of other scenes."""

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import Sampling
from tracknoise.estimators import depth_intervals as learned_noise
from tracknoise.estimators.components import fit_noise
from tracknoise.estimators.depth_intervals import LearnedNoise, depth_intervals
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.inference.units import SceneGroups, Units
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of
from tracknoise.statistics.windows import fit_windows
from tracknoise.tables.schema import NOISE_SUMS, NOISE_TRACKS, WINDOW_NOISE, Schema

FOCAL_PX, STEP_M, MOST, TRACKS, SCENES = 460.0, 0.06, 15, 120, 8
NAMES = {"dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk"}
NAMES |= {"speed": 1}
LOST_PX = 40.0


def planted(kind: str, *, lost: int = 0) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Sampled tracks, sums and windows of points on the optical axis that a camera passes sideways."""
    found = [of_scene(f"scene {place}", kind, np.random.default_rng(place), lost) for place in range(SCENES)]
    tracks, sums, windows = zip(*found, strict=True)
    return pl.concat(tracks), pl.concat(sums), pl.concat(windows)


def errors_of(kind: str, random: np.random.Generator) -> np.ndarray:
    """(TRACKS, MOST, 2) px: about the first position."""
    later = (np.arange(MOST) > 0)[:, None]
    if kind == "walk":
        return np.cumsum(0.1 * later * random.standard_normal((TRACKS, MOST, 2)), axis=1)
    return 0.3 * later * (random.standard_normal((TRACKS, MOST, 2)) + random.standard_normal((TRACKS, 1, 2)))


def of_scene(scene: str, kind: str, random: np.random.Generator, lost: int) -> tuple[pl.DataFrame, ...]:
    errors, depth_m = errors_of(kind, random), random.uniform(2.0, 10.0, TRACKS)
    sums = sums_of(scene, errors)
    errors[:lost, -1] += LOST_PX
    moved = FOCAL_PX * STEP_M * np.arange(MOST) / depth_m[:, None]
    rows = {
        "track": np.repeat(np.arange(TRACKS), MOST),
        "age": np.tile(np.arange(MOST), TRACKS),
        "du_px": errors[..., 0].ravel(),
        "dv_px": errors[..., 1].ravel(),
        "depth_u": moved.ravel(),
    }
    same = {"block": 0, "stands_for": 1.0, "kept": True, "magnification": 1.0, "across_u": FOCAL_PX, "across_v": 0.0}
    same |= {"other_u": 0.0, "other_v": FOCAL_PX, "depth_v": 0.0}
    tracks = named(scene, NOISE_TRACKS, pl.DataFrame(rows).with_columns(pl.lit(x).alias(y) for y, x in same.items()))
    jacobian = np.zeros((TRACKS, MOST, 2, 3))
    jacobian[..., 0, 0] = jacobian[..., 1, 1] = FOCAL_PX / depth_m[:, None]
    jacobian[..., 0, 2] = moved / depth_m[:, None]
    ray = depth_m[:, None] * np.array([0.0, 0.0, 1.0])
    return tracks, sums, windows_of(scene, errors, jacobian, ray)


def named(scene: str, schema: Schema, table: pl.DataFrame) -> pl.DataFrame:
    labelled = table.with_columns(pl.lit(value).alias(name) for name, value in {**NAMES, "scene": scene}.items())
    return labelled.select(pl.col(name).cast(kind) for name, kind in schema.items())


def sums_of(scene: str, errors: np.ndarray) -> pl.DataFrame:
    """Products of motion sideways, where nothing is magnified: the factors of A, W, Q and D are known."""
    rows = []
    for age in range(1, MOST):
        change = errors[:, age] - errors[:, age - 1]
        rows.append(("error", age, errors[:, age], errors[:, age], (1.0, 1.0, age, age**2)))
        if age > 1:
            rows.append(("change", age, change, change, (0.0, 2.0, 1.0, 1.0)))
        if age > 2:
            rows.append(("lagged", age, change, errors[:, age - 1] - errors[:, age - 2], (0.0, -1.0, 0.0, 1.0)))
    table = [
        {
            "block": 0, "product": product, "age": age, "n": TRACKS,
            "uu": (a[:, 0] * b[:, 0]).sum(), "uv": 0.0, "vv": (a[:, 1] * b[:, 1]).sum(),
            **dict(zip(("first", "white", "walk", "drift"), TRACKS * np.array(factors), strict=True)),
            **dict.fromkeys(("sum_u", "sum_v", "along", "motion"), 0.0),
        }
        for product, age, a, b, factors in rows
    ]  # fmt: skip
    return named(scene, NOISE_SUMS, pl.DataFrame(table))


def windows_of(scene: str, errors: np.ndarray, jacobian: np.ndarray, ray: np.ndarray) -> pl.DataFrame:
    parts = []
    for window in (5, 10, 15):
        found = fit_windows(errors[:, :window], jacobian[:, :window], ray)
        residual = np.sqrt(found.squares.sum(axis=1) / found.freedom.sum(axis=1))
        shown = ~np.isnan(found.z_px)
        sums = dict(zip(("squares_u", "squares_v"), found.squares.sum(axis=0), strict=True))
        sums |= dict(zip(("freedom_u", "freedom_v"), found.freedom.sum(axis=0), strict=True))
        histograms = {
            "residual_counts": [np.bincount(bin_of(residual), minlength=LOG_HISTOGRAM_BINS).tolist()],
            "z_counts": [np.bincount(bin_of(np.abs(found.z_px[shown])), minlength=LOG_HISTOGRAM_BINS).tolist()],
        }
        row = {"window": window, "n": len(shown), "n_depth": shown.sum(), "squares_z": 1.0, **sums, **histograms}
        parts += [pl.DataFrame({**row, "trimming": trimming}) for trimming in ("untrimmed", "trimmed")]
    return named(scene, WINDOW_NOISE, pl.concat(parts))


@cache
def found(kind: str, lost: int = 0) -> dict[tuple[str, str], dict]:
    """Rows of windows of 15, by covariance and quantity."""
    rows = depth_intervals(*planted(kind, lost=lost)).filter(window=15, trimming="untrimmed").to_dicts()
    return {(row["covariance"], row["quantity"]): row for row in rows}


@pytest.mark.parametrize("covariance", ["residual sigma", "consistent sigma", "whole tracks"])
@pytest.mark.parametrize("level", [50, 90, 95])
def test_all_hold_what_they_claim_under_independent_noise(covariance: str, level: int) -> None:
    row = found("detection")[covariance, f"coverage_{level}"]
    assert row["value"] == pytest.approx(level / 100, abs=0.05)
    assert row["low"] < row["value"] < row["high"]
    assert (row["n"], row["n_scenes"]) == (TRACKS * SCENES, SCENES)


def test_learned_sigmas_are_the_planted_one() -> None:
    for covariance, rel in (("residual sigma", 0.03), ("consistent sigma", 0.1)):  # a median of 960 numbers: 4 %
        assert found("detection")[covariance, "coverage_95"]["sigma_px"] == pytest.approx(0.3, rel=rel)
    assert found("detection")["whole tracks", "coverage_95"]["sigma_px"] is None


def test_the_sigma_of_residuals_holds_too_few_depths_under_a_walk_and_the_others_hold_them() -> None:
    of_walk = found("walk")
    assert of_walk["residual sigma", "coverage_95"]["high"] < 0.7
    assert of_walk["residual sigma", "overconfidence"]["low"] > 2.0
    assert of_walk["consistent sigma", "coverage_95"]["value"] == pytest.approx(0.95, abs=0.02)
    assert of_walk["whole tracks", "coverage_95"]["value"] == pytest.approx(0.95, abs=0.02)
    assert of_walk["whole tracks", "overconfidence"]["value"] == pytest.approx(1.0, abs=0.1)
    assert of_walk["1 px", "coverage_95"]["value"] > 0.99


def test_whole_tracks_err_less_under_a_walk_and_one_sigma_never_changes_a_depth() -> None:
    of_walk = found("walk")
    assert of_walk["whole tracks", "error_ratio"]["value"] < 0.97
    assert of_walk["consistent sigma", "error_ratio"]["value"] == 1.0
    errors = {of_walk[name, "depth_error"]["value"] for name in ("1 px", "residual sigma", "consistent sigma")}
    assert len(errors) == 1


def test_a_few_lost_tracks_change_shares_by_no_more_than_their_own() -> None:
    lost = 6
    for covariance in ("1 px", "residual sigma", "consistent sigma"):
        before, after = (found("detection", n)[covariance, "coverage_95"]["value"] for n in (0, lost))
        assert after == pytest.approx(before, abs=lost / TRACKS + 0.01)


def test_nothing_is_said_of_one_scene_and_groups_are_left_out_together() -> None:
    tables = planted("detection")
    alone = [table.filter(scene="scene 0") for table in tables]
    assert depth_intervals(*alone).is_empty()
    groups = SceneGroups({("d", f"scene {place}"): f"group {place % 2}" for place in range(SCENES)})
    grouped = depth_intervals(*tables, Sampling(groups=groups)).filter(
        covariance="residual sigma", quantity="coverage_95"
    )
    assert grouped.height == 6
    assert grouped["sigma_px"].to_list() != [found("detection")["residual sigma", "coverage_95"]["sigma_px"]] * 6


def test_scenes_without_windows_are_left_out() -> None:
    tracks, sums, windows = planted("detection")
    some = pl.col("scene").is_in(["scene 0", "scene 1", "scene 2"])
    (row,) = (
        depth_intervals(tracks, sums, windows.filter(some))
        .filter(window=5, trimming="trimmed", covariance="1 px", quantity="coverage_95")
        .to_dicts()
    )
    assert (row["n_scenes"], row["n"]) == (3, 3 * TRACKS)
    assert depth_intervals(tracks, sums, windows.clear()).is_empty()


def test_scenes_that_are_not_tried_are_left_out_with_their_group() -> None:
    _, sums, windows = planted("walk")
    groups = SceneGroups({("d", f"scene {place}"): f"group {place // 2}" for place in range(SCENES)})
    kept = pl.col("scene") != "scene 1"
    for some in ("scene 0", "scene 4"):
        found = [
            dict_of(learned_noise.learned_noise([some], *tables, groups=groups))
            for tables in ((sums, windows), (sums.filter(kept), windows.filter(kept)))
        ]
        assert [list(one) for one in found] == [[(some,)]] * 2
        assert found[0][some,].sigmas.equals(found[1][some,].sigmas) == (some == "scene 0")


def dict_of(learned: Iterator[tuple[Sequence[str], LearnedNoise]]) -> dict[tuple[str, ...], LearnedNoise]:
    return {tuple(scenes): noise for scenes, noise in learned}


def test_without_sums_whole_tracks_are_left_out() -> None:
    tracks, sums, windows = planted("detection")
    assert "whole tracks" not in depth_intervals(tracks, sums.clear(), windows)["covariance"]


def test_noise_is_fitted_once_for_each_part_of_the_scenes_of_a_condition(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted = []

    def counted(units: Units, *, level: float) -> TrackNoise:
        fitted.append(units)
        return fit_noise(units, level=level)

    monkeypatch.setattr(learned_noise, "fit_noise", counted)
    tracks, sums, windows = planted("detection")
    two = [pl.concat([table, table.with_columns(tracker=pl.lit("other"))]) for table in (tracks, sums, windows)]
    for tables, conditions in (((tracks, sums, windows), 1), (two, 2)):
        fitted.clear()
        depth_intervals(*tables)
        assert len(fitted) == learned_noise.FOLDS * conditions
