"""Table and figure of `python -m benchmarks.effects`."""

from pathlib import Path

import altair as alt
import polars as pl
import pytest
from benchmarks.effects.files import effect_cells, effect_sizes, markdown, write_effects
from benchmarks.effects.schema import EFFECT_CHANGES, EFFECT_UNITS, EffectStatistic, Size

from tracknoise.report.figure_files import specification


@pytest.fixture
def changes() -> pl.DataFrame:
    rows = [
        {
            "effect": effect,
            "kind": "images",
            "size": size,
            "shown": f"{place} ms",
            "tracker": tracker,
            "age": 10,
            "statistic": name,
            "unit": EFFECT_UNITS[name],
            "clean": 0.25,
            "changed": 0.25 + place,
            "change": place - 0.5,
            "change_low": place - 0.75,
            "change_high": place - 0.25,
            "n_scenes": 3,
        }
        for effect in ("blur", "=noise|")
        for place, size in enumerate(Size)
        for tracker in ("lk", "orb")
        for name in EffectStatistic
    ]
    rows[0] |= dict.fromkeys(("change", "change_low", "change_high", "changed"))
    return pl.DataFrame(rows, schema=dict(EFFECT_CHANGES))


def test_one_row_per_effect_and_size_after_the_values_without_effects(changes: pl.DataFrame) -> None:
    first, second = effect_cells(changes, level=0.95)
    assert first.caption.startswith("lk: change at age 10 by each effect alone (mean over 3 scenes, ± half the 95% ")
    assert second.caption.startswith("orb: ")
    assert [row[:3] for row in second.rows[:4]] == [
        ["none", "", ""],
        ["blur", "low", "0 ms"],
        ["blur", "usual", "1 ms"],
        ["blur", "bad", "2 ms"],
    ]
    assert second.rows[0][3:] == ["0.250", "0.250", "0.250", "0.250", "0.2", "25.00"]
    assert second.rows[1][3:] == [*["−0.500 ± 0.250 *"] * 4, "−0.5 ± 0.2 *", "−50.00 ± 25.00 *"]
    assert second.rows[2][3] == "+0.500 ± 0.250 *"
    assert first.rows[1][3] == "–"


def test_an_interval_with_zero_in_it_has_no_mark(changes: pl.DataFrame) -> None:
    (_, second) = effect_cells(changes.with_columns(change_low=-9.0), level=0.95)
    assert second.rows[2][3] == "+0.500 ± 4.875"


def test_values_of_fewer_scenes_say_so_and_the_first_row_has_those_of_most(changes: pl.DataFrame) -> None:
    """As lifetimes do that have no median in some scenes with the first effect."""
    few = (pl.col("effect") == "blur") & (pl.col("statistic") == "lifetime")
    changes = changes.with_columns(
        n_scenes=pl.when(few).then(2).otherwise("n_scenes").cast(pl.Int32),
        clean=pl.when(few).then(9.0).otherwise("clean"),
    )
    (_, second) = effect_cells(changes, level=0.95)
    assert second.caption.endswith("[n]: mean over the n scenes that have both values.")
    assert second.rows[0][3:] == ["0.250", "0.250", "0.250", "0.250", "0.2", "25.00"]
    assert second.rows[1][7] == "−0.5 ± 0.2 * [2]"
    assert second.rows[1][6] == "−0.500 ± 0.250 *"


def test_markdown_is_a_table(changes: pl.DataFrame) -> None:
    first, _ = effect_cells(changes, level=0.95)
    lines = markdown(first).splitlines()
    assert lines[0] == first.caption
    assert {line.count("|") - line.count("\\|") for line in lines[2:]} == {10}


def test_the_figure_keeps_the_schema_and_draws_every_effect(changes: pl.DataFrame) -> None:
    spec = specification(effect_sizes(changes))
    alt.ConcatChart.validate(spec)
    assert len(spec["concat"]) == len(EffectStatistic)


def test_files_are_written(changes: pl.DataFrame, tmp_path: Path) -> None:
    paths = write_effects(tmp_path, changes, level=0.95)
    assert sorted(path.name for path in paths) == ["effects.csv", "effects.md", "effects.png", "effects.svg"]
    assert pl.read_csv(tmp_path / "effects.csv").height == changes.height
    assert "blur" in (tmp_path / "effects.svg").read_text()
    assert (tmp_path / "effects.png").read_bytes().startswith(b"\x89PNG")
