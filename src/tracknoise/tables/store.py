"""The run folder: what an experiment measured, as Parquet files and a manifest.

It holds ``experiment.toml`` (the resolved settings), ``manifest.json``, one Parquet file per sequence in each folder of
`SEQUENCE_TABLES`, one image per sequence in ``snapshots/``, tables of the whole run in ``statistics/``,
``failures.jsonl``, and ``report/``. If only statistics are kept, the folders of `OBSERVED` are missing.

Every file is written completely and then renamed. A sequence counts as measured once it is in the manifest, which is
written last and holds the hash of each of its files. During a run, ``.lock`` names the process that writes here.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import polars as pl

from tracknoise.atomic import unfinished
from tracknoise.exceptions import StoreError
from tracknoise.tables import findings_schema, schema
from tracknoise.tables.files import is_intact, read_parquet, remove, write_atomically, write_parquet
from tracknoise.tables.manifest import FailureEntry, Manifest, SequenceEntry

__all__ = ["FailureEntry", "Manifest", "RunFolder", "SequenceEntry"]

_LOCK = ".lock"
_MANIFEST, _SETTINGS, _FAILURES, _SNAPSHOTS = "manifest.json", "experiment.toml", "failures.jsonl", "snapshots"
_RESULTS = ("report", "statistics")
SEQUENCE_TABLES: Mapping[str, schema.Schema] = {
    "observations": schema.OBSERVATIONS,
    "tracks": schema.TRACKS,
    "frames": schema.FRAME_COUNTS,
    "poses": schema.POSES,
    "moments": schema.MOMENTS,
    "trims": schema.TRIMS,
    "counts": schema.COUNTS,
    "ends": schema.ENDS,
    "errors": schema.ERRORS,
    "scales": schema.SCALES,
    "blocks": schema.BLOCKS,
    "scale_blocks": schema.SCALE_BLOCKS,
    "aspects": schema.ASPECTS,
    "aspect_blocks": schema.ASPECT_BLOCKS,
    "increments": schema.INCREMENTS,
    "samples": schema.SAMPLES,
}
SEED_TABLES: Mapping[str, schema.Schema] = {
    f"seed_{name}": {"seed": pl.Int32, **SEQUENCE_TABLES[name]} for name in ("moments", "ends", "frames")
}
"""Tables of a sequence that was measured with further random seeds, which are numbered from 1."""
_ALL_SEQUENCE_TABLES: Mapping[str, schema.Schema] = {**SEQUENCE_TABLES, **SEED_TABLES}
OBSERVED = ("observations", "tracks")
"""Tables of a sequence that grow with its observations. No table of the whole run is computed from them."""
STATISTICS_TABLES: Mapping[str, schema.Schema] = {
    "curves": schema.CURVES,
    "cores": schema.CORES,
    "lifetimes": schema.LIFETIMES,
    "outliers": schema.OUTLIERS,
    "trims": schema.TRIMS,
    "errors": schema.ERRORS,
    "counts": schema.COUNTS,
    "summary": schema.SUMMARY,
    "effects": schema.EFFECTS,
}
FINDINGS_TABLES: Mapping[str, schema.Schema] = {
    "aspect_curves": schema.ASPECT_CURVES,
    "changes": schema.CHANGES,
    "intervals": findings_schema.INTERVALS,
    "seed_spread": findings_schema.SEED_SPREAD,
    "incidence": findings_schema.INCIDENCE,
    "zero_mean": findings_schema.ZERO_MEAN,
    "gaussianity": findings_schema.GAUSSIANITY,
    "radii": findings_schema.RADII,
    "time_structure": findings_schema.TIME_STRUCTURE,
    "dependence": findings_schema.DEPENDENCE,
    "findings": findings_schema.FINDINGS,
}
"""Tables of the whole run that are computed from the others. They are empty if they were not computed."""
_RUN_TABLES: Mapping[str, schema.Schema] = {**STATISTICS_TABLES, **FINDINGS_TABLES}


class RunFolder:
    """A run folder on disk.

    Parameters
    ----------
    path
        Path of the folder. It need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._hashes: tuple[tuple[int, int, int], dict[str, dict[str, str]]] | None = None

    @property
    def lock_path(self) -> Path:
        """The file that names the process that measures into this folder."""
        return self.path / _LOCK

    @property
    def exists(self) -> bool:
        """Whether a run was started here."""
        return (self.path / _MANIFEST).is_file()

    @property
    def is_unstarted(self) -> bool:
        """Whether the run here was killed before its settings were written, or after they were removed."""
        return self.exists and not (self.path / _SETTINGS).exists() and not self.manifest().sequences

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
        if set(self.path.iterdir()) - {self.lock_path, *unfinished(self.path)}:
            raise StoreError(f"{self.path}: contains files that are not a run, expected a new or empty folder")

    def create(self, experiment_toml: str, manifest: Manifest) -> None:
        """Start a run: write an empty manifest, then the settings.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        self.write_manifest(manifest)
        self.write_experiment(experiment_toml)

    def write_experiment(self, experiment_toml: str) -> None:
        """Write the resolved settings, the text of a TOML file.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_atomically(self.path / _SETTINGS, experiment_toml.encode())

    def experiment_toml(self) -> str:
        """Return the resolved settings as the text of a TOML file.

        Raises
        ------
        StoreError
            If there is no run here.
        """
        return self._read_text(_SETTINGS)

    def manifest(self) -> Manifest:
        """Read the manifest.

        Raises
        ------
        StoreError
            If there is no run here, or the manifest is damaged or of another format.
        """
        return Manifest.from_json(self._read_text(_MANIFEST), place=str(self.path / _MANIFEST))

    def write_manifest(self, manifest: Manifest) -> None:
        """Write the manifest, so that it survives a power cut.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_atomically(self.path / _MANIFEST, manifest.to_json().encode(), durably=True)

    def write_sequence(self, key: str, tables: Mapping[str, pl.DataFrame], snapshot_png: bytes) -> dict[str, str]:
        """Write the tables and the image of one sequence. Only those of `OBSERVED` and `SEED_TABLES` may be missing.

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
            if name in tables or name not in (*OBSERVED, *SEED_TABLES):
                table = schema.check(tables[name], columns, name)
                hashes[name] = write_parquet(self._table_path(name, key), table)
        return {**hashes, _SNAPSHOTS: write_atomically(self.snapshot_path(key), snapshot_png)}

    def has_sequence(self, entry: SequenceEntry) -> bool:
        """Whether all files of one sequence exist and have the recorded hashes. Reads all of them."""
        optional = (*OBSERVED, *SEED_TABLES)
        kept = [name for name in _ALL_SEQUENCE_TABLES if name in entry.sha256 or name not in optional]
        paths = {name: self._table_path(name, entry.key) for name in kept}
        paths[_SNAPSHOTS] = self.snapshot_path(entry.key)
        return all(is_intact(path, entry.sha256.get(name, "")) for name, path in paths.items())

    def discard_unfinished(self) -> None:
        """Remove unfinished files and folders of a killed process.

        Raises
        ------
        StoreError
            If one cannot be removed.
        """
        for folder in (".", "statistics", _SNAPSHOTS, *_ALL_SEQUENCE_TABLES):
            for path in unfinished(self.path / folder):
                remove(path)

    def discard_results(self) -> None:
        """Remove the report and the tables of the whole run, which are outdated once a sequence is added.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        for name in _RESULTS:
            remove(self.path / name)

    def clear(self) -> None:
        """Remove the run, but no other files in its folder.

        The manifest is emptied first and removed last. A process that is killed in between therefore leaves a run that
        can be resumed.

        Raises
        ------
        StoreError
            If the manifest is not that of a run, or the folder cannot be written.
        """
        self.write_manifest(Manifest.emptied(self._read_text(_MANIFEST), place=str(self.path / _MANIFEST)))
        self.discard_results()
        for name in (*_ALL_SEQUENCE_TABLES, _SNAPSHOTS, _FAILURES, _SETTINGS, _MANIFEST):
            remove(self.path / name)

    def snapshot_path(self, key: str) -> Path:
        """Path of the image of one sequence, PNG."""
        return self.path / _SNAPSHOTS / f"{key}.png"

    def sequence_table(self, name: str, key: str) -> pl.DataFrame:
        """One table of one sequence.

        Raises
        ------
        StoreError, SchemaError
            If the run does not keep such tables, or the file is missing or damaged, or has other columns.
        """
        hashes = self._hashes_of(key)
        if hashes and name in OBSERVED and name not in hashes:
            raise StoreError(f'{self.path}: keeps no {name}, expected a run with keep = "observations"')
        return read_parquet(self._table_path(name, key), _ALL_SEQUENCE_TABLES[name], hashes.get(name))

    def sequence_tables(self, name: str) -> Iterator[pl.DataFrame]:
        """One table of each measured sequence, in the order of their keys."""
        for key in sorted(self.manifest().sequences):
            yield self.sequence_table(name, key)

    def write_statistics(self, tables: Mapping[str, pl.DataFrame]) -> None:
        """Write tables of `STATISTICS_TABLES` or `FINDINGS_TABLES` by name, then the manifest with their hashes.

        Raises
        ------
        SchemaError, StoreError
            If a table does not have its columns, or the folder cannot be written.
        """
        checked = {name: schema.check(table, _RUN_TABLES[name], name) for name, table in tables.items()}
        manifest = self.manifest()
        for name, table in checked.items():
            manifest.statistics[name] = write_parquet(self.path / "statistics" / f"{name}.parquet", table)
        self.write_manifest(manifest)

    def statistics(self, name: str) -> pl.DataFrame:
        """One table of `STATISTICS_TABLES` or `FINDINGS_TABLES`.

        A table of `FINDINGS_TABLES` that was never written is empty.

        Raises
        ------
        StoreError, SchemaError
            If the run is not finished, or the file is missing or damaged, or has other columns.
        """
        if not (self.path / "statistics").is_dir():
            raise StoreError(f"{self.path}: no finished run, expected one; `tracknoise run` starts or resumes a run")
        hashes = self.manifest().statistics
        if name in FINDINGS_TABLES and name not in hashes:
            return schema.empty(FINDINGS_TABLES[name])
        return read_parquet(self.path / "statistics" / f"{name}.parquet", _RUN_TABLES[name], hashes.get(name))

    def write_findings(self, document: str) -> None:
        """Write ``statistics/findings.json``, the text of a JSON document.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        write_atomically(self.path / "statistics" / "findings.json", document.encode())

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

    def _hashes_of(self, key: str) -> dict[str, str]:
        """Hashes of the files of a sequence, from the manifest. It can be large, so each version is read once."""
        try:
            status = (self.path / _MANIFEST).stat()
        except OSError:
            return {}
        version = (status.st_ino, status.st_mtime_ns, status.st_size)
        if self._hashes is None or self._hashes[0] != version:
            self._hashes = version, {key: entry.sha256 for key, entry in self.manifest().sequences.items()}
        return self._hashes[1].get(key, {})

    def _read_text(self, name: str) -> str:
        try:
            return (self.path / name).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise StoreError(f"{self.path}: no readable {name}, expected the folder of a run") from error
