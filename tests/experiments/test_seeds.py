"""Runs with several random seeds: results are those of the first, and the others show how much they differ."""

import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tracknoise.analysis.seed_spread import SEED_SPREAD
from tracknoise.experiments.execute import execute
from tracknoise.tables.findings_schema import INTERVALS, STATISTICS_TABLES
from tracknoise.tables.store import SEED_TABLES, SEQUENCE_TABLES, RunFolder


def repeated(experiment, seeds=3):
    return experiment.model_copy(update={"seeds": seeds})


@pytest.fixture
def both(found, finished, made_once, told):
    """Runs of one seed and of three with their findings, which no test changes."""
    experiment, one = finished(2)

    def measure(path):
        execute(repeated(experiment), RunFolder(path), listener=told())

    return one, RunFolder(made_once("several-seeds", measure))


def test_results_are_those_of_the_first_seed(both, files):
    one, several = (files(run) for run in both)
    measured = [name for name in one if name.split("/")[0] in SEQUENCE_TABLES]
    assert len(measured) > 20
    assert {name: one[name] for name in measured} == {name: several[name] for name in measured}
    for table in STATISTICS_TABLES:
        assert_frame_equal(*(run.statistics(table) for run in both))
    assert {name.split("/")[0] for name in several.keys() - one.keys()} == set(SEED_TABLES)


def test_the_spread_between_seeds_is_a_table_and_widens_intervals(both):
    one, several = both
    assert one.statistics(SEED_SPREAD).is_empty()
    spread = several.statistics(SEED_SPREAD)
    assert set(spread["n_seeds"]) <= {2, 3}
    assert (spread["standard_deviation"] > 0).any()
    assert spread["widens_interval"].all()  # too few scenes to resample
    before, after = (run.statistics(INTERVALS) for run in both)
    assert before["value"].equals(after["value"])
    assert (after["high"] >= before["high"] - 1e-12).all()
    assert (after["high"] > before["high"] + 1e-9).any()


def test_each_seed_is_another_draw_and_the_same_in_every_run(both):
    _, several = both
    (key, *_) = sorted(several.manifest().sequences)
    ends = several.sequence_table("seed_ends", key)
    assert sorted(ends["seed"].unique()) == [1, 2]
    moments = several.sequence_table("seed_moments", key).partition_by("seed", include_key=False)
    assert not moments[0].equals(moments[1])
    assert several.has_sequence(several.manifest().sequences[key])
    assert pl.concat(moments).height == several.sequence_table("seed_moments", key).height
