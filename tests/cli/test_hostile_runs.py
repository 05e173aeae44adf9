"""Run folders whose checksums are right and whose contents are not."""

import io
import math
import os
import shutil
import tomllib

import polars as pl
import pytest
import tomlkit

from tracknoise.tables.files import digest
from tracknoise.tables.store import RunFolder

COMMANDS = (
    ("report", "{run}", "--text"),
    ("report", "{run}", "--json"),
    ("check", "{run}"),
    ("compare", "{whole}", "{run}"),
    ("report", "{run}"),
)
SETTINGS = [
    ("trackers", None, "trackers: field required"),
    ("trackers", [{"name": "a"}], "trackers.0.kind: field required"),
    ("dataset", "x", "dataset: "),
    ("truth", {}, "truth.population: field required"),
    ("findings", {"trimming": "some"}, "findings.trimming: input should be 'untrimmed' or 'trimmed'"),
    ("statistics", {"min_features": math.nan}, "statistics.min_features: "),
]


@pytest.fixture
def copied(whole, tmp_path):
    return RunFolder(shutil.copytree(whole, tmp_path / "run"))


def poison(run: RunFolder, name: str, column: str, value: float) -> None:
    """Put a number into a table of the whole run. All checksums are right."""
    path = run.path / "statistics" / f"{name}.parquet"
    buffer = io.BytesIO()
    table = pl.read_parquet(path)
    table.with_columns(pl.lit(value, table[column].dtype).alias(column)).write_parquet(buffer)
    path.write_bytes(buffer.getvalue())
    manifest = run.manifest()
    manifest.statistics[name] = digest(buffer.getvalue())
    run.write_manifest(manifest)


def set_setting(run: RunFolder, key: str, value: object) -> None:
    settings = tomllib.loads(run.experiment_toml())
    del settings[key]
    manifest = run.manifest()
    run.replace_experiment(tomlkit.dumps(settings if value is None else {**settings, key: value}), manifest)
    run.write_manifest(manifest)


def ended(tracknoise, command, run, whole):
    return tracknoise(*(part.format(run=run.path, whole=whole) for part in command))


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize(
    ("name", "column", "commands"),
    [
        ("summary", "untrimmed_rms_u_px", [COMMANDS[3], COMMANDS[4]]),
        ("findings", "value", [COMMANDS[0], COMMANDS[1], COMMANDS[4]]),
        ("intervals", "value", [COMMANDS[0], COMMANDS[1]]),
        ("audit", "value", [COMMANDS[2]]),
    ],
)
def test_a_number_that_is_not_finite_is_one_line(name, column, commands, value, copied, whole, tracknoise):
    poison(copied, name, column, value)
    place = copied.path / "statistics" / f"{name}.parquet"
    line = f"tracknoise: error: {place}: column {column} holds {value}, expected finite numbers or null"
    for command in commands:
        code, out, err = ended(tracknoise, command, copied, whole)
        assert (code, out, err.splitlines()[-1:]) == (1, "", [line]), command
        assert "Traceback" not in err


@pytest.mark.parametrize(("key", "value", "message"), SETTINGS)
def test_settings_that_no_experiment_has_are_one_line(key, value, message, copied, whole, tracknoise):
    set_setting(copied, key, value)
    place = f"tracknoise: error: {copied.path / 'experiment.toml'}: damaged ({message}"
    for command in COMMANDS[2:]:
        code, out, err = ended(tracknoise, command, copied, whole)
        assert (code, out, err.count("error")) == (1, "", 1), command
        assert err.splitlines()[-1].startswith(place), command


@pytest.mark.parametrize("name", ["manifest.json", "experiment.toml", "statistics/trust.parquet"])
def test_a_pipe_is_refused_and_not_waited_for(name, copied, whole, tracknoise):
    (copied.path / name).unlink()
    os.mkfifo(copied.path / name)
    for command in COMMANDS:
        code, _, err = ended(tracknoise, command, copied, whole)
        assert code == 1
        assert err == f"tracknoise: error: {copied.path / name}: not a regular file, expected a file of the run\n"
