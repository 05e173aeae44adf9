import math

import polars as pl
import pytest

from tracknoise.exceptions import SchemaError, UnknownNameError
from tracknoise.statistics.prepared import in_population
from tracknoise.tables.schema import TruthStatus

STATUSES = [status.name for status in TruthStatus]


@pytest.mark.parametrize(
    ("population", "statuses"), [("visible", ["valid"]), ("projected", ["valid", "occluded", "out_of_image"])]
)
def test_a_population_is_its_statuses(observations, population: str, statuses: list[str]) -> None:
    table = observations(truth=STATUSES)
    assert table.filter(pl.Series(in_population(table, population)))["truth"].to_list() == statuses


def test_an_unknown_population_lists_the_known_ones(observations) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown population 'visibel' \(did you mean 'visible'\?\)"):
        in_population(observations(track=[0]), "visibel")


@pytest.mark.parametrize("broken", [None, math.nan, math.inf])
@pytest.mark.parametrize("column", ["du_px", "dv_px"])
def test_a_known_true_position_without_a_finite_error_is_refused(observations, column: str, broken) -> None:
    table = observations(track=[3, 7], frame=[5, 6], **{column: [0.0, broken]})
    with pytest.raises(SchemaError, match="track 7 of 'a' in frame 6 has truth 'valid' but no finite du_px, dv_px"):
        in_population(table, "visible")


def test_an_unknown_true_position_needs_no_error(observations) -> None:
    table = observations(truth=["no_depth", "valid"], du_px=[None, 1.0], dv_px=[None, 1.0])
    assert in_population(table, "projected").tolist() == [False, True]
