"""The metrics of point trackers against their published definitions, written as loops over points and frames."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError
from tracknoise.statistics.tap import PointTracks, expected_feature_age, tap_vid
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

N, K = 40, 12


def world(seed: int) -> PointTracks:
    rng = np.random.default_rng(seed)
    first = rng.integers(0, K, N)
    true = rng.uniform(0, 100, (N, K, 2))
    predicted = true + rng.normal(0, 4, (N, K, 2)) * rng.choice([0.1, 1, 5], (N, 1, 1))
    predicted[np.arange(N), first] = true[np.arange(N), first]
    reported = predicted.copy()
    reported[rng.random((N, K)) < 0.25] = np.nan
    reported[np.arange(K) < first[:, None]] = np.nan
    reported[np.arange(N), first] = true[np.arange(N), first]
    visible = rng.random((N, K)) < 0.8
    visible[np.arange(N), first] = True
    known = visible | (rng.random((N, K)) < 0.7)
    return PointTracks(reported, true, visible, known, first, predicted)


def by_definition(points: PointTracks, scale: tuple[float, float]) -> dict[str, float]:
    """TAP-Vid, sections 3 and 4: each point and frame counted on its own."""
    deltas, reported, jaccards, right, frames = [], [], [], 0, 0
    for threshold in (1, 2, 4, 8, 16):
        visible = within = positives = false = 0
        right = frames = 0
        for i in range(N):
            for t in range(points.first[i] + 1, K):
                if not points.known[i, t]:
                    continue
                seen, said = points.visible[i, t], not math.isnan(points.reported_px[i, t, 0])
                du, dv = points.predicted_px[i, t] - points.true_px[i, t]
                near = (du * scale[0]) ** 2 + (dv * scale[1]) ** 2 < threshold**2
                visible, within = visible + seen, within + (seen and near)
                positives += seen and said and near
                false += said and (not seen or not near)
                right, frames = right + (seen == said), frames + 1
        deltas.append(within / visible)
        reported.append(positives / visible)
        jaccards.append(positives / (visible + false))
    return {
        "delta_avg": sum(deltas) / 5,
        "delta_avg_reported": sum(reported) / 5,
        "average_jaccard": sum(jaccards) / 5,
        "occlusion_accuracy": right / frames,
        "delta_4": deltas[2],
        "jaccard_16": jaccards[4],
    }


def age_by_definition(points: PointTracks, scale: tuple[float, float]) -> float:
    """Messikommer et al.: share of stable tracks times the mean relative age of these, averaged over thresholds."""
    products = []
    for threshold in range(1, 32):
        ages = []
        for i in range(N):
            end = points.first[i] + 1
            while end < K and points.visible[i, end]:
                end += 1
            length = end - points.first[i] - 1
            if length == 0:
                continue
            age = 0
            for t in range(points.first[i] + 1, end):
                offset = (points.reported_px[i, t] - points.true_px[i, t]) * scale
                if not math.hypot(*offset) <= threshold:
                    break
                age += 1
            ages.append(age / length)
        stable = [age for age in ages if age > 0]
        products.append(len(stable) / len(ages) * (sum(stable) / len(stable) if stable else 0.0))
    return sum(products) / len(products)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("scale", [(1.0, 1.0), (0.4, 0.7)])
def test_metrics_are_those_of_their_definitions(seed, scale):
    points = world(seed)
    found = tap_vid(points, scale)
    for name, value in by_definition(points, scale).items():
        assert found[name] == pytest.approx(value, abs=1e-12), name
    assert expected_feature_age(points, scale) == pytest.approx(age_by_definition(points, scale), abs=1e-12)


def test_perfect_tracks_have_1_and_nothing_to_evaluate_has_no_value():
    perfect = world(0)
    reported = np.where(perfect.visible[..., None], perfect.true_px, np.nan)
    reported[np.arange(K) < perfect.first[:, None]] = np.nan
    perfect = replace(perfect, reported_px=reported, predicted_px=perfect.true_px)
    assert set(tap_vid(perfect).values()) == {1.0}
    assert expected_feature_age(perfect) == 1.0
    last = replace(perfect, first=np.full(N, K - 1))
    assert all(math.isnan(value) for value in tap_vid(last).values())
    assert math.isnan(expected_feature_age(last))


@pytest.fixture(scope="module")
def sequence():
    return tn.open_sequence("simulated", motions=["forward"], frames=8, width=160, height=120, supersampling=1)


def test_metrics_of_a_measurement_count_frames_in_which_a_lost_point_is_still_visible(sequence):
    """One track that is exact in two frames and then lost; its point stays in the image."""
    oracle = tn.measure(sequence, tn.Oracle())
    visible = oracle.observations.filter(truth="valid").group_by("track").len().filter(len=8)
    rows = oracle.observations.filter(track=visible["track"].min())
    columns = [rows.filter(rows["frame"] < 3)[name] for name in ("track", "frame", "u_true_px", "v_true_px")]
    table = tn.tap_metrics(tn.measure(sequence, tn.Imported.from_arrays(*columns)))
    for row in table.iter_rows(named=True):
        assert row["n_points"] == 1
        for name in ("delta_avg_reported", "average_jaccard", "occlusion_accuracy", "expected_feature_age"):
            assert row[name] == pytest.approx(2 / 7)
        assert row["delta_avg"] is None  # where it was lost, it states no position


def as_the_benchmark(true_px, visible, first, predicted, occluded) -> dict[str, float]:
    """TAP-Vid, query mode "first", from arrays of one video in its raster of 256 x 256: appendix of the paper.

    Positions count for the accuracy wherever a point is visible, whether or not it is predicted to be occluded.
    """
    evaluated = np.arange(visible.shape[1])[None] > first[:, None]
    squared = ((predicted - true_px) ** 2).sum(axis=-1)
    deltas, jaccards = [], []
    for threshold in (1, 2, 4, 8, 16):
        within = squared < threshold**2
        deltas.append((within & visible & evaluated).sum() / (visible & evaluated).sum())
        positives = (within & visible & ~occluded & evaluated).sum()
        false = ((~visible & ~occluded & evaluated) | (~within & ~occluded & evaluated)).sum()
        jaccards.append(positives / ((visible & evaluated).sum() + false))
    accuracy = ((visible != occluded) & evaluated).sum() / evaluated.sum()
    return {"delta_avg": np.mean(deltas), "average_jaccard": np.mean(jaccards), "occlusion_accuracy": accuracy}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_the_metrics_of_a_file_of_points_are_those_of_the_benchmark(seed, kind, sequence, tmp_path):
    """Points that are said to be occluded and seen again are one point; all their positions count for delta."""
    rng = np.random.default_rng(seed)
    n, k, truth = 60, len(sequence), make_truth(sequence, None)
    first = rng.integers(0, 3, n)
    start = rng.uniform(10, [150, 110], (n, 2))
    true_px, visible = np.full((n, k, 2), np.nan), np.zeros((n, k), dtype=bool)
    for point in range(n):
        world, _ = truth.anchor(int(first[point]), start[[point]])
        for frame in range(first[point], k):
            true_px[point, frame], status = truth.locate(frame, world)
            visible[point, frame] = status[0] == TruthStatus.valid
    known = np.isfinite(true_px[:, -1, 0])
    first, true_px, visible = first[known], true_px[known], visible[known]
    before = np.arange(k) < first[:, None]
    predicted = np.nan_to_num(true_px) + rng.normal(0, 3, true_px.shape) * rng.choice([0.2, 1, 4], (len(first), 1, 1))
    predicted[np.arange(len(first)), first] = true_px[np.arange(len(first)), first]
    occluded = before | (rng.random(visible.shape) < 0.3)
    occluded[np.arange(len(first)), first] = False
    path = tmp_path / f"points.{kind}"
    if kind == "npz":
        np.savez(path, tracks=predicted, occluded=occluded)
    else:
        point, frame = np.nonzero(~before)
        columns = {"track": point, "frame": frame, "occluded": occluded[point, frame]}
        pl.DataFrame({**columns, "u": predicted[point, frame, 0], "v": predicted[point, frame, 1]}).write_csv(path)
    scale = 256 / np.array([160, 120])
    expected = as_the_benchmark(scale * true_px, visible, first, scale * predicted, occluded)
    row = tn.tap_metrics(tn.measure(sequence, tn.Imported(str(path)))).row(0, named=True)
    assert row["n_points"] == len(first) > 40
    for name, value in expected.items():
        assert row[name] == pytest.approx(value, abs=1e-12), name
    assert row["delta_avg_reported"] < row["delta_avg"] - 0.05


def test_distances_are_scaled_to_the_raster(sequence):
    table = tn.tap_metrics(tn.measure(sequence, tn.LucasKanade(), speeds=[1, 2]))
    assert table.select("speed", "raster").rows() == [(1, "256x256"), (1, "image"), (2, "256x256"), (2, "image")]
    scaled, native = table.filter(speed=1).iter_rows(named=True)
    assert 0 < scaled["delta_avg_reported"] <= native["delta_avg_reported"] <= 1  # the image has fewer than 256 px
    assert scaled["occlusion_accuracy"] == native["occlusion_accuracy"]


def test_a_truth_that_cannot_locate_points_is_named(sequence):
    measured = tn.measure(sequence, tn.LucasKanade())
    object.__setattr__(measured, "truth", "scan")
    with pytest.raises(SettingsError):
        tn.tap_metrics(measured)
    with pytest.raises(SettingsError, match="measurement is None, expected what"):
        tn.tap_metrics(None)
