"""Measurements in memory give what a run of the same sequences gives."""

import gc
from dataclasses import replace

import numpy as np
import pytest
from tests.api.conftest import OPTIONS

import tracknoise as tn
from tracknoise.exceptions import SettingsError
from tracknoise.topics.catalogue import RUN_TABLES


def test_an_analysis_is_a_run_of_the_same_sequences(run, analysis):
    for name in RUN_TABLES:
        assert analysis.table(name).equals(run.table(name)), name
    assert analysis.sequences().equals(run.sequences())
    assert analysis.table("poses").equals(run.table("poses"))
    assert analysis.observations(scene="forward-00").equals(run.observations(scene="forward-00"))
    assert analysis.figure("lifetimes").to_dict() == run.figure("lifetimes").to_dict()


def test_few_scenes_leave_tests_undecided(analysis):
    assert set(analysis.table("zero_mean")["verdict"]) == {"undecided"}
    assert set(analysis.table("dependence")["verdict"]) == {"undecided"}


def test_settings_are_asked_for_by_name(measurements):
    one = tn.analyse(measurements[0], level=0.8, intervals="bca", margin=0.3, min_features=10**6)
    assert one.sequences()["scene"].to_list() == ["forward-00"]
    assert set(one.intervals()["level"].drop_nulls()) == {0.8}
    assert set(one.intervals(statistic="outlier_ratio")["kind"].drop_nulls()) == {"bca"}
    assert set(one.table("effects")["margin"].drop_nulls()) == {0.3}
    assert one.table("curves")["cut"].all()


def test_what_was_written_goes_with_the_analysis(measurements):
    made = tn.analyse(iter(measurements[:1]))
    folder = made.path
    assert folder.is_dir()
    del made
    gc.collect()
    assert not folder.exists()


def test_what_cannot_be_analysed_is_refused(measurements):
    with pytest.raises(SettingsError, match="no measurements, expected at least one"):
        tn.analyse([])
    for wrong in (None, [None]):
        with pytest.raises(SettingsError, match=r"measurement is None, expected what tracknoise\.measure returns"):
            tn.analyse(wrong)
    with pytest.raises(SettingsError, match="forward-00@default: found 2 measurements, expected one with all trackers"):
        tn.analyse([measurements[0]] * 2)
    with pytest.raises(SettingsError, match="found populations projected and visible, expected measurements of one"):
        tn.analyse([measurements[0], replace(measurements[1], population="projected")])
    with pytest.raises(SettingsError, match=r"analyse: findings\.level: found 2\.0, expected less than"):
        tn.analyse(measurements, level=2.0)
    with pytest.raises(SettingsError, match=r"analyse: findings\.intervals: found 'normal', expected 'student'"):
        tn.analyse(measurements, intervals="normal")


def test_a_measurement_knows_its_sequence(measurements):
    assert [measurement.sequence.id.scene for measurement in measurements] == ["forward-00", "sideways-00"]
    assert "sequence=" not in repr(measurements[0])


def test_tracks_that_have_one_row_each_are_analysed():
    """Ids that number the rows of a file: no error is seen."""
    row = np.arange(80)
    sequence = tn.open_sequence("simulated", **OPTIONS | {"motions": ["forward"]})
    alone = tn.Imported.from_arrays(row, row // 10, 20.0 + 15.0 * (row % 10), 40.0 + row)
    analysed = tn.analyse(tn.measure(sequence, {"rows": alone}))
    assert analysed.table("tracks").height == len(row)
    assert analysed.observations()["age"].max() == 0
