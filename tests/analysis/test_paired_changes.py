import polars as pl
import pytest
from benchmarks.effects.schema import CLEAN, EFFECT_VALUES
from benchmarks.effects.study import paired_changes
from scipy import stats


def table(values: dict[tuple[str, str], float | None], statistic: str = "core") -> pl.DataFrame:
    """Values by scene and effect."""
    rows = [
        {
            "scene": scene,
            "effect": effect,
            "size": "bad",
            "tracker": "t",
            "age": 3,
            "statistic": statistic,
            "value": value,
        }
        for (scene, effect), value in values.items()
    ]
    return pl.DataFrame(rows, schema=dict(EFFECT_VALUES))


def test_changes_are_paired_within_scenes() -> None:
    clean, blurred = (1.0, 5.0, 9.0), (1.5, 5.7, 9.3)
    values = {(f"s{i}", CLEAN): value for i, value in enumerate(clean)}
    values |= {(f"s{i}", "blur"): value for i, value in enumerate(blurred)}
    (row,) = paired_changes(table(values)).to_dicts()
    differences = [after - before for before, after in zip(clean, blurred, strict=True)]
    low, high = stats.t.interval(0.95, 2, 0.5, stats.sem(differences))
    assert (row["clean"], row["changed"], row["n_scenes"]) == (5.0, pytest.approx(5.5), 3)
    assert row["change"] == pytest.approx(0.5)
    assert (row["change_low"], row["change_high"]) == (pytest.approx(low), pytest.approx(high))


def test_scenes_without_one_of_the_values_take_no_part() -> None:
    values = {("a", CLEAN): 1.0, ("b", CLEAN): None, ("c", CLEAN): 3.0, ("d", CLEAN): 5.0}
    values |= {("a", "blur"): 2.0, ("b", "blur"): 9.0, ("c", "blur"): None, ("d", "blur"): 8.0}
    (row,) = paired_changes(table(values)).to_dicts()
    assert (row["clean"], row["changed"], row["change"], row["n_scenes"]) == (3.0, 5.0, 2.0, 2)


def test_one_scene_has_a_change_without_an_interval_and_none_has_no_change() -> None:
    values = {("a", CLEAN): 1.0, ("a", "blur"): 2.0, ("a", "noise"): None}
    blur, noise = paired_changes(table(values)).to_dicts()
    assert (blur["change"], blur["change_low"], blur["change_high"], blur["n_scenes"]) == (1.0, None, None, 1)
    assert (noise["clean"], noise["change"], noise["n_scenes"]) == (None, None, 0)


def test_a_higher_level_gives_wider_intervals() -> None:
    values = {(f"s{i}", CLEAN): 0.0 for i in range(4)} | {(f"s{i}", "blur"): float(i) for i in range(4)}
    wide, narrow = (paired_changes(table(values), level=level)["change_high"][0] for level in (0.99, 0.9))
    assert wide > narrow > 1.5
