from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.moments import block_moments, scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.tables.schema import BLOCKS, ORIGIN


def _scene(tracks, observations, *, n_tracks: int = 40, **origin: object) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Tracks of two ages each, one in five dropped, one in four occluded in the second."""
    numbers, rng = np.arange(n_tracks), np.random.default_rng(n_tracks)
    table = tracks(track=numbers.tolist(), kept=(numbers % 5 > 0).tolist(), **origin)
    seen = observations(
        track=numbers.repeat(2).tolist(),
        age=[0, 3] * n_tracks,
        frame=[7, 10] * n_tracks,
        truth=["valid", "valid", "valid", "valid", "valid", "valid", "valid", "occluded"] * (n_tracks // 4),
        du_px=rng.normal(size=2 * n_tracks).tolist(),
        dv_px=rng.normal(size=2 * n_tracks).tolist(),
        kept=(numbers % 5 > 0).repeat(2).tolist(),
        **origin,
    )
    return table, seen


def test_blocks_pooled_are_the_moments_of_the_scene(tracks, observations):
    table, seen = _scene(tracks, observations)
    blocks = block_moments(prepare_sequence(seen, table))
    n, u, uu = pl.col("n"), pl.col("mean_u"), pl.col("m_uu")
    pooled = blocks.group_by("trimming", "at").agg(
        n=n.sum(), u=(n * u).sum(), uu=(uu + n * u**2).sum(), abs_v=(n * pl.col("mean_abs_v")).sum()
    )
    scene = scene_moments(prepare_observations(seen)).filter(population="visible")
    expected = scene.select("trimming", "at", "n", u=n * u, uu=uu + n * u**2, abs_v=n * pl.col("mean_abs_v"))
    for found, true in zip(pooled.sort("trimming", "at").iter_rows(), expected.iter_rows(), strict=True):
        assert found[:3] == true[:3]
        assert found[3:] == pytest.approx(true[3:])


def test_hidden_features_count_where_they_are_asked_for(tracks, observations):
    table, seen = _scene(tracks, observations)
    both = block_moments(replace(prepare_sequence(seen, table), populations=("visible", "projected")))
    counts = both.filter(trimming="untrimmed", at=3).group_by("population").agg(pl.col("n").sum()).sort("population")
    assert counts.rows() == [("visible", 30), ("projected", 40)]
    assert both.filter(population="visible").equals(block_moments(prepare_sequence(seen, table)))


def test_a_block_holds_the_errors_of_its_tracks(tracks, observations):
    table = tracks(track=list(range(16)))
    seen = observations(track=[0, 0, 15], age=[0, 2, 2], du_px=[0.0, 3.0, -1.0], dv_px=[0.0, 0.0, 0.5])
    found = block_moments(prepare_sequence(seen, table)).filter(trimming="untrimmed", at=2)
    assert found.select("block", "n", "mean_u", "mean_v", "m_uu").rows() == [
        (0, 1, 3.0, 0.0, 0.0),
        (15, 1, -1.0, 0.5, 0.0),
    ]


def test_along_frames_instead_of_ages(tracks, observations):
    table, seen = _scene(tracks, observations)
    found = block_moments(prepare_sequence(seen, table, axis="frame"))
    assert found["axis"].unique().to_list() == ["frame"]
    assert sorted(found["at"].unique()) == [7, 10]


def test_scenes_and_conditions_are_kept_apart(tracks, observations):
    parts = [_scene(tracks, observations, n_tracks=n, scene=f"s{n}") for n in (20, 40)]
    table, seen = (pl.concat(tables) for tables in zip(*parts, strict=True))
    expected = pl.concat([block_moments(prepare_sequence(part[1], part[0])) for part in parts])
    assert block_moments(prepare_sequence(seen, table)).equals(
        expected.sort(*ORIGIN, "block", "population", "trimming", "axis", "at")
    )


def test_the_order_of_rows_does_not_matter(tracks, observations):
    table, seen = _scene(tracks, observations)
    shuffled = block_moments(prepare_sequence(seen.sample(fraction=1.0, shuffle=True, seed=1), table))
    expected = block_moments(prepare_sequence(seen, table))
    assert shuffled.drop(*(c for c in BLOCKS if c.startswith("m"))).equals(
        expected.drop(*(c for c in BLOCKS if c.startswith("m")))
    )
    np.testing.assert_allclose(shuffled["m_uu"].to_numpy(), expected["m_uu"].to_numpy(), atol=1e-14)


def test_an_observation_of_no_track_is_refused(tracks, observations):
    with pytest.raises(SchemaError, match="track number"):
        block_moments(prepare_sequence(observations(track=[3], age=[1]), tracks(track=[0, 1])))


def test_nothing_in_nothing_out(tracks, observations):
    found = block_moments(prepare_sequence(observations(track=[]), tracks(track=[])))
    assert found.is_empty()
    assert dict(found.schema) == {k: v() if isinstance(v, type) else v for k, v in BLOCKS.items()}
