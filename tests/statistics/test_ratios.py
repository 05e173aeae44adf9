"""Ratios of sums over features: by hand, and that each that is declared has its sum, its sentence and its figure."""

from string import Formatter

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.ratio_intervals import ratio_intervals
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.ratios import NUMERATORS, ratio_sums
from tracknoise.tables.quantities import QUANTITIES, RATIOS

AGES = 7


def sums(observations, tracks, scene: str, far: float) -> pl.DataFrame:
    """Of 20 tracks, the first eight of which are `far` px off from age 4 on; the first is not kept, one is occluded."""
    track, age = np.repeat(np.arange(20), AGES), np.tile(np.arange(AGES), 20)
    seen = observations(
        scene=scene,
        track=track.tolist(),
        age=age.tolist(),
        frame=age.tolist(),
        du_px=np.where((track < 8) & (age >= 4), far, 0.1).tolist(),
        dv_px=np.full(len(track), 0.1).tolist(),
        truth=np.where((track == 19) & (age == 6), "occluded", "valid").tolist(),
        kept=(track > 0).tolist(),
    )
    lived = tracks(scene=scene, track=list(range(20)), lifetime=AGES, kept=[place > 0 for place in range(20)])
    return ratio_sums(prepare_sequence(seen, lived))


def test_shares_of_gross_errors_by_hand(observations, tracks) -> None:
    table = sums(observations, tracks, "a", 3.1).group_by("trimming", "at").agg(pl.col("n", "sum").sum())
    shares = {(row["trimming"], row["at"]): (row["sum"], row["n"]) for row in table.to_dicts()}
    assert shares["untrimmed", 3] == (0, 20)
    assert shares["untrimmed", 4] == (8, 20)
    assert shares["untrimmed", 6] == (8, 19)  # without the occluded one
    assert shares["trimmed", 5] == (7, 19)
    assert ("untrimmed", 0) not in shares  # where errors are zero by construction
    below = sums(observations, tracks, "a", 2.9)
    assert below["sum"].sum() == 0


def test_scenes_are_pooled_and_have_intervals(observations, tracks) -> None:
    scenes = [sums(observations, tracks, f"scene {place}", 3.1 if place % 2 else 0.2) for place in range(8)]
    found = ratio_intervals(scenes).filter(trimming="untrimmed", at=4)
    assert found["value"].item() == pytest.approx(0.2)
    assert found["n"].item() == 160
    assert found["n_scenes"].item() == 8
    assert 0.0 < found["low"].item() < 0.2 < found["high"].item() < 1.0


def test_every_declared_ratio_has_what_is_made_from_it() -> None:
    assert set(RATIOS) == set(NUMERATORS)
    for name in RATIOS:
        quantity = QUANTITIES[name]
        assert quantity.title
        assert {field for _, field, _, _ in Formatter().parse(quantity.sentence) if field} == {"value", "tracker"}
