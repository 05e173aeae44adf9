"""The run folder: what an experiment measured, as Parquet files and a manifest.

It holds ``experiment.toml`` (the resolved settings), ``manifest.json``, one Parquet file per sequence in each folder of
`SEQUENCE_TABLES`, one image per sequence in ``snapshots/``, tables of the whole run in ``statistics/``, reference
tracks in ``references/``, which remain when another run replaces this one,
``failures.jsonl``, and ``report/``. If only statistics are kept, the folders of `OBSERVED` are missing.

Every file is written completely and then renamed. A sequence counts as measured once it is in the manifest, which is
written last and holds the hash of each of its files. Every file that is read here is compared with its hash. A folder
with links below it is refused. During a run, ``.lock`` names the process that writes here.
"""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import polars as pl

from tracknoise.atomic import discard_abandoned, unfinished
from tracknoise.exceptions import SchemaError, StoreError
from tracknoise.tables import findings_schema, schema
from tracknoise.tables.files import (
    digest,
    is_intact,
    read_checked,
    read_parquet,
    read_regular,
    read_stacked,
    read_text_checked,
    remove,
    require_no_links,
    write_atomically,
    write_parquet,
)
from tracknoise.tables.manifest import FailureEntry, Manifest, SequenceEntry, damaged, has_format, parse_run_settings
from tracknoise.tables.run_table import RunTable

__all__ = ["FailureEntry", "Manifest", "RunFolder", "SequenceEntry"]

_LOCK, _INPUTS, _REFERENCES = ".lock", "inputs", "references"
_MANIFEST, _SETTINGS, _FAILURES, _SNAPSHOTS = "manifest.json", "experiment.toml", "failures.jsonl", "snapshots"
FINDINGS_JSON = "findings.json"
_PARTS, _SUMMARY = "parts", "summary"
_STACKED = 16
"""Sequences whose tables are read together."""
SEQUENCE_TABLES: Mapping[str, schema.Schema] = {
    "observations": schema.OBSERVATIONS,
    "tracks": schema.TRACKS,
    "frames": schema.FRAME_COUNTS,
    "poses": schema.POSES,
    "moments": schema.MOMENTS,
    "trims": findings_schema.TRIMS,
    "counts": findings_schema.COUNTS,
    "ends": schema.ENDS,
    "errors": findings_schema.ERRORS,
    "scales": schema.SCALES,
    "blocks": schema.BLOCKS,
    "scale_blocks": schema.SCALE_BLOCKS,
    "aspects": schema.ASPECTS,
    "aspect_blocks": schema.ASPECT_BLOCKS,
    "increments": schema.INCREMENTS,
    "samples": schema.SAMPLES,
    "fitted_noise": schema.FITTED_NOISE,
    "truth_differences": schema.TRUTH_DIFFERENCES,
    "pose_differences": schema.POSE_DIFFERENCES,
    "surroundings": schema.SURROUNDINGS,
    "image_map": schema.IMAGE_MAP,
    "image_speeds": schema.IMAGE_SPEEDS,
    "between_trackers": schema.BETWEEN_TRACKERS,
    "rigid": schema.RIGID,
    "pose_growth": schema.POSE_GROWTH,
    "floors": schema.FLOORS,
    "cameras": findings_schema.CAMERAS,
    "audit_samples": findings_schema.AUDIT_SAMPLES,
    "window_noise": schema.WINDOW_NOISE,
    "window_blocks": schema.WINDOW_BLOCKS,
}
SEED_TABLES: Mapping[str, schema.Schema] = {
    f"seed_{name}": {"seed": pl.Int32, **SEQUENCE_TABLES[name]} for name in ("moments", "ends", "frames")
}
"""Tables of a sequence that was measured with further random seeds, which are numbered from 1."""
NOISE_TABLES: Mapping[str, schema.Schema] = {
    "noise_sums": schema.NOISE_SUMS,
    "noise_outliers": schema.NOISE_OUTLIERS,
    "noise_covariates": schema.NOISE_COVARIATES,
    "noise_pairs": schema.NOISE_PAIRS,
    "noise_tracks": schema.NOISE_TRACKS,
    "track_errors": schema.TRACK_ERRORS,
}
"""What noise models are fitted to and tried on. Sequences that an earlier version measured do not have it."""
_ASKED_FOR: Mapping[str, schema.Schema] = {
    "point_tracking": schema.POINT_TRACKING,
    "patches": schema.PATCHES,
    "film": schema.FILM,
}
"""Tables of a sequence that it has only where the experiment asks for them, or keeps observations."""
_OF_LATER_VERSIONS: Mapping[str, schema.Schema] = {
    "ratio_sums": schema.RATIOS,
    "depth_repeats": findings_schema.DEPTH_REPEATS,
    "covariance_sums": schema.COVARIANCE_SUMS,
    "pair_sums": schema.PAIR_SUMS,
    "pair_tracks": schema.PAIR_TRACKS,
    "rig": schema.RIG,
}
"""Tables that sequences of earlier versions do not have."""
KIND_TABLES: Mapping[str, schema.Schema] = {
    f"kind_{name}": {"references": pl.String, **SEQUENCE_TABLES[name]} for name in ("moments", "scales")
}
"""Tables of a sequence whose poses were refined, by the poses of each kind of reference tracks alone."""
_OF_OTHER_TIMES: Mapping[str, schema.Schema] = {"path": findings_schema.PATH}
"""Tables of a sequence whose recording has poses beside those of its frames, such as that of every n-th frame."""
_ALL_SEQUENCE_TABLES: Mapping[str, schema.Schema] = {
    **SEQUENCE_TABLES,
    **NOISE_TABLES,
    **SEED_TABLES,
    **_ASKED_FOR,
    **_OF_OTHER_TIMES,
    **_OF_LATER_VERSIONS,
    **KIND_TABLES,
}
OBSERVED = ("observations", "tracks")
"""Tables of a sequence that grow with its observations. No table of the whole run is computed from them."""
_OPTIONAL = (*OBSERVED, *NOISE_TABLES, *SEED_TABLES, *_ASKED_FOR, *_OF_OTHER_TIMES, *_OF_LATER_VERSIONS, *KIND_TABLES)


def schema_of(name: str) -> schema.Schema:
    """Columns of a table of a sequence."""
    return _ALL_SEQUENCE_TABLES[name]


@dataclass(frozen=True, slots=True)
class _Hashes:
    """Hashes in one version of the manifest: of the files of each sequence, and of those of the whole run."""

    version: tuple[int, int, int] | None
    sequences: dict[str, dict[str, str]]
    statistics: dict[str, str]


class RunFolder:
    """A run folder on disk.

    Parameters
    ----------
    path
        Path of the folder. It need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._is_free_of_links = False
        self._last_read: _Hashes | None = None

    @property
    def lock_path(self) -> Path:
        """The file that names the process that measures into this folder."""
        return self.path / _LOCK

    def part(self, key: str, number: int) -> "RunFolder":
        """Where a part of a sequence is kept until all of its parts are measured."""
        return RunFolder(self.path / _PARTS / key / f"{number:04d}")

    def discard_parts(self, *, but: Collection[str]) -> None:
        """Remove the parts of all sequences but some.

        Raises
        ------
        StoreError
            If one cannot be removed.
        """
        self._discard(_PARTS, but)

    def discard_references(self, *, but: Collection[str]) -> None:
        """Remove the reference tracks of all sequences but some.

        Raises
        ------
        StoreError
            If some cannot be removed.
        """
        self._discard(_REFERENCES, but)

    def _discard(self, name: str, but: Collection[str]) -> None:
        folder = self.path / name
        paths = list(folder.iterdir()) if folder.is_dir() else []
        for path in paths:
            if path.name not in but:
                remove(path)
        if paths and not any(folder.iterdir()):
            remove(folder)

    @property
    def exists(self) -> bool:
        """Whether a run was started here."""
        return (self.path / _MANIFEST).is_file()

    @property
    def has_measured(self) -> bool:
        """Whether a run was started here and has measured a sequence."""
        return self.exists and bool(self.manifest().sequences)

    @property
    def has_parts(self) -> bool:
        """Whether a run was started here and has measured parts of sequences that are not complete."""
        return self.exists and any((self.path / _PARTS).glob(f"*/*/{_MANIFEST}"))

    def require_empty(self) -> None:
        """Refuse a folder that holds anything but its lock and unfinished files of a killed start.

        Raises
        ------
        StoreError
            If it does, or is not a folder.
        """
        if self.path.exists() and not self.path.is_dir():
            raise StoreError(f"{self.path}: is a file, expected a new or empty folder")
        if not self.path.is_dir():
            return
        if set(self.path.iterdir()) - {self.lock_path, self.path / _REFERENCES, *unfinished(self.path)}:
            raise StoreError(f"{self.path}: contains files that are not a run, expected a new or empty folder")

    def create(self, experiment_toml: str, manifest: Manifest) -> None:
        """Start a run: write an empty manifest, which gets the hash of the settings, then the settings.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        content = experiment_toml.encode()
        manifest.experiment_sha256 = [digest(content)]
        self.write_manifest(manifest)
        write_atomically(self.path / _SETTINGS, content)

    def replace_experiment(self, experiment_toml: str, manifest: Manifest) -> None:
        """Replace the resolved settings. The manifest gets their hash, and must be written afterwards.

        The manifest is first written with both hashes. A process that is killed at any time therefore leaves settings
        that match the manifest.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        content = experiment_toml.encode()
        manifest.experiment_sha256 = [*manifest.experiment_sha256, digest(content)]
        self.write_manifest(manifest)
        write_atomically(self.path / _SETTINGS, content)
        manifest.experiment_sha256 = [digest(content)]

    def experiment_toml(self) -> str:
        """Return the resolved settings as the text of a TOML file.

        Raises
        ------
        StoreError
            If there is no run here, or the settings are missing or not those that were written.
        """
        remedy = "`tracknoise run` with the same experiment writes them again"
        hashes = self.manifest().experiment_sha256
        return read_text_checked(self.path / _SETTINGS, hashes, expected="the settings of the run", remedy=remedy)

    def settings(self) -> dict[str, Any]:
        """The resolved settings by their keys, of which those that every experiment has are there.

        Raises
        ------
        StoreError
            As `experiment_toml`, and if they are not the settings of an experiment.
        """
        text = self.experiment_toml()
        try:
            return parse_run_settings(text)
        except ValueError as error:
            place = self.path / _SETTINGS
            raise StoreError(f"{place}: damaged ({error}), expected the settings of a run") from error

    def manifest(self) -> Manifest:
        """Read the manifest.

        Raises
        ------
        StoreError
            If there is no run here, or the manifest is damaged or of another format.
        """
        return self._read()[0]

    def write_manifest(self, manifest: Manifest) -> None:
        """Write the manifest, so that it survives a power cut.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_atomically(self.path / _MANIFEST, manifest.to_json().encode(), durably=True)

    def write_sequence(
        self, key: str, tables: Mapping[str, pl.DataFrame | pl.LazyFrame], snapshot_png: bytes
    ) -> dict[str, str]:
        """Write the tables and the image of one sequence. Lazy tables must be of stored ones, and are not checked.

        Only tables of `OBSERVED` and `SEED_TABLES`, and those that an experiment must ask for, may be missing.

        Returns
        -------
        dict
            Hash of each written file, as in `SequenceEntry.sha256`.

        Raises
        ------
        SchemaError
            If a table does not have its columns.
        StoreError
            If the folder cannot be written.
        """
        hashes = {}
        for name, columns in _ALL_SEQUENCE_TABLES.items():
            if name in tables or name not in _OPTIONAL:
                table = tables[name]
                if isinstance(table, pl.DataFrame):
                    checked = schema.check(table, columns, name)
                    table = schema.storable(checked.lazy()) if name in OBSERVED else schema.storable(checked)
                hashes[name] = write_parquet(self._table_path(name, key), table)
        return {**hashes, _SNAPSHOTS: write_atomically(self.snapshot_path(key), snapshot_png)}

    def has_sequence(self, entry: SequenceEntry) -> bool:
        """Whether all files of one sequence exist and have the recorded hashes. Reads all of them."""
        kept = [name for name in _ALL_SEQUENCE_TABLES if name in entry.sha256 or name not in _OPTIONAL]
        paths = {name: self._table_path(name, entry.key) for name in kept}
        paths[_SNAPSHOTS] = self.snapshot_path(entry.key)
        return all(is_intact(path, entry.sha256.get(name, "")) for name, path in paths.items())

    def write_inputs(self, key: str, table: pl.DataFrame) -> None:
        """Write the table `INPUTS` of a sequence.

        The manifest has no hash of this file, because times of modification in it may be replaced. It has one of what
        the files held: `SequenceEntry.inputs`.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_parquet(self._table_path(_INPUTS, key), schema.check(table, schema.INPUTS, _INPUTS))

    def inputs(self, key: str) -> pl.DataFrame | None:
        """The table `INPUTS` of a sequence; None if it is missing or damaged."""
        try:
            return read_parquet(self._table_path(_INPUTS, key), schema.INPUTS, None)
        except (StoreError, SchemaError):
            return None

    def write_references(self, key: str, part: int | None, table: pl.DataFrame) -> None:
        """Write the table `REFERENCES` of a sequence, or of a part of it. A later run in this folder may read it.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_parquet(self._references_path(key, part), schema.check(table, schema.REFERENCES, _REFERENCES))

    def references(self, key: str, part: int | None) -> pl.DataFrame | None:
        """The table `REFERENCES` of a sequence, or of a part of it; None if it is missing or damaged."""
        try:
            return read_parquet(self._references_path(key, part), schema.REFERENCES, None)
        except (StoreError, SchemaError):
            return None

    def _references_path(self, key: str, part: int | None) -> Path:
        return self.path / _REFERENCES / key / f"{part or 0:04d}.parquet"

    def discard_unfinished(self) -> None:
        """Remove unfinished files, and unfinished folders of processes that were killed.

        Raises
        ------
        StoreError
            If one cannot be removed.
        """
        discard_abandoned(self.path)  # reports are written without the lock of the run
        names = (".", "statistics", _INPUTS, _SNAPSHOTS, *_ALL_SEQUENCE_TABLES)
        for folder in (*(self.path / name for name in names), *(self.path / _REFERENCES).glob("*/")):
            for path in unfinished(folder):
                if path.is_file():
                    remove(path)

    def discard_documents(self) -> None:
        """Remove the report and ``findings.json``, which are outdated once other statistics are written.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        for path in (self.path / "report", self.path / "statistics" / FINDINGS_JSON):
            remove(path)

    def discard_results(self) -> None:
        """Remove the report and the tables of the whole run.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        for name in ("report", "statistics"):
            remove(self.path / name)

    def clear(self) -> None:
        """Remove the run, but no other files in its folder, nor its reference tracks. The manifest may be damaged.

        The manifest is emptied first and removed last. A process that is killed in between therefore leaves a run that
        can be resumed.

        Raises
        ------
        StoreError
            If the folder is not that of a run, or cannot be written.
        """
        self._require_run()
        self.write_manifest(Manifest.empty())
        self.discard_results()
        for name in (*_ALL_SEQUENCE_TABLES, _INPUTS, _SNAPSHOTS, _PARTS, _FAILURES, _SETTINGS, _MANIFEST):
            remove(self.path / name)

    def snapshot_path(self, key: str) -> Path:
        """Path of the image of one sequence, PNG."""
        return self.path / _SNAPSHOTS / f"{key}.png"

    def snapshot(self, key: str) -> bytes:
        """The image of one sequence, PNG.

        Raises
        ------
        StoreError
            If it is missing or damaged.
        """
        sha256 = self._hashes_of(key).get(_SNAPSHOTS)
        return read_checked(self.snapshot_path(key), [sha256] if sha256 else [], expected="an image of the run")

    def names_of_tables(self, key: str) -> list[str]:
        """Names of the tables that are stored of one sequence."""
        return [name for name in self._hashes_of(key) if name in _ALL_SEQUENCE_TABLES]

    def sequence_table(self, name: str, key: str) -> pl.DataFrame:
        """One table of one sequence.

        Raises
        ------
        StoreError, SchemaError
            If the run does not keep such tables, or the file is missing or damaged, or has other columns.
        """
        return read_parquet(self._table_path(name, key), _ALL_SEQUENCE_TABLES[name], self._hash_of(name, key))

    def scan(self, name: str, key: str) -> pl.LazyFrame:
        """One table of one sequence, of which only those rows are read that are asked for, after its hash is checked.

        Raises
        ------
        StoreError
            If the run does not keep such tables, or the file is missing or damaged.
        """
        path, sha256 = self._table_path(name, key), self._hash_of(name, key)
        if sha256 is not None and not is_intact(path, sha256):
            read_checked(path, [sha256], expected="a table of the run")  # says what is wrong
        return pl.scan_parquet(path, glob=False)

    def rows(self, name: str, key: str, *chosen: pl.Expr) -> pl.DataFrame:
        """Those rows of one table of one sequence that are chosen, which alone are in memory.

        Raises
        ------
        StoreError, SchemaError
            As `sequence_table`.
        """
        columns = _ALL_SEQUENCE_TABLES[name]
        try:
            table = self.scan(name, key).filter(*chosen).collect()
        except pl.exceptions.PolarsError:
            table = self.sequence_table(name, key).filter(*chosen)  # says what is wrong, if it is the file
        return schema.check(schema.of_this_version(table, columns), columns, name)

    def sequence_tables(self, name: str) -> Iterator[pl.DataFrame]:
        """One table of each measured sequence, in the order of their keys."""
        for key in sorted(self._hashes().sequences):
            yield self.sequence_table(name, key)

    def stored_tables(self, name: str, *, only: Collection[str] | None = None) -> Iterator[pl.DataFrame]:
        """Tables of the measured sequences that have them, in the order of their keys, as `stacked_tables`.

        Raises
        ------
        StoreError, SchemaError
            As `sequence_table`.
        """
        recorded = self._hashes().sequences
        yield from self.stacked_tables(name, [key for key in sorted(recorded) if name in recorded[key]], only=only)

    def stacked_tables(
        self, name: str, keys: Sequence[str], *, only: Collection[str] | None = None
    ) -> Iterator[pl.DataFrame]:
        """One table of each of some sequences, in order, a few sequences at a time as one table.

        Parameters
        ----------
        name, keys
            Of the table, and of the sequences.
        only
            Names of the columns that are wanted; by default all.

        Raises
        ------
        StoreError, SchemaError
            As `sequence_table`.
        """
        for start in range(0, len(keys), _STACKED):
            batch, recorded = keys[start : start + _STACKED], self._recorded()
            files = {self._table_path(name, key): self._kept(name, recorded.get(key, {})) for key in batch}
            yield read_stacked(files, _ALL_SEQUENCE_TABLES[name], only=only)

    def write_statistics(
        self, tables: Mapping[RunTable, pl.DataFrame], *, documents: Mapping[str, str] | None = None
    ) -> None:
        """Write tables and documents of the whole run, then the manifest with their hashes.

        Parameters
        ----------
        tables
            Of the run.
        documents
            Texts by their paths in ``statistics``, such as ``findings.json``. Others are left as they are.

        Raises
        ------
        SchemaError, StoreError
            If a table does not have its columns, or the folder cannot be written.
        """
        checked = [
            (table.name, schema.storable(schema.check(data, table, table.name))) for table, data in tables.items()
        ]
        manifest, folder = self.manifest(), self.path / "statistics"
        for name, data in checked:
            manifest.statistics[name] = write_parquet(folder / f"{name}.parquet", data)
        for name, text in (documents or {}).items():
            manifest.statistics[name] = write_atomically(folder / name, text.encode())
        self.write_manifest(manifest)

    def statistics(self, table: RunTable) -> pl.DataFrame:
        """One table of the run; empty if it was never written, as one of an analysis that was not made.

        Raises
        ------
        StoreError, SchemaError
            If the run is not finished, or the file is missing or damaged, or has other columns.
        """
        hashes, folder = self._hashes().statistics, self.path / "statistics"
        if _SUMMARY not in hashes or not folder.is_dir():
            raise StoreError(f"{self.path}: no finished run, expected one; `tracknoise run` starts or resumes a run")
        if table.name not in hashes:
            return schema.empty(table)
        return read_parquet(folder / f"{table.name}.parquet", table, hashes[table.name])

    def document(self, name: str) -> str | None:
        """The text of a document in ``statistics``, such as `FINDINGS_JSON`. None where it was never written.

        Raises
        ------
        StoreError
            If it is missing or damaged.
        """
        sha256 = self._hashes().statistics.get(name)
        if sha256 is None:
            return None
        return read_text_checked(self.path / "statistics" / name, [sha256], expected="a document of the run")

    def write_failures(self, failures: Mapping[str, FailureEntry]) -> None:
        """Write ``failures.jsonl``, one line per failed sequence; remove the file if there is none.

        Raises
        ------
        StoreError
            If it cannot be written or removed.
        """
        path = self.path / _FAILURES
        if not failures:
            remove(path)
            return
        lines = [json.dumps({"sequence": key, **asdict(entry)}) for key, entry in sorted(failures.items())]
        write_atomically(path, ("\n".join(lines) + "\n").encode())

    def _table_path(self, name: str, key: str) -> Path:
        return self.path / name / f"{key}.parquet"

    def _hash_of(self, name: str, key: str) -> str | None:
        """Hash of one table of a sequence; None if the sequence is not in the manifest."""
        return self._kept(name, self._hashes_of(key))

    def _kept(self, name: str, hashes: Mapping[str, str]) -> str | None:
        """Hash of one of the tables of a sequence, all of whose hashes these are."""
        if hashes and name in OBSERVED and name not in hashes:
            raise StoreError(f'{self.path}: keeps no {name}, expected a run with keep = "observations"')
        return hashes.get(name)

    def _hashes_of(self, key: str) -> dict[str, str]:
        """Hashes of the files of a sequence; none if there is no manifest, or it does not name the sequence."""
        return self._recorded().get(key, {})

    def _recorded(self) -> dict[str, dict[str, str]]:
        """Hashes of the files of each sequence; none if there is no manifest."""
        return {} if self._version() is None else self._hashes().sequences

    def _hashes(self) -> _Hashes:
        """Hashes from the manifest. It can be large, so each version is read once."""
        last, version = self._last_read, self._version()
        return self._read()[1] if last is None or version is None or last.version != version else last

    def _read(self) -> tuple[Manifest, _Hashes]:
        """The manifest, and its hashes, which are remembered."""
        if not self._is_free_of_links:
            require_no_links(self.path)
            self._is_free_of_links = True
        place, version = str(self.path / _MANIFEST), self._version()
        try:
            manifest = Manifest.from_json(self._manifest_content().decode(), place=place)
        except UnicodeDecodeError as error:
            raise StoreError(damaged(place, str(error))) from error
        of_sequences = {key: entry.sha256 for key, entry in manifest.sequences.items()}
        self._last_read = _Hashes(version, of_sequences, dict(manifest.statistics))
        return manifest, self._last_read

    def _version(self) -> tuple[int, int, int] | None:
        """What tells two versions of the manifest apart; None without one."""
        try:
            status = (self.path / _MANIFEST).stat()
        except OSError:
            return None
        return status.st_ino, status.st_mtime_ns, status.st_size

    def _manifest_content(self) -> bytes:
        try:
            return read_regular(self.path / _MANIFEST)
        except (OSError, ValueError) as error:
            raise StoreError(f"{self.path}: no readable {_MANIFEST}, expected the folder of a run") from error

    def _require_run(self) -> None:
        """Refuse a folder whose manifest is damaged and that has no settings either: it may be anything."""
        content = self._manifest_content().decode(errors="replace")
        if not has_format(content) and not (self.path / _SETTINGS).is_file():
            raise StoreError(
                f"{self.path / _MANIFEST}: damaged, and no {_SETTINGS} beside it, expected a run's manifest; "
                "if the folder holds a run, remove it"
            )
