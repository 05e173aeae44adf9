"""Runs that keep statistics alone, and runs that gain scenes: observations are never read again."""

import shutil

import pytest

from tracknoise.analysis.factors import DEPENDENCE
from tracknoise.exceptions import StoreError, TracknoiseError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import FindingsSettings, parse_experiment
from tracknoise.tables.findings_schema import FINDINGS, INTERVALS, STATISTICS_TABLES, SUMMARY
from tracknoise.tables.store import OBSERVED, RunFolder
from tracknoise.topics.catalogue import RUN_TABLES


@pytest.fixture
def read(monkeypatch) -> set[str]:
    """Names of the tables of single sequences that are read."""
    names = set()
    whole = RunFolder.sequence_table

    def spy(self, name, key):
        names.add(name)
        return whole(self, name, key)

    monkeypatch.setattr(RunFolder, "sequence_table", spy)
    return names


def lean(experiment):
    return experiment.model_copy(update={"keep": "statistics"})


def test_to_keep_statistics_alone_changes_no_other_file(finished, tmp_path, told, files):
    (experiment, run), small = finished(2), RunFolder(tmp_path / "small")
    execute(lean(experiment), small, listener=told())
    left_out = (*OBSERVED, "patches", "film")
    expected = {name: content for name, content in files(run).items() if name.split("/")[0] not in left_out}
    expected["experiment.toml"] = expected["experiment.toml"].replace(b'"observations"', b'"statistics"')
    assert files(small) == expected
    assert not [name for name in left_out if (small.path / name).exists()]


@pytest.mark.usefixtures("found")
def test_statistics_are_made_without_a_look_at_observations_or_tracks(scenes, tmp_path, told, read):
    execute(scenes(2), RunFolder(tmp_path / "run"), listener=told())
    assert read
    assert not read & set(OBSERVED)


def test_a_run_that_keeps_statistics_alone_is_whole_and_repaired_like_any_other(finished, told, files):
    experiment, run = finished(2, keep="statistics")
    before, again, repaired = files(run), told(), told()
    execute(experiment, run, listener=again)
    assert again.keys == []
    (run.path / "ends" / "seq-02@default.parquet").unlink()
    execute(experiment, run, listener=repaired)
    assert repaired.keys == ["seq-02@default"]
    assert files(run) == before


@pytest.mark.parametrize(("first", "other"), [("observations", "statistics"), ("statistics", "observations")])
def test_what_is_kept_cannot_change_within_a_run(finished, told, first, other):
    experiment, run = finished(1, keep=first)
    wanted = experiment.model_copy(update={"keep": other})
    with pytest.raises(StoreError, match=f"holds a run with keep = '{first}', expected"):
        execute(wanted, run, listener=told())


@pytest.mark.parametrize(("keep", "most"), [("observations", None), ("statistics", 2)])
def test_more_scenes_are_added_to_a_run_as_if_they_had_always_been_there(finished, told, files, read, keep, most):
    _, run = finished(2, keep=keep, most=1)
    wanted, whole = finished(2, keep=keep, most=most)
    read.clear()
    listener = told()
    execute(wanted, run, listener=listener)
    assert listener.keys == ["seq-02@default"]
    assert not read & set(OBSERVED)
    assert files(run) == files(whole)
    assert run.manifest().settings_hash == whole.manifest().settings_hash == wanted.digest()


@pytest.mark.usefixtures("found")
def test_data_that_gained_a_scene_are_measured_there_alone(scenes, tmp_path, told, files, read):
    experiment, run, whole = scenes(2), RunFolder(tmp_path / "run"), RunFolder(tmp_path / "whole")
    execute(experiment, whole, listener=told())
    scene = tmp_path / "data" / "seq-01"
    shutil.move(scene, tmp_path / "elsewhere")
    execute(experiment, run, listener=told())
    shutil.move(tmp_path / "elsewhere", scene)
    read.clear()
    listener = told()
    execute(experiment, run, listener=listener)
    assert listener.keys == ["seq-01@default"]
    assert not read & set(OBSERVED)
    assert files(run) == files(whole)


@pytest.mark.usefixtures("found")
def test_other_questions_are_answered_without_measuring_again(finished, tmp_path, told, files, read):
    asked = FindingsSettings(margin=0.5, level=0.8, intervals="percentile")
    (experiment, run), whole = finished(2), RunFolder(tmp_path / "whole")
    execute(experiment.model_copy(update={"findings": asked}), whole, listener=told())
    read.clear()
    listener = told()
    execute(experiment.model_copy(update={"findings": asked}), run, listener=listener)
    assert listener.keys == []
    assert not read & set(OBSERVED)
    assert files(run) == files(whole)
    assert set(run.statistics(DEPENDENCE).filter(unit="ratio")["margin"]) == {1.5}
    assert set(run.statistics(INTERVALS).select("kind", "level").rows()) == {("percentile", 0.8)}
    for table, kinds in (("gaussianity", ["kind"]), ("time_structure", ["kind", "autocorrelation_kind"])):
        found = run.statistics(RUN_TABLES[table]).drop_nulls("level")
        assert set(found["level"]) == {0.8}
        assert all(set(found[kind]) == {"percentile"} for kind in kinds)


@pytest.mark.parametrize("measured", [0, 1])
def test_earlier_results_stay_until_new_ones_are_ready(measured, finished, told, files):
    """Two scenes are added, and the start that measures them is interrupted before the last."""

    def interrupt(key, done, total, first):
        if len(listener.keys) == measured:
            raise KeyboardInterrupt

    experiment, run = finished(3, most=1)
    (run.path / "report").mkdir()
    before = files(run)
    listener = told()
    listener.frame = interrupt
    with pytest.raises(KeyboardInterrupt):
        execute(experiment.with_scenes(None), run, listener=listener)
    assert len(run.manifest().sequences) == 1 + measured
    assert {name for name, content in before.items() if files(run).get(name) != content} == {"experiment.toml"}
    assert (run.path / "report").exists()
    if measured:  # what is computed from one scene is not shown as that of two
        with pytest.raises(StoreError, match="no finished run, expected one; `tracknoise run` starts or resumes a run"):
            run.statistics(SUMMARY)
    else:
        assert run.statistics(SUMMARY).height
    again = told()
    execute(experiment.with_scenes(None), run, listener=again)
    assert len(again.keys) == 2 - measured
    assert files(run) == files(finished(3)[1])
    assert not (run.path / "report").exists()


@pytest.mark.usefixtures("found")
def test_what_was_found_before_is_gone_when_other_questions_are_interrupted(finished, told, monkeypatch):
    experiment, run = finished(2)
    (run.path / "report").mkdir()
    monkeypatch.setattr("tracknoise.experiments.execute.compute_findings", lambda *_, **__: pytest.fail("interrupted"))
    with pytest.raises(pytest.fail.Exception):
        execute(experiment.model_copy(update={"findings": FindingsSettings(margin=0.5)}), run, listener=told())
    with pytest.raises(StoreError, match="no finished run, expected one; `tracknoise run` starts or resumes a run"):
        run.statistics(FINDINGS)
    assert not (run.path / "report").exists()


def test_a_start_that_is_refused_changes_nothing(finished, told, files):
    experiment, run = finished(2, most=1)
    manifest = run.manifest()
    manifest.versions["numpy"] = "1.0.0"
    run.write_manifest(manifest)
    before, settings = files(run), run.experiment_toml()
    with pytest.raises(TracknoiseError, match=r"expected 1\.0\.0"):
        execute(experiment.with_scenes(None), run, listener=told())
    assert run.experiment_toml() == settings
    assert files(run) == before


def test_fewer_scenes_are_another_experiment(finished, told):
    experiment, run = finished(2, most=2)
    with pytest.raises(StoreError, match=r"dataset.max_scenes = 2, expected 1"):
        execute(experiment.with_scenes(1), run, listener=told())
    before = run.experiment_toml()
    other = experiment.with_limits(scenes=9, frames=3)
    with pytest.raises(StoreError, match=r"dataset.max_frames = None, expected 3"):
        execute(other, run, listener=told())
    assert run.experiment_toml() == before


def test_statistics_have_every_table(finished):
    _, run = finished(1, keep="statistics")
    for table in STATISTICS_TABLES:
        assert run.statistics(table).height or table.name == "effects", table.name


def test_groups_of_scenes_are_declared_without_measuring_again(finished, told):
    experiment, run = finished(2)
    listener = told()
    execute(experiment.with_groups({"all": ["seq-*"]}), run, listener=listener)
    assert listener.keys == []
    assert parse_experiment(run.experiment_toml(), place="").dataset.groups == {"all": ["seq-*"]}
