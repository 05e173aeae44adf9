"""Errors of the tracks that live long, told beside those of all."""

import re
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.report.figures import error_curves
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import number, px

ONE = {"scenes": ("only",), "trackers": ("one",), "speeds": (1,), "n_frames": 30, "percentile": None}


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(**ONE))


def test_the_longest_lived_are_told_beside_all_at_an_age_before_they_are_all(data: ReportData) -> None:
    (figure,) = error_curves.survivorship_figures(data)
    assert isinstance(figure, Figure)
    told = re.match(
        r"At age (\d+), the RMS .* that live to age (\d+) it is .* These are (\S+) of (\S+) features\.",
        figure.look_for,
    )
    age, longest = int(told.group(1)), int(told.group(2))
    assert 0 < age < longest
    observed = data.run.sequence_table("observations", next(iter(data.sequences)))
    oldest = pl.col("age").max().over("track")
    every = observed.with_columns(oldest=oldest).filter(pl.col("truth") == "valid", pl.col("age") == age)
    parts = {"all tracks is": every, f"to age {longest} it is": every.filter(pl.col("oldest") >= longest)}
    for subject, errors in parts.items():
        u, v = (np.sqrt(np.sum(errors[name].to_numpy() ** 2) / errors.height) for name in ("du_px", "dv_px"))
        assert f"{subject} {px(u)} in u and {px(v)} in v." in figure.look_for
    survivors = every.filter(pl.col("oldest") >= longest).height
    assert (told.group(3), told.group(4)) == (number(survivors), number(every.height))
    assert survivors < every.height


def test_only_lives_that_enough_features_reach_are_drawn(data: ReportData) -> None:
    (figure,) = error_curves.survivorship_figures(data)
    assert isinstance(figure, Figure)
    (legend,) = [one["value"] for one in figure.spec["params"] if one["name"] == "shown_tracks"]
    names = [entry["tracks"] for entry in legend]
    assert names[:2] == ["all", "to age 5"]
    assert "to age 50" not in names  # the sequence has 30 frames


def test_where_nobody_lives_long_there_is_nothing_to_tell(make_run: Callable[..., RunFolder]) -> None:
    (item,) = error_curves.survivorship_figures(ReportData.of(make_run(**{**ONE, "n_frames": 5})))
    assert isinstance(item, Absence)
    assert "age 5" in item.why
