"""The run folder: whole or not there, and clear about what is wrong with it."""

import json

import polars as pl
import pytest

from tracknoise.exceptions import SchemaError, StoreError
from tracknoise.tables import schema
from tracknoise.tables.store import SEQUENCE_TABLES, Manifest, RunFolder, SequenceEntry, sequence_key

ENTRY = SequenceEntry("d", "a/b", "default", 0, "forward", 10, 64, 48, "birth", 5, 1.5, ("a note",))


@pytest.fixture
def run(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.create('name = "x"\n', Manifest("hash", {"python": "3"}, {"cores": "2"}, 0))
    return folder


def test_manifest_round_trips_with_its_sequences(run):
    manifest = run.manifest()
    manifest.sequences[ENTRY.key] = ENTRY
    manifest.failures["other"] = "cause"
    run.write_manifest(manifest)
    assert RunFolder(run.path).manifest() == manifest


def test_only_sequences_in_the_manifest_are_read(run):
    tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items()}
    run.write_sequence(ENTRY.key, tables, b"png")
    assert list(run.sequence_tables("tracks")) == []
    manifest = run.manifest()
    manifest.sequences[ENTRY.key] = ENTRY
    run.write_manifest(manifest)
    assert len(list(run.sequence_tables("tracks"))) == 1


def test_a_table_with_other_columns_is_refused_and_not_written(run):
    with pytest.raises(SchemaError, match="summary: column 0"):
        run.write_statistics("summary", pl.DataFrame({"x": [1]}))
    assert not (run.path / "statistics").exists()


def test_no_temporary_file_is_left(run):
    assert sorted(item.name for item in run.path.iterdir()) == ["experiment.toml", "manifest.json"]


@pytest.mark.parametrize(
    ("content", "message"),
    [("{", "damaged"), ('{"format": 99}', "format 99, expected 2"), ('{"format": 2}', "damaged"), ("[]", "damaged")],
)
def test_a_damaged_manifest_is_named(run, content, message):
    (run.path / "manifest.json").write_text(content)
    with pytest.raises(StoreError, match=message):
        run.manifest()


def test_a_folder_that_is_no_run_is_not_written_into(tmp_path):
    (tmp_path / "holiday.jpg").write_bytes(b"")
    with pytest.raises(StoreError, match="holds files that are no run"):
        RunFolder(tmp_path).require_empty()


def test_a_missing_run_is_one_line(tmp_path):
    with pytest.raises(StoreError, match="no readable manifest"):
        RunFolder(tmp_path / "nowhere").manifest()


def test_a_truncated_table_is_named(run):
    run.write_statistics("summary", schema.empty(schema.SUMMARY))
    path = run.path / "statistics" / "summary.parquet"
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(StoreError, match=r"summary\.parquet: damaged"):
        run.statistics("summary")


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="cannot be written"):
        RunFolder(tmp_path / "file" / "run").create("", Manifest("h", {}, {}, 0))


def test_failures_are_a_line_each_and_vanish_when_there_are_none(run):
    run.write_failures({"b": "x", "a": "y"})
    lines = (run.path / "failures.jsonl").read_text().splitlines()
    assert [json.loads(line) for line in lines] == [
        {"sequence": "a", "cause": "y"},
        {"sequence": "b", "cause": "x"},
    ]
    run.write_failures({})
    assert not (run.path / "failures.jsonl").exists()


def test_keys_are_file_names_and_differ():
    keys = {
        sequence_key("a/b", "l", 0, "forward"),
        sequence_key("a", "b__l", 0, "forward"),
        sequence_key("a__b", "l", 0, "forward"),
        sequence_key("a/b", "l", 90, "forward"),
    }
    assert len(keys) == 4
    assert not any("/" in key for key in keys)


def test_statistics_of_a_run_that_is_not_finished_say_so(run):
    with pytest.raises(StoreError, match="holds no finished run"):
        run.statistics("summary")
