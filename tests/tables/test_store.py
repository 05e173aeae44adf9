"""The run folder: whole or not there, and clear about what is wrong with it."""

import json
import os
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from tracknoise.exceptions import DataError, SchemaError, StoreError
from tracknoise.tables import schema
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import FORMAT, FailureEntry, Manifest, SequenceEntry
from tracknoise.tables.store import FINDINGS_JSON, OBSERVED, SEQUENCE_TABLES, RunFolder

ENTRY = SequenceEntry(SequenceId("d", "a/b"), 10, 64, 48, "birth", 5, 1.5, ("a note",))


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


def test_tables_that_are_read_together_are_those_of_each_sequence_and_damage_names_the_file(run):
    keys = [f"s{number:02}" for number in range(20)]
    for key in keys:
        tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items()}
        row = {name: [key if kind == pl.String else 1] for name, kind in schema.FRAME_COUNTS.items()}
        run.write_sequence(key, {**tables, "frames": pl.DataFrame(row, schema=dict(schema.FRAME_COUNTS))}, b"png")
    stacks = list(run.stacked_tables("frames", keys))
    assert 1 < len(stacks) < len(keys)
    assert pl.concat(stacks).equals(pl.concat([run.sequence_table("frames", key) for key in keys]))
    some = pl.concat(run.stacked_tables("frames", keys, only=["speed", "scene"]))
    assert some.equals(pl.concat(stacks).select("scene", "speed"))  # in the order of the table
    path = run.path / "frames" / "s17.parquet"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(StoreError, match=r"s17\.parquet: damaged"):
        list(run.stacked_tables("frames", keys))


def test_equal_tables_are_parsed_once_and_count_as_often_as_they_are_there(run, monkeypatch):
    keys = [f"s{number}" for number in range(5)]
    row = {name: ["same" if kind == pl.String else 1] for name, kind in schema.FRAME_COUNTS.items()}
    tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items()}
    for key in keys:
        run.write_sequence(key, {**tables, "frames": pl.DataFrame(row, schema=dict(schema.FRAME_COUNTS))}, b"png")
    parsed, scan = [], pl.scan_parquet
    monkeypatch.setattr(pl, "scan_parquet", lambda sources: parsed.append(len(sources)) or scan(sources))
    stacked = pl.concat(run.stacked_tables("frames", keys))
    assert parsed == [1]
    assert stacked.equals(pl.concat([run.sequence_table("frames", key) for key in keys]))
    assert stacked.height == len(keys)


def test_a_table_with_other_columns_is_refused_and_not_written(run):
    with pytest.raises(SchemaError, match="summary: column 0"):
        run.write_statistics({SUMMARY: pl.DataFrame({"x": [1]})})
    assert not (run.path / "statistics").exists()


def test_no_temporary_file_is_left(run):
    assert sorted(item.name for item in run.path.iterdir()) == ["experiment.toml", "manifest.json"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "damaged"),
        ('{"format": 99}', f"format 99, expected {FORMAT}"),
        (f'{{"format": {FORMAT}}}', "damaged"),
        ("[]", "damaged"),
    ],
)
def test_a_damaged_manifest_is_named(run, content, message):
    (run.path / "manifest.json").write_text(content)
    with pytest.raises(StoreError, match=message):
        run.manifest()


def test_a_run_of_another_format_says_what_to_do_and_can_be_replaced(run):
    (run.path / "manifest.json").write_text('{"format": 4, "sequences": {}}')
    with pytest.raises(StoreError, match=f"format 4, expected {FORMAT}: measure again with --fresh"):
        run.manifest()
    run.clear()
    assert not run.exists


DAMAGED = [b"{", b"[]", b'{"format": "x"}', b"\xff\xfe", b'{"a":' * 100_000]


@pytest.mark.parametrize("content", DAMAGED)
def test_a_run_with_a_damaged_manifest_says_what_to_do_and_can_be_replaced(run, content):
    (run.path / "manifest.json").write_bytes(content)
    with pytest.raises(StoreError, match=r"manifest\.json: damaged .*measure again with --fresh"):
        run.manifest()
    run.clear()
    assert not list(run.path.iterdir())


@pytest.mark.parametrize("content", DAMAGED)
def test_what_is_no_run_is_not_cleared(run, content):
    (run.path / "manifest.json").write_bytes(content)
    (run.path / "experiment.toml").unlink()
    with pytest.raises(StoreError, match=r"damaged, and no experiment\.toml beside it, expected a run's manifest"):
        run.clear()
    assert (run.path / "manifest.json").read_bytes() == content


def test_a_folder_that_is_no_run_is_not_written_into(tmp_path):
    (tmp_path / "holiday.jpg").write_bytes(b"")
    with pytest.raises(StoreError, match="contains files that are not a run"):
        RunFolder(tmp_path).require_empty()


def test_a_missing_run_is_one_line(tmp_path):
    with pytest.raises(StoreError, match="no readable manifest"):
        RunFolder(tmp_path / "nowhere").manifest()


def test_a_truncated_table_is_named(run):
    run.write_statistics({SUMMARY: schema.empty(SUMMARY)})
    path = run.path / "statistics" / "summary.parquet"
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(StoreError, match=r"summary\.parquet: damaged"):
        run.statistics(SUMMARY)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="cannot be written"):
        RunFolder(tmp_path / "file" / "run").create("", Manifest("h", {}, {}, 0))


def test_failures_are_a_line_each_and_vanish_when_there_are_none(run):
    run.write_failures({"b": FailureEntry("x", "b.png", 1), "a": FailureEntry("y", None, 3)})
    lines = (run.path / "failures.jsonl").read_text().splitlines()
    assert [json.loads(line) for line in lines] == [
        {"sequence": "a", "cause": "y", "place": None, "attempts": 3},
        {"sequence": "b", "cause": "x", "place": "b.png", "attempts": 1},
    ]
    run.write_failures({})
    assert not (run.path / "failures.jsonl").exists()


def test_keys_are_file_names_and_differ():
    keys = {
        SequenceId("d", "a/b", "l").key,
        SequenceId("d", "a", "b__l").key,
        SequenceId("d", "a__b", "l").key,
        SequenceId("d", "a/b", "l", 90).key,
        SequenceId("d", "a/b", "l", camera="left").key,
        SequenceId("d", "a/b", "l", camera="left/0").key,
        SequenceId("d", "a/b", "l@camera-left").key,
    }
    assert len(keys) == 7
    assert not any("/" in key for key in keys)


def test_keys_of_long_and_odd_names_are_short_file_names_and_differ():
    odd = ["x" * 5000, "x" * 5001, "\U0001f600" * 60, "\U0001f600" * 61, "/".join("deep" for _ in range(900))]
    odd += ["\udcff", "\udcfe", "%FF", "\u00ff", "a\nb", "a\x00b", ".", "..", "-rf", "con", "", "=", "x" * 160 + "="]
    ids = [SequenceId("d", name) for name in odd] + [SequenceId("d", "s", "x" * 999, camera=name) for name in odd]
    keys = {name.key for name in ids}
    assert len(keys) == len(ids)
    assert max(map(len, keys)) <= 160
    assert all(key.isascii() and key.isprintable() and "/" not in key for key in keys)
    whole = SequenceId("d", "x" * 152).key
    assert len(whole) == 160
    assert "=" not in whole
    longer = SequenceId("d", "x" * 153).key
    assert len(longer) == 160
    assert longer[-21] == "="


def test_a_name_that_is_not_utf8_cannot_be_stored():
    SequenceId("d", "\U0001f600").require_utf8()
    with pytest.raises(DataError, match=r"scene '\\udcff': not UTF-8, expected a name"):
        SequenceId("d", "\udcff").require_utf8()


def test_statistics_of_a_run_that_is_not_finished_say_so(run):
    with pytest.raises(StoreError, match="no finished run"):
        run.statistics(SUMMARY)


@pytest.fixture
def measured(run):
    """A run with one sequence, empty tables and all."""
    tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items()}
    entry = replace(ENTRY, sha256=run.write_sequence(ENTRY.key, tables, b"png"))
    manifest = run.manifest()
    manifest.sequences[entry.key] = entry
    run.write_manifest(manifest)
    return run


def flip(path, place=-20):
    """Change a single bit of a file."""
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def test_a_sequence_is_there_if_every_bit_of_it_is(measured):
    entry = measured.manifest().sequences[ENTRY.key]
    assert measured.has_sequence(entry)
    files = list(measured.path.glob(f"*/{ENTRY.key}.*"))
    assert len(files) == len(SEQUENCE_TABLES) + 1
    for path in files:
        flip(path, place=1)
        assert not measured.has_sequence(entry), path
        flip(path, place=1)
    assert measured.has_sequence(entry)
    assert not measured.has_sequence(ENTRY), "a run that recorded no hashes knows nothing"


def test_a_sequence_may_be_kept_without_single_observations_but_not_without_anything_else(run):
    tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items() if name not in OBSERVED}
    entry = replace(ENTRY, sha256=run.write_sequence(ENTRY.key, tables, b"png"))
    manifest = run.manifest()
    manifest.sequences[entry.key] = entry
    run.write_manifest(manifest)
    assert run.has_sequence(entry)
    assert run.sequence_table("ends", entry.key).is_empty()
    with pytest.raises(StoreError, match=r'run: keeps no tracks, expected a run with keep = "observations"'):
        run.sequence_table("tracks", entry.key)
    hashes = {name: value for name, value in entry.sha256.items() if name != "moments"}
    assert not run.has_sequence(replace(entry, sha256=hashes))
    with pytest.raises(KeyError, match="frames"):
        run.write_sequence(entry.key, {name: table for name, table in tables.items() if name != "frames"}, b"png")


def test_a_damaged_bit_is_noticed_when_a_table_is_read(measured):
    assert measured.sequence_table("tracks", ENTRY.key).is_empty()
    flip(measured.path / "tracks" / f"{ENTRY.key}.parquet")
    with pytest.raises(StoreError, match=r"tracks.*damaged \(checksum mismatch\).*`tracknoise run` makes it again"):
        measured.sequence_table("tracks", ENTRY.key)
    measured.write_statistics({SUMMARY: schema.empty(SUMMARY)})
    assert measured.statistics(SUMMARY).is_empty()
    flip(measured.path / "statistics" / "summary.parquet")
    with pytest.raises(StoreError, match=r"summary\.parquet: damaged"):
        measured.statistics(SUMMARY)


def test_hashes_are_those_of_the_newest_manifest(measured):
    measured.sequence_table("tracks", ENTRY.key)
    tables = {name: schema.empty(columns) for name, columns in SEQUENCE_TABLES.items()}
    tables["tracks"] = pl.DataFrame({name: [None] for name in schema.TRACKS}, schema=dict(schema.TRACKS))
    manifest = measured.manifest()
    manifest.sequences[ENTRY.key] = replace(ENTRY, sha256=measured.write_sequence(ENTRY.key, tables, b"png"))
    measured.write_manifest(manifest)
    assert len(measured.sequence_table("tracks", ENTRY.key)) == 1


def test_an_interrupt_while_a_file_is_written_leaves_nothing(run, monkeypatch):
    def interrupt(descriptor):
        raise KeyboardInterrupt

    before = sorted(run.path.rglob("*"))
    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run.write_manifest(run.manifest())
    assert sorted(run.path.rglob("*")) == before


def test_what_a_killed_start_left_unfinished_is_removed_and_nothing_else(measured, monkeypatch):
    before = sorted(measured.path.rglob("*"))
    monkeypatch.setattr(Path, "replace", lambda self, target: None)  # as if it were killed before the renaming
    monkeypatch.setattr(Path, "unlink", lambda self, missing_ok: None)
    measured.write_statistics({SUMMARY: schema.empty(SUMMARY)})
    monkeypatch.undo()
    left = set(measured.path.rglob("*")) - set(before)
    assert len([path for path in left if path.is_file()]) == 2
    measured.discard_unfinished()
    assert not [path for path in measured.path.rglob("*") if path.is_file() and path not in before]


def test_a_folder_in_which_a_start_died_at_once_is_empty(tmp_path):
    run = RunFolder(tmp_path)
    run.lock_path.touch()
    run.require_empty()
    run.create('name = "x"\n', Manifest("hash", {}, {}, 0))
    assert run.exists
    assert not run.has_measured


def test_a_run_whose_settings_are_lost_has_still_measured(measured):
    (measured.path / "experiment.toml").unlink()
    assert measured.has_measured


def test_an_unfinished_report_of_a_killed_process_is_removed(measured):
    leftover = measured.path / ".report.1.0123456789abcdef.tracknoise-unfinished"
    (leftover / "figures").mkdir(parents=True)
    (leftover / "index.html").write_text("half")
    measured.discard_unfinished()
    assert not leftover.exists()


def test_every_changed_value_of_the_manifest_is_noticed_but_the_time_that_a_sequence_took(measured):
    measured.write_statistics({SUMMARY: schema.empty(SUMMARY)})
    path = measured.path / "manifest.json"
    text = path.read_text()
    changes = {
        '"summary":': '"sumnary":',
        '"width": 64': '"width": 65',
        '"truth": "birth"': '"truth": "scan"',
        '"cores": "2"': '"cores": "3"',
        '"a note"': '"a vote"',
        '"tracks":': '"trucks":',
    }
    for old, new in changes.items():
        assert old in text, old
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(StoreError, match=r"manifest\.json: damaged \(checksum mismatch\)"):
            measured.statistics(SUMMARY)
    path.write_text(text.replace('"seconds": 1.5', '"seconds": 2.5'))
    assert measured.manifest().sequences[ENTRY.key].seconds == 2.5


def test_changed_settings_and_findings_are_noticed(run):
    assert run.experiment_toml() == 'name = "x"\n'
    (run.path / "experiment.toml").write_text('name = "y"\n')
    with pytest.raises(StoreError, match=r"experiment\.toml: damaged \(checksum mismatch\).*writes them again"):
        run.experiment_toml()
    (run.path / "experiment.toml").unlink()
    with pytest.raises(StoreError, match=r"experiment\.toml: missing"):
        run.experiment_toml()
    assert run.document(FINDINGS_JSON) is None
    run.write_statistics({}, documents={FINDINGS_JSON: '{"n": 1}'})
    assert run.document(FINDINGS_JSON) == '{"n": 1}'
    (run.path / "statistics" / "findings.json").write_text('{"n": 2}')
    with pytest.raises(StoreError, match=r"findings\.json: damaged"):
        run.document(FINDINGS_JSON)


def test_settings_match_the_manifest_at_every_moment_of_their_replacement(run, monkeypatch):
    manifest, states = run.manifest(), []
    write = Path.replace

    def replace_and_look(self, target):
        write(self, target)
        states.append(RunFolder(run.path).experiment_toml())

    monkeypatch.setattr(Path, "replace", replace_and_look)
    run.replace_experiment('name = "y"\n', manifest)
    run.write_manifest(manifest)
    assert states == ['name = "x"\n', 'name = "y"\n', 'name = "y"\n']
    assert len(run.manifest().experiment_sha256) == 1


def test_a_changed_image_is_noticed(measured):
    assert measured.snapshot(ENTRY.key) == b"png"
    measured.snapshot_path(ENTRY.key).write_bytes(b"pnh")
    with pytest.raises(StoreError, match=r"png: damaged .*`tracknoise run` makes it again"):
        measured.snapshot(ENTRY.key)


@pytest.mark.parametrize(
    ("name", "column", "value"),
    [
        ("tracks", "max_error_px", float("nan")),
        ("tracks", "max_error_px", float("-inf")),
        ("cameras", "distortion", float("nan")),
        ("cameras", "distortion", float("inf")),
    ],
)
def test_numbers_that_are_not_finite_are_written_as_null_and_not_read(name, column, value, measured, monkeypatch):
    key = ENTRY.key
    tables = {each: measured.sequence_table(each, key) for each in measured.names_of_tables(key)}
    columns = tables[name].schema
    nothing = pl.DataFrame([[None] * len(columns)], schema=columns, orient="row")
    measured.write_sequence(key, {**tables, name: nothing}, b"png")
    values = pl.Series(column, [[0.5, value]] if columns[column] == pl.List(pl.Float64) else [value], columns[column])
    wrong = {**tables, name: nothing.with_columns(values)}
    message = f"column {column} holds {value}, expected finite numbers or null"
    manifest = measured.manifest()
    manifest.sequences[key] = replace(ENTRY, sha256=measured.write_sequence(key, wrong, b"png"))
    measured.write_manifest(manifest)
    expected = [[0.5, None]] if columns[column] == pl.List(pl.Float64) else [None]
    assert measured.sequence_table(name, key)[column].to_list() == expected
    with monkeypatch.context() as patch:
        patch.setattr("tracknoise.tables.schema.storable", lambda table: table)
        manifest.sequences[key] = replace(ENTRY, sha256=measured.write_sequence(key, wrong, b"png"))
    measured.write_manifest(manifest)
    with pytest.raises(SchemaError, match=f"{name}/{key}.parquet: {message}"):
        measured.sequence_table(name, key)
    with pytest.raises(SchemaError, match=f"{name}/{key}.parquet: {message}"):
        list(measured.stored_tables(name))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("statistics", None, "statistics: input should be a valid dict"),
        ("failures", 3, "failures: input should be a valid dict"),
        ("versions", "x", "versions: input should be a valid dict"),
        ("experiment_sha256", 3, "experiment_sha256: input should be a valid list"),
    ],
)
def test_a_sealed_manifest_with_values_of_other_types_is_named(field, value, message, run):
    manifest = run.manifest()
    setattr(manifest, field, value)
    run.write_manifest(manifest)
    with pytest.raises(StoreError, match=rf"manifest\.json: damaged \({message}"):
        RunFolder(run.path).manifest()
