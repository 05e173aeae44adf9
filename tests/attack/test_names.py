"""A small version of `python -m benchmarks.attack names`, and whether it would notice what it looks for."""

import random

import pytest
from benchmarks.attack import names
from tests.lean import without_audit, without_depths, without_geometry

from tracknoise.report import page
from tracknoise.report.figures.families import FAMILIES

DRAWN = ("error-by-tracker", "lifetimes", "feature-counts", "trajectory")
"""Families of figures of the reports; `tests/contract/test_figures.py` draws all of them with odd names."""


def test_naughty_names_go_through_the_pipeline(monkeypatch, tmp_path, capsys):
    chosen = ["a b", "\x1b[31m", "\udcff"]
    monkeypatch.setattr(names, "chosen_names", lambda count, rng: iter(chosen))
    monkeypatch.setattr(names, "memory_folder", lambda: tmp_path)
    monkeypatch.setattr(names, "FORMATS", ("svg",))  # PNG follows from SVG
    monkeypatch.setattr(page, "FAMILIES", [family for family in FAMILIES if family.id in DRAWN])
    with without_audit(), without_depths(), without_geometry():  # which have no names of their own
        assert names.main(["--batch", "3"]) == 0
    printed = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert printed[-1] == "3 names, seed 0: 0 not dealt with"
    assert {"1 name of a tracker: accepted", "2 name of a tracker: refused"} <= {*printed}
    assert {"2 scene: measured", "1 scene: failed", "1 tracker: shown", "1 lighting: shown"} <= {*printed}


def test_mixtures_differ_and_are_those_of_the_seed():
    count = len(names.NAUGHTY) + 50
    chosen = list(names.chosen_names(count, random.Random(1)))
    assert len(set(chosen)) == len(chosen) == count
    assert set(names.NAUGHTY) < set(chosen)
    assert chosen == list(names.chosen_names(count, random.Random(1)))


@pytest.mark.parametrize("cell", ["=1", "+x", "-x", "@x", "-"])
def test_formulas_and_control_characters_are_found(tmp_path, cell):
    path = tmp_path / "table.csv"
    path.write_text(f"name,value\n{cell},-1.5e-07\n'=1,+2\n", encoding="utf-8")
    assert list(names.cells_of(path)) == [f"WRONG: table.csv has the cell {cell!r}"]
    assert list(names.printed("page", "plain\ttext\n")) == []
    assert list(names.printed("page", "\x1b[31m")) == ["WRONG: page holds ['\\x1b']"]
