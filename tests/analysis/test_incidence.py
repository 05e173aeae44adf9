import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import Sampling
from tracknoise.analysis.lifetime_intervals import INCIDENCE, incidence_table
from tracknoise.exceptions import SchemaError, SettingsError
from tracknoise.statistics.lifetimes import count_ends, lifetimes_of_ends
from tracknoise.tables.schema import CAUSES, ENDS, TRACKS, TrackEnd, empty

ENDINGS = [end.name for end in TrackEnd]


def lived(
    rng: np.random.Generator, scene: str, n_tracks: int = 60, hazards: dict[str, float] | None = None
) -> pl.DataFrame:
    """Tracks with a hazard of their own for each cause, in sequences of 12 frames in which tracks begin at any time."""
    hazards = hazards or {"lost": 0.05, "outlier": 0.1, "displaced": 0.02, "masked": 0.08}
    ends = np.stack([rng.geometric(hazard, n_tracks) for hazard in hazards.values()])
    last = 13 - rng.integers(1, 13, n_tracks)
    life = np.minimum(ends.min(axis=0), last)
    cause = np.where(ends.min(axis=0) < last, np.array(list(hazards))[ends.argmin(axis=0)], "sequence_end")
    columns = {"dataset": "d", "scene": scene, "lighting": "l", "rotation": 0, "direction": "forward", "camera": ""}
    columns |= {"tracker": "t", "speed": 1, "track": np.arange(n_tracks), "lifetime": life, "end": cause}
    table = pl.DataFrame(columns)
    missing = [pl.lit(None).alias(name) for name in TRACKS if name not in columns]
    return table.with_columns(missing).select(pl.col(name).cast(kind) for name, kind in TRACKS.items())


def scenes(n_scenes: int, seed: int = 0, **options: object) -> pl.DataFrame:
    rng = np.random.default_rng(seed)
    return pl.concat(lived(rng, f"s{number}", **options) for number in range(n_scenes))


def textbook(tracks: pl.DataFrame, cause: str) -> dict[int, float]:
    """Aalen-Johansen, one event time after the other. Censorings count as one frame earlier."""
    times = [(life - (end == "sequence_end"), end) for life, end in tracks.select("lifetime", "end").rows()]
    found, alive, total = {}, 1.0, 0.0
    for lifetime in range(max(tracks["lifetime"]) + 1):
        at_risk = sum(time >= lifetime for time, _ in times)
        events = [end for time, end in times if time == lifetime and end != "sequence_end"]
        if at_risk:
            total += alive * events.count(cause) / at_risk
            alive *= 1 - len(events) / at_risk
        found[lifetime] = total
    return found


@pytest.mark.parametrize("n_scenes", [1, 7])
def test_the_incidence_is_that_of_the_textbook(n_scenes: int) -> None:
    tracks = scenes(n_scenes)
    table = incidence_table(count_ends(tracks))
    for cause in CAUSES:
        expected = textbook(tracks, cause)
        one = table.filter(cause=cause)
        assert one.height > 5
        np.testing.assert_allclose(one["incidence"], [expected[at] for at in one["lifetime"]], atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_incidences_and_survival_add_up_to_one(seed: int) -> None:
    ends = count_ends(scenes(3, seed=seed, n_tracks=5 + 10 * seed))
    total = incidence_table(ends).group_by("lifetime").agg(pl.col("incidence").sum()).sort("lifetime")
    survival = lifetimes_of_ends(ends)["survival"].forward_fill()
    np.testing.assert_allclose(total["incidence"] + survival, 1.0, atol=1e-12)


def test_with_one_cause_the_incidence_is_one_minus_the_survival() -> None:
    ends = count_ends(scenes(6, hazards={"outlier": 0.2}))
    table = incidence_table(ends)
    survival = lifetimes_of_ends(ends)["survival"].forward_fill()
    np.testing.assert_allclose(table.filter(cause="outlier")["incidence"], 1 - survival, atol=1e-12)
    assert (table.filter(pl.col("cause") != "outlier")["incidence"] == 0).all()


def test_bounds_are_around_the_incidence_where_it_is_between_0_and_1() -> None:
    table = incidence_table(count_ends(scenes(8, hazards={"lost": 0.1, "outlier": 0.1})))
    inside = table.filter(pl.col("incidence") > 0)
    assert (inside["low"] < inside["incidence"]).all()
    assert (inside["incidence"] < inside["high"]).all()
    assert ((inside["low"] > 0) & (inside["high"] < 1)).all()
    assert table.filter(incidence=0.0)["low"].is_null().all()
    assert table["resampled"].unique().to_list() == ["scenes"]
    assert incidence_table(count_ends(scenes(2)))["resampled"].unique().to_list() == ["blocks"]


def test_bands_hold_the_true_incidence_of_scenes_that_differ() -> None:
    # The hazard of outliers differs between scenes (log sd 0.4), that of masking does not.
    rng, held = np.random.default_rng(3), []
    spread = np.exp(0.4 * np.random.default_rng(0).normal(size=20_000))
    outlier, masked = 0.06 * spread, 0.05
    stays = (1 - outlier) * (1 - masked)
    # Of ends by two independent causes in the same frame, the first named counts.
    expected = np.mean(outlier * (1 - stays**6) / (1 - stays))
    for _ in range(60):
        hazards = 0.06 * np.exp(0.4 * rng.normal(size=8))
        parts = [lived(rng, f"s{i}", hazards={"outlier": hazard, "masked": masked}) for i, hazard in enumerate(hazards)]
        row = incidence_table(count_ends(pl.concat(parts))).row(
            by_predicate=(pl.col("cause") == "outlier") & (pl.col("lifetime") == 6), named=True
        )
        held.append(row["low"] <= expected <= row["high"])
    assert 0.88 < np.mean(held) < 0.995


def test_nothing_gives_an_empty_table_and_wrong_input_one_line() -> None:
    assert incidence_table(empty(ENDS)).equals(empty(INCIDENCE))
    with pytest.raises(SchemaError, match="ends"):
        incidence_table(empty(TRACKS))
    with pytest.raises(SettingsError, match="kind of interval"):
        incidence_table(empty(ENDS), Sampling(kind="normal"))
