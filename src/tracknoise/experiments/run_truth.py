"""The audit of a run's truth, and the verdict on it, from the tables of its sequences."""

from math import hypot, sqrt
from statistics import fmean

import polars as pl

from tracknoise.analysis.condition_units import groups_of_scenes
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.experiments.run_statistics import first_lighting
from tracknoise.experiments.settings import SECOND_CAMERA, SYNTHETIC, Experiment
from tracknoise.experiments.wrong_tracks import largest, wrong_in_run
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.tables.findings_schema import FLOOR, SUMMARY
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.schema import RIGID, VIEW, empty
from tracknoise.tables.store import RunFolder
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.truth_faults.assessment import MOST, ErrorSize, TruthEvidence, assess, refutes
from tracknoise.truth_faults.audit_summary import usual_mistakes
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples, tables_of
from tracknoise.truth_faults.pose_accuracy import POSE_SHARE, scene_shares


def run_audit(run: RunFolder, manifest: Manifest, experiment: Experiment) -> AuditTables:
    """Audit the truth of a run.

    One view of each scene and camera takes part: the first of its lightings, in the order of the experiment.
    """
    tables = [_audited(run, key, manifest.sequences[key]) for key in audited_keys(manifest, experiment)]
    groups = groups_of_scenes(manifest.sequences, experiment.dataset.groups)
    synthetic = [tracker.label for tracker in experiment.trackers if tracker.kind in SYNTHETIC]
    samples = read_samples(tables, groups, without=synthetic)
    return tables_of(samples, next(iter(manifest.sequences.values())).sequence.dataset)


def _audited(run: RunFolder, key: str, entry: SequenceEntry) -> AuditedTables:
    """What a sequence keeps for the audit; poses at other times, and repeats of depths, only where it has them."""
    names = "audit_samples", "cameras", "poses", *(name for name in ("path", "depth_repeats") if name in entry.sha256)
    tables = {name.removeprefix("audit_"): run.sequence_table(name, key) for name in names}
    leads = entry.pose_fit is not None and entry.pose_fit.leads
    return AuditedTables(**tables, z_depth_from=entry.z_depth_from, refined=leads)


def audited_keys(manifest: Manifest, experiment: Experiment) -> list[str]:
    """Keys of one sequence of each scene and camera: upright and forward if there is one, under its first lighting."""
    audited: dict[tuple[str, str], dict[str, str]] = {}
    for key, entry in sorted(manifest.sequences.items()):
        name = entry.sequence
        if name.rotation == 0 and name.direction == "forward":
            audited.setdefault((name.scene, name.camera), {})[name.lighting] = key
    return sorted(keys[first_lighting(keys, experiment)] for keys in audited.values())


def trust_table(manifest: Manifest, experiment: Experiment, inputs: RunInputs) -> pl.DataFrame:
    """The verdict on the truth of a run.

    Parameters
    ----------
    manifest, experiment
        What the run is of.
    inputs
        With the tables of the audit, and the shares of poses.
    """
    entries = [manifest.sequences[key] for key in sorted(manifest.sequences)]
    every = {tracker.label for tracker in experiment.trackers}
    seen = every - {tracker.label for tracker in experiment.trackers if tracker.kind in SYNTHETIC | SECOND_CAMERA}
    shown = [pl.col(name) == getattr(inputs.reference, name) for name in (*VIEW, "speed")]
    rigid = [empty(RIGID), *(table.filter(*shown) for table in inputs.run.stored_tables("rigid"))]
    audit = AuditTables.of(inputs.named)
    summary = inputs[SUMMARY].filter(*shown, pl.col("tracker").is_in(seen or every))
    states = all(entry.states_accuracy for entry in entries)
    floor = inputs[FLOOR].filter(*shown, source="all", axis="age")
    confirmed = largest([entry.confirmed_share for entry in entries])
    evidence = TruthEvidence(
        audit=audit.audit,
        pose_shares=inputs[POSE_SHARE].filter(*shown, pl.col("tracker").is_in(seen)),  # others were made from it
        sizes=_sizes(summary, str(experiment.findings.trimming), floor if states else floor.clear()),
        curves=audit.audit_curves,
        tracks=wrong_in_run([entry.wrong_tracks for entry in entries]),
        confirmed_share=confirmed,
        mistakes=[*_each(entries, "doubts"), *([] if refutes(confirmed, MOST) else usual_mistakes(audit.audit))],
        cautions=_each(entries, "cautions"),
        depth_edges=fmean(entry.depth_edges for entry in entries),
        pose_fits=[entry.pose_fit for entry in entries],
        is_fitted=any(entry.truth == TRIANGULATED for entry in entries),
        measures_depths=any(entry.depth_is_from_images for entry in entries),
        scene_shares=scene_shares(pl.concat(rigid)),
    )
    return assess(evidence, entries[0].sequence.dataset)


def _each(entries: list[SequenceEntry], name: str) -> list[str]:
    """Sentences about all sequences, each once."""
    return list(dict.fromkeys(sentence for entry in entries for sentence in getattr(entry, name)))


def _sizes(summary: pl.DataFrame, trimming: str, floor: pl.DataFrame) -> dict[str, ErrorSize]:
    """Size of the errors of each tracker whose errors are known, and by age of what is stated of the truth."""
    sizes = {}
    for row in summary.drop_nulls("at").to_dicts():
        core = [row[f"{trimming}_core_{axis}_px"] for axis in "uv"]
        stated = floor.filter(pl.col("at") <= row["at"], tracker=row["tracker"]).select("at", "floor_uu", "floor_vv")
        sizes[row["tracker"]] = ErrorSize(
            age=row["at"],
            error_px=hypot(row[f"{trimming}_rms_u_px"], row[f"{trimming}_rms_v_px"]),
            stated_px={age: sqrt(uu + vv) for age, uu, vv in stated.iter_rows()} or None,
            core_px=None if None in core else hypot(*core),
        )
    return sizes
