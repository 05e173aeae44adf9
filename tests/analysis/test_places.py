"""Errors by place over scenes: planted effects are found with the right numbers, and noise alone is not."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.places_found import image_cells, speed_errors, surrounding_errors
from tracknoise.exceptions import SchemaError
from tracknoise.tables.schema import IMAGE_MAP, IMAGE_SPEEDS, SURROUNDINGS, Schema, empty

SCENES = 10
LABELS = {
    "dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk", "speed": 1,
    "axis": "age",
}  # fmt: skip


def table(schema: Schema, rows: list[dict[str, object]]) -> pl.DataFrame:
    return pl.DataFrame([{**LABELS, **row} for row in rows], schema=dict(schema), orient="row")


def sums(errors: np.ndarray) -> dict[str, float]:
    u, v = errors.T
    found = {"sum_u": u, "sum_v": v, "sum_uu": u * u, "sum_uv": u * v, "sum_vv": v * v}
    return {"n": len(errors), **{name: float(values.sum()) for name, values in found.items()}}


def sided(rng: np.random.Generator, *, far_px: float, n_scenes: int = SCENES) -> pl.DataFrame:
    """A tenth of the features on the far side of an edge, with a mean error of their own; one block in two has none."""
    rows = []
    for scene in range(n_scenes):
        for block in range(8):
            errors = rng.normal(scale=0.5, size=(100, 2))
            far = np.arange(100) < 20 * (block % 2)
            errors[far, 0] += far_px
            for chosen, low, high in ((far, -2.0, 0.0), (~far, None, None)):
                if chosen.any():
                    along = {"n_directed": 0, **dict.fromkeys(("sum_along", "sum_across"), 0.0)}
                    along |= dict.fromkeys(("sum_along_2", "sum_across_2"), 0.0)
                    place = {"scene": f"{scene}", "block": block, "at": 20, "surrounding": "edge"}
                    rows.append(
                        {**place, "low": low, "high": high, "occlusion": "never", **sums(errors[chosen]), **along}
                    )
    return table(SURROUNDINGS, rows)


def read(found: pl.DataFrame, **chosen: object) -> dict[str, dict[str, float]]:
    return {row["statistic"]: row for row in found.filter(**chosen).to_dicts()}


@pytest.mark.parametrize("n_scenes", [SCENES, 2])
def test_shares_of_a_class_are_of_all_features_even_where_a_block_has_none_of_it(n_scenes: int) -> None:
    made = sided(np.random.default_rng(3), far_px=-2.0, n_scenes=n_scenes)
    far = read(surrounding_errors(made), surrounding="side", coordinate="u", **{"class": "far"})
    total = made.select(pl.col("n", "sum_u", "sum_uu").sum()).row(0)
    n, s, q = made.filter(pl.col("low") == -2.0).select(pl.col("n", "sum_u", "sum_uu").sum()).row(0)
    expected = {
        "mean": s / n, "second": q / n, "share": n / total[0], "share_of_mean": s / total[1],
        "share_of_second": q / total[2], "mean_without": (total[1] - s) / (total[0] - n),
        "second_removed": 1 - (total[2] - q) / (total[0] - n) / (total[2] / total[0]),
        "second_removed_by_others": 1 - q / n / (total[2] / total[0]),
    }  # fmt: skip
    assert {name: row["value"] for name, row in far.items()} == pytest.approx(expected)
    assert far["mean"]["low"] < -2.0 < far["mean"]["high"]
    assert far["share_of_mean"]["low"] > 0.5
    assert far["share"]["value"] == pytest.approx(0.1)
    assert far["mean"]["n"] == n
    assert far["mean"]["resampled"] == ("scenes" if n_scenes == SCENES else "blocks")


def test_no_more_than_all_of_the_second_moment_is_removed() -> None:
    far = sided(np.random.default_rng(3), far_px=-20.0, n_scenes=1).with_columns(
        pl.col("sum_uu") * pl.col("block").replace_strict({1: 9.0}, default=1.0)
    )
    removed = read(surrounding_errors(far), surrounding="side", coordinate="u", **{"class": "far"})["second_removed"]
    assert 0.9 < removed["low"] < removed["value"] < removed["high"] <= 1.0


def test_intervals_of_a_class_without_effect_contain_zero_as_often_as_they_say() -> None:
    seeds = range(100)
    hits = 0
    for seed in seeds:
        found = surrounding_errors(sided(np.random.default_rng(seed), far_px=0.0, n_scenes=6))
        row = read(found, surrounding="side", coordinate="u", **{"class": "far"})["mean"]
        hits += row["low"] <= 0.0 <= row["high"]
    assert 0.90 <= hits / len(seeds) <= 0.99


def test_occlusion_divides_all_features_and_the_other_classes_the_visible_ones() -> None:
    made = sided(np.random.default_rng(5), far_px=0.0)
    depth = made.with_columns(surrounding=pl.lit("depth", dtype=made.schema["surrounding"]), low=2.0, high=3.0)
    hidden = depth.with_columns(occlusion=pl.lit("now", dtype=made.schema["occlusion"]), sum_u=-5.0 * pl.col("n"))
    both = pl.concat([depth.cast(dict(SURROUNDINGS)), hidden.cast(dict(SURROUNDINGS))])
    found = surrounding_errors(both)
    now = read(found, surrounding="occlusion", coordinate="u", **{"class": "now"})
    assert now["share"]["value"] == pytest.approx(0.5)
    assert now["mean"]["value"] == pytest.approx(-5.0)
    assert abs(now["mean_without"]["value"]) < 0.1
    at_depth = read(found, surrounding="depth", coordinate="u")
    assert at_depth["share"]["value"] == 1.0
    assert abs(at_depth["mean"]["value"]) < 0.1


def cells(rng: np.random.Generator, *, radial: float) -> pl.DataFrame:
    rows = []
    for scene in range(SCENES):
        for row in range(14):
            for column in range(20):
                errors = rng.normal(scale=0.3, size=(10, 2)) + radial * np.array([column - 9.5, row - 6.5])
                rows.append({"scene": f"{scene}", "block": 0, "at": 5, "column": column, "row": row, **sums(errors)})
    return table(IMAGE_MAP, rows)


def test_cells_of_noise_differ_from_zero_by_chance_only_and_radial_errors_do() -> None:
    rng = np.random.default_rng(8)
    noise, radial = (image_cells(cells(rng, radial=size)) for size in (0.0, 0.05))
    assert 0.01 <= noise["differs"].mean() <= 0.09
    corner = radial.filter(row=0, column=0).row(0, named=True)
    assert corner["differs"]
    assert corner["mean_u_low"] < -0.475 < corner["mean_u_high"]
    assert corner["mean_v_low"] < -0.325 < corner["mean_v_high"]
    assert radial["spread_px"].mean() == pytest.approx(0.3, rel=0.05)
    outer = radial.filter((pl.col("column") < 2) | (pl.col("column") > 17))
    assert outer["differs"].all()


def test_errors_in_proportion_to_the_speed_are_found_along_the_motion() -> None:
    rng = np.random.default_rng(2)
    rows = []
    for scene in range(SCENES):
        for octave in range(4):
            along = 0.1 * 2.0**octave + rng.normal(scale=0.1, size=50)
            across = rng.normal(scale=0.1, size=50)
            place = {
                "scene": f"{scene}",
                "block": 0,
                "at": 10,
                "low": 2.0**octave,
                "high": 2.0 ** (octave + 0.5),
                "n": 50,
            }
            both = {"sum_along": along.sum(), "sum_across": across.sum()}
            rows.append({**place, **both, "sum_along_2": (along**2).sum(), "sum_across_2": (across**2).sum()})
    found = speed_errors(table(IMAGE_SPEEDS, rows))
    along = found.filter(coordinate="along").sort("class_low")
    assert along["mean_px"].to_list() == pytest.approx([0.1, 0.2, 0.4, 0.8], abs=0.02)
    assert (along["low"] > 0).all()
    assert found.filter(coordinate="across")["mean_px"].to_list() == pytest.approx([0.0] * 4, abs=0.02)


def test_nothing_measured_gives_empty_tables_and_wrong_ones_are_refused() -> None:
    for make, schema in ((surrounding_errors, SURROUNDINGS), (image_cells, IMAGE_MAP), (speed_errors, IMAGE_SPEEDS)):
        assert make(empty(schema)).is_empty()
        with pytest.raises(SchemaError):
            make(empty(schema).drop("n"))
