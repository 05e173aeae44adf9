"""Runs that keep statistics alone, and runs that gain scenes: observations are never read again."""

import shutil

import pytest

from tracknoise.exceptions import StoreError, TracknoiseError
from tracknoise.experiments.running.execute import execute
from tracknoise.experiments.settings import FindingsSettings
from tracknoise.tables.store import OBSERVED, STATISTICS_TABLES, RunFolder


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


def test_to_keep_statistics_alone_changes_no_other_file(scenes, tmp_path, told, files):
    experiment, run, small = scenes(2), RunFolder(tmp_path / "run"), RunFolder(tmp_path / "small")
    execute(experiment, run, listener=told())
    execute(lean(experiment), small, listener=told())
    expected = {name: content for name, content in files(run).items() if name.split("/")[0] not in OBSERVED}
    expected["experiment.toml"] = expected["experiment.toml"].replace(b'"observations"', b'"statistics"')
    assert files(small) == expected
    assert not [name for name in OBSERVED if (small.path / name).exists()]


def test_statistics_are_made_without_a_look_at_observations_or_tracks(scenes, tmp_path, told, read):
    execute(scenes(2), RunFolder(tmp_path / "run"), listener=told())
    assert read
    assert not read & set(OBSERVED)


def test_a_run_that_keeps_statistics_alone_is_whole_and_repaired_like_any_other(scenes, tmp_path, told, files):
    experiment, run = lean(scenes(2)), RunFolder(tmp_path / "run")
    execute(experiment, run, listener=told())
    before, again, repaired = files(run), told(), told()
    execute(experiment, run, listener=again)
    assert again.keys == []
    (run.path / "ends" / "seq-02@default.parquet").unlink()
    execute(experiment, run, listener=repaired)
    assert repaired.keys == ["seq-02@default"]
    assert files(run) == before


@pytest.mark.parametrize("first", ["observations", "statistics"])
def test_what_is_kept_cannot_change_within_a_run(scenes, tmp_path, told, first):
    experiment, run = scenes(1), RunFolder(tmp_path / "run")
    there, wanted = (experiment, lean(experiment)) if first == "observations" else (lean(experiment), experiment)
    execute(there, run, listener=told())
    with pytest.raises(StoreError, match=f"holds a run with keep = '{first}', expected"):
        execute(wanted, run, listener=told())


@pytest.mark.parametrize("most", [3, None])
@pytest.mark.parametrize("keep", ["observations", "statistics"])
def test_more_scenes_are_added_to_a_run_as_if_they_had_always_been_there(
    scenes, tmp_path, told, files, read, keep, most
):
    experiment = scenes(3).model_copy(update={"keep": keep})
    wanted, run, whole = experiment.with_scenes(most), RunFolder(tmp_path / "run"), RunFolder(tmp_path / "whole")
    execute(wanted, whole, listener=told())
    execute(experiment.with_scenes(2), run, listener=told())
    read.clear()
    listener = told()
    execute(wanted, run, listener=listener)
    assert listener.keys == ["seq-03@default"]
    assert not read & set(OBSERVED)
    assert files(run) == files(whole)
    assert run.manifest().settings_hash == whole.manifest().settings_hash == wanted.digest()


def test_data_that_gained_a_scene_are_measured_there_alone(experiment_file, scenes, tmp_path, told, files, read):
    experiment, run, whole = scenes(3), RunFolder(tmp_path / "run"), RunFolder(tmp_path / "whole")
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


def test_other_questions_are_answered_without_measuring_again(scenes, tmp_path, told, files, read):
    asked = FindingsSettings(margin=0.5, level=0.8, intervals="percentile")
    experiment, run, whole = scenes(2), RunFolder(tmp_path / "run"), RunFolder(tmp_path / "whole")
    execute(experiment.with_findings(asked), whole, listener=told())
    execute(experiment, run, listener=told())
    read.clear()
    listener = told()
    execute(experiment.with_findings(asked), run, listener=listener)
    assert listener.keys == []
    assert not read & set(OBSERVED)
    assert files(run) == files(whole)
    assert set(run.statistics("dependence")["margin"]) == {0.5}
    assert set(run.statistics("intervals").select("kind", "level").rows()) == {("percentile", 0.8)}
    for table, kinds in (("gaussianity", ["kind"]), ("time_structure", ["kind", "autocorrelation_kind"])):
        found = run.statistics(table).drop_nulls("level")
        assert set(found["level"]) == {0.8}
        assert all(set(found[kind]) == {"percentile"} for kind in kinds)


def test_what_was_found_before_is_gone_when_other_questions_are_interrupted(scenes, tmp_path, told, monkeypatch):
    experiment, run = scenes(2), RunFolder(tmp_path / "run")
    execute(experiment, run, listener=told())
    (run.path / "report").mkdir()
    monkeypatch.setattr(
        "tracknoise.experiments.running.execute.compute_findings", lambda *_: pytest.fail("interrupted")
    )
    with pytest.raises(pytest.fail.Exception):
        execute(experiment.with_findings(FindingsSettings(margin=0.5)), run, listener=told())
    assert run.statistics("findings").is_empty()
    assert not (run.path / "report").exists()


def test_a_start_that_is_refused_changes_nothing(scenes, tmp_path, told, files):
    experiment, run = scenes(3), RunFolder(tmp_path / "run")
    execute(experiment.with_scenes(2), run, listener=told())
    manifest = run.manifest()
    manifest.versions["numpy"] = "1.0.0"
    run.write_manifest(manifest)
    before, settings = files(run), run.experiment_toml()
    with pytest.raises(TracknoiseError, match=r"expected 1\.0\.0"):
        execute(experiment, run, listener=told())
    assert run.experiment_toml() == settings
    assert files(run) == before


def test_fewer_scenes_are_another_experiment(scenes, tmp_path, told):
    experiment, run = scenes(2), RunFolder(tmp_path / "run")
    execute(experiment.with_scenes(2), run, listener=told())
    with pytest.raises(StoreError, match=r"dataset.max_scenes = 2, expected 1"):
        execute(experiment.with_scenes(1), run, listener=told())
    before = run.experiment_toml()
    other = experiment.with_limits(scenes=9, frames=3)
    with pytest.raises(StoreError, match=r"dataset.max_frames = None, expected 3"):
        execute(other, run, listener=told())
    assert run.experiment_toml() == before


def test_statistics_have_every_table(scenes, tmp_path, told):
    run = RunFolder(tmp_path / "run")
    execute(lean(scenes(1)), run, listener=told())
    for name in STATISTICS_TABLES:
        assert run.statistics(name).height or name == "effects", name
