import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.changes import change_curves, increments
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.findings_schema import CHANGES
from tracknoise.tables.schema import INCREMENTS, OBSERVATIONS, empty

FRAMES, TRACKS = 6, 40


@pytest.fixture
def errors() -> np.ndarray:
    """Errors of tracks of two scenes, (scenes, tracks, frames, 2)."""
    walk = np.random.default_rng(0).normal([0.1, -0.2], [0.5, 0.3], (2, TRACKS, FRAMES, 2)).cumsum(axis=2)
    walk[:, :, 0] = 0.0
    return walk


@pytest.fixture
def measured(errors, observations, tracks) -> list[pl.DataFrame]:
    """Increments of each scene."""
    found = []
    for scene, name in zip(errors, ("a", "b"), strict=True):
        ages = list(range(FRAMES)) * TRACKS
        values = scene.reshape(-1, 2)
        rows = observations(
            scene=name,
            track=np.repeat(range(TRACKS), FRAMES).tolist(),
            frame=ages,
            age=ages,
            du_px=values[:, 0].tolist(),
            dv_px=values[:, 1].tolist(),
        )
        found.append(increments(prepare_sequence(rows, tracks(scene=name, track=list(range(TRACKS))))))
    return found


def test_means_and_covariances_are_those_of_all_changes_of_an_age(errors, measured) -> None:
    table = change_curves(measured).filter(trimming="untrimmed", lag=0)
    assert table["age"].to_list() == [1, 2, 3, 4, 5]
    for row in table.to_dicts():
        changes = np.diff(errors, axis=2)[:, :, row["age"] - 1].reshape(-1, 2)
        covariance = np.cov(changes.T)
        assert (row["n"], row["n_scenes"], row["autocorrelation_u"]) == (2 * TRACKS, 2, None)
        assert [row["mean_u_px"], row["mean_v_px"]] == pytest.approx(changes.mean(axis=0))
        found = [row[f"covariance_{pair}"] for pair in ("uu", "uv", "vv")]
        assert found == pytest.approx([covariance[0, 0], covariance[0, 1], covariance[1, 1]])


def test_autocorrelation_pools_all_ages(errors, measured) -> None:
    table = change_curves(measured).filter(trimming="untrimmed", lag=2)
    changes = np.diff(errors[..., 0], axis=2)
    now, before = changes[:, :, 2:], changes[:, :, :-2]
    row = table.row(0, named=True)
    assert (row["age"], row["n"], row["covariance_uu"]) == (None, now.size, None)
    assert row["autocorrelation_u"] == pytest.approx(2 * (now * before).sum() / (now**2 + before**2).sum())


def test_tables_one_by_one_give_what_they_give_together(measured) -> None:
    assert change_curves(iter(measured)).equals(change_curves(pl.concat(measured)))


def test_one_change_has_a_mean_and_no_covariance(observations, tracks) -> None:
    rows = observations(frame=[0, 1], age=[0, 1], du_px=[0.0, 1.0], dv_px=[0.0, 2.0])
    row = change_curves(increments(prepare_sequence(rows, tracks(track=[0])))).row(0, named=True)
    assert (row["mean_u_px"], row["mean_v_px"], row["covariance_uu"]) == (1.0, 2.0, None)


def test_nothing_gives_nothing_and_another_table_is_refused() -> None:
    assert change_curves(empty(INCREMENTS)).equals(empty(CHANGES))
    with pytest.raises(SchemaError, match="increments"):
        change_curves(empty(OBSERVATIONS))
