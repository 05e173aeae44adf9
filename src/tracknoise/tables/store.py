"""The run folder: what an experiment measured, as Parquet beside a manifest.

``experiment.toml`` (the resolved settings), ``manifest.json``, a Parquet file a sequence in each of
``observations/``, ``tracks/``, ``frames/``, ``moments/``, ``trims/`` and ``counts/``, an image a sequence in
``snapshots/``, tables of the whole run in ``statistics/``, ``failures.jsonl``, and ``report/``. Every file appears by
atomic rename, and a sequence counts as measured only once the manifest, written last, says so.
"""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import polars as pl

from tracknoise.exceptions import StoreError
from tracknoise.tables import schema

FORMAT = 2
_RESULTS = ("report", "statistics")
SEQUENCE_TABLES: Mapping[str, schema.Schema] = {
    "observations": schema.OBSERVATIONS,
    "tracks": schema.TRACKS,
    "frames": schema.FRAMES,
    "moments": schema.MOMENTS,
    "trims": schema.TRIMS,
    "counts": schema.COUNTS,
}
STATISTICS_TABLES: Mapping[str, schema.Schema] = {
    "curves": schema.CURVES,
    "lifetimes": schema.LIFETIMES,
    "outliers": schema.OUTLIERS,
    "trims": schema.TRIMS,
    "errors": schema.ERRORS,
    "counts": schema.COUNTS,
    "summary": schema.SUMMARY,
}


@dataclass(frozen=True, slots=True)
class SequenceEntry:
    """What the manifest says of one measured sequence.

    Attributes
    ----------
    dataset, scene, lighting, rotation, direction
        Its name.
    n_frames, width, height
        Count and size (px) of its images.
    truth
        Kind of truth used.
    snapshot_frame
        Frame whose image lies in ``snapshots/``.
    seconds
        Wall time of the measurement; where several sequences were measured together, an equal share of it.
    notes
        What was corrected or assumed while reading, one sentence each.
    inputs
        Hash of the files besides the images that the numbers depend on.
    key_frame
        Where truth is a scan, the frame in which features were associated with it.
    """

    dataset: str
    scene: str
    lighting: str
    rotation: int
    direction: str
    n_frames: int
    width: int
    height: int
    truth: str
    snapshot_frame: int
    seconds: float
    notes: tuple[str, ...] = ()
    inputs: str = ""
    key_frame: int | None = None

    @property
    def key(self) -> str:
        """File name, without extension, of this sequence's tables."""
        return sequence_key(self.scene, self.lighting, self.rotation, self.direction)


@dataclass(slots=True)
class Manifest:
    """Where a run stands and what it was made with.

    Attributes
    ----------
    settings_hash
        Of every setting of the experiment but the place of its data.
    versions
        Of tracknoise, Python and the libraries that decide the numbers.
    machine
        System, processor and count of cores.
    seed
        Of everything random.
    sequences
        What was measured, by key.
    failures
        Cause of what was not, by key.
    left_out
        Why scenes that the data hold were not to be measured, by scene.
    """

    settings_hash: str
    versions: dict[str, str]
    machine: dict[str, str]
    seed: int
    sequences: dict[str, SequenceEntry] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)


def sequence_key(scene: str, lighting: str, rotation: int, direction: str) -> str:
    """File-safe name of a sequence, unique in a data set.

    It is ``scene@lighting``, followed by ``@rDEGREES`` if it is turned and ``@backward`` if it is played so.
    """
    parts = [quote(scene, safe=" "), quote(lighting, safe=" "), *([f"r{rotation}"] if rotation else [])]
    parts += [direction] if direction != "forward" else []
    return "@".join(parts)


class RunFolder:
    """A run folder on disk.

    Parameters
    ----------
    path
        Of the folder; it need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)

    @property
    def exists(self) -> bool:
        """Whether a run was begun here."""
        return (self.path / "manifest.json").is_file()

    def require_empty(self) -> None:
        """Refuse a folder that holds anything.

        Raises
        ------
        StoreError
            If it does, or is no folder.
        """
        if self.path.exists() and not self.path.is_dir():
            raise StoreError(f"{self.path}: is a file, expected a new or empty folder")
        if self.path.is_dir() and any(self.path.iterdir()):
            raise StoreError(f"{self.path}: holds files that are no run, expected a new or empty folder")

    def create(self, experiment_toml: str, manifest: Manifest) -> None:
        """Begin a run: write the settings and an empty manifest.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        _write_atomically(self.path / "experiment.toml", experiment_toml.encode())
        self.write_manifest(manifest)

    def experiment_toml(self) -> str:
        """Return the resolved settings as the text of a TOML file.

        Raises
        ------
        StoreError
            If there is no run here.
        """
        return self._read_text("experiment.toml")

    def manifest(self) -> Manifest:
        """Read the manifest.

        Raises
        ------
        StoreError
            If there is no run here, or the manifest is damaged or of another format.
        """
        text = self._read_text("manifest.json")
        try:
            raw: dict[str, Any] = json.loads(text)
            found = raw.pop("format")
            if found != FORMAT:
                raise StoreError(f"{self.path / 'manifest.json'}: format {found}, expected {FORMAT}")
            raw["sequences"] = {
                key: SequenceEntry(**{**entry, "notes": tuple(entry["notes"])})
                for key, entry in raw["sequences"].items()
            }
            return Manifest(**raw)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StoreError(f"{self.path / 'manifest.json'}: damaged ({error}), expected a run's manifest") from error

    def write_manifest(self, manifest: Manifest) -> None:
        """Write the manifest, by atomic rename.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        document = {"format": FORMAT, **asdict(manifest)}
        document["sequences"] = dict(sorted(document["sequences"].items()))
        _write_atomically(self.path / "manifest.json", (json.dumps(document, indent=2) + "\n").encode())

    def write_sequence(self, key: str, tables: Mapping[str, pl.DataFrame], snapshot_png: bytes) -> None:
        """Write the tables of `SEQUENCE_TABLES` and the image of one sequence.

        Raises
        ------
        SchemaError
            If a table does not have its columns.
        StoreError
            If the folder cannot be written.
        """
        for name, columns in SEQUENCE_TABLES.items():
            table = schema.check(tables[name], columns, name)
            _write_parquet(self.path / name / f"{key}.parquet", table)
        _write_atomically(self.snapshot_path(key), snapshot_png)

    def has_sequence(self, key: str) -> bool:
        """Whether all files of one sequence are there."""
        tables = (self.path / name / f"{key}.parquet" for name in SEQUENCE_TABLES)
        return all(path.is_file() for path in (*tables, self.snapshot_path(key)))

    def discard_results(self) -> None:
        """Remove what was derived from the sequences, which is stale as soon as one is added.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        for name in _RESULTS:
            _remove(self.path / name)

    def clear(self) -> None:
        """Remove the run and nothing else that may lie in its folder; the manifest goes last.

        Raises
        ------
        StoreError
            If the manifest is not one of a run, or the folder cannot be written.
        """
        self.manifest()
        self.discard_results()
        for name in (*SEQUENCE_TABLES, "snapshots", "failures.jsonl", "experiment.toml", "manifest.json"):
            _remove(self.path / name)

    def snapshot_path(self, key: str) -> Path:
        """Path of the image of one sequence, PNG."""
        return self.path / "snapshots" / f"{key}.png"

    def sequence_table(self, name: str, key: str) -> pl.DataFrame:
        """One table of one sequence.

        Raises
        ------
        StoreError, SchemaError
            If the file is missing or damaged, or has other columns.
        """
        return _read_parquet(self.path / name / f"{key}.parquet", SEQUENCE_TABLES[name])

    def sequence_tables(self, name: str) -> Iterator[pl.DataFrame]:
        """One table of every measured sequence in turn, in the order of their keys."""
        for key in sorted(self.manifest().sequences):
            yield self.sequence_table(name, key)

    def write_statistics(self, name: str, table: pl.DataFrame) -> None:
        """Write one table of `STATISTICS_TABLES`.

        Raises
        ------
        SchemaError, StoreError
            If the table does not have its columns, or the folder cannot be written.
        """
        checked = schema.check(table, STATISTICS_TABLES[name], name)
        _write_parquet(self.path / "statistics" / f"{name}.parquet", checked)

    def statistics(self, name: str) -> pl.DataFrame:
        """One table of `STATISTICS_TABLES`.

        Raises
        ------
        StoreError, SchemaError
            If the run is not finished, or the file is missing or damaged, or has other columns.
        """
        if not (self.path / "statistics").is_dir():
            raise StoreError(f"{self.path}: holds no finished run, expected one: `tracknoise run` goes on with it")
        return _read_parquet(self.path / "statistics" / f"{name}.parquet", STATISTICS_TABLES[name])

    def write_failures(self, failures: Mapping[str, str]) -> None:
        """Write ``failures.jsonl``, a line each with sequence and cause; remove it when there is none."""
        path = self.path / "failures.jsonl"
        if not failures:
            path.unlink(missing_ok=True)
            return
        lines = [json.dumps({"sequence": key, "cause": cause}) for key, cause in sorted(failures.items())]
        _write_atomically(path, ("\n".join(lines) + "\n").encode())

    def _read_text(self, name: str) -> str:
        try:
            return (self.path / name).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise StoreError(f"{self.path}: no readable {name}, expected the folder of a run") from error


def _write_atomically(path: Path, content: bytes) -> None:
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        _discard(temporary)
        raise StoreError(f"{path}: cannot be written ({error.strerror}), expected a writable folder") from error


def _write_parquet(path: Path, table: pl.DataFrame) -> None:
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        table.write_parquet(temporary, compression="zstd")
        temporary.replace(path)
    except OSError as error:
        _discard(temporary)
        raise StoreError(f"{path}: cannot be written ({error}), expected a writable folder") from error


def _remove(path: Path) -> None:
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"{path}: cannot be removed ({error.strerror}), expected a writable folder") from error


def _discard(temporary: Path) -> None:
    with suppress(OSError):
        temporary.unlink()


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def _read_parquet(path: Path, columns: schema.Schema) -> pl.DataFrame:
    try:
        table = pl.read_parquet(path)
    except FileNotFoundError as error:
        raise StoreError(f"{path}: missing, expected a table of the run") from error
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise StoreError(f"{path}: damaged ({error}), expected a Parquet table; delete it and run again") from error
    return schema.check(table, columns, str(path))
