"""The audit of a run's truth from the tables of its sequences."""

import polars as pl

from tracknoise.audit.read import AuditedTables
from tracknoise.audit.table import audit_tables
from tracknoise.experiments.analysis.reference_condition import first_lighting
from tracknoise.experiments.settings import SYNTHETIC, Experiment
from tracknoise.findings.sampling.groups_of_scenes import groups_of_scenes
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder


def run_audit(run: RunFolder, manifest: Manifest, experiment: Experiment) -> dict[str, pl.DataFrame]:
    """Audit the truth of a run: tables `audit` and `audit_curves`.

    One view of each scene and camera takes part: the first of its lightings, in the order of the experiment.

    Parameters
    ----------
    run
        Whose tables are read.
    manifest
        Its manifest, with at least one measured sequence.
    experiment
        Whose groups, lightings and trackers are used.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged.
    """
    tables = [_audited(run, key, manifest.sequences[key]) for key in audited_keys(manifest, experiment)]
    found = audit_tables(
        tables,
        groups_of_scenes(manifest.sequences, experiment.dataset.groups),
        dataset=next(iter(manifest.sequences.values())).sequence.dataset,
        without=[tracker.label for tracker in experiment.trackers if tracker.kind in SYNTHETIC],
    )
    return {"audit": found.audit, "audit_curves": found.audit_curves}


def _audited(run: RunFolder, key: str, entry: SequenceEntry) -> AuditedTables:
    """What a sequence keeps for the audit; poses at other times only where it has them."""
    names = ("audit_samples", "cameras", "poses", *(("path",) if "path" in entry.sha256 else ()))
    found = {name.removeprefix("audit_"): run.sequence_table(name, key) for name in names}
    return AuditedTables(**found, z_depth_from=entry.z_depth_from)


def audited_keys(manifest: Manifest, experiment: Experiment) -> list[str]:
    """Keys of one sequence of each scene and camera: upright and forward if there is one, under its first lighting."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for key, entry in sorted(manifest.sequences.items()):
        name = entry.sequence
        if name.rotation == 0 and name.direction == "forward":
            found.setdefault((name.scene, name.camera), {})[name.lighting] = key
    return sorted(keys[first_lighting(keys, experiment)] for keys in found.values())
