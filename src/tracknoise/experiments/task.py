"""Measure a batch of sequences of an experiment and write their tables; what a worker does."""

import socket
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np
import polars as pl

from tracknoise.exceptions import DataWarning, NothingToMeasureError
from tracknoise.experiments.doubts import Doubts, depth_edges, doubts, doubts_of_parts
from tracknoise.experiments.failures import Batch, InParts, Result, diagnose
from tracknoise.experiments.geometry_tables import camera_tables, geometry_tables
from tracknoise.experiments.inputs import digest_of, input_tables, recording
from tracknoise.experiments.local_workers import notify
from tracknoise.experiments.machine import keeping_freed_memory, kernels, one_blas_thread, use_one_opencv_thread
from tracknoise.experiments.measure import Measurement, measure_together, poses_of_two, tap_metrics
from tracknoise.experiments.measured_poses import with_measured_poses
from tracknoise.experiments.parts import (
    folder_of,
    joined_inputs,
    joined_tables,
    manifest_of_part,
    measured_before,
    measured_parts,
    note_of,
    one_piece_notes,
    parts_of,
)
from tracknoise.experiments.pictures import KEPT_BYTES, film, track_patches
from tracknoise.experiments.plan import Task, make_trackers, open_batch, open_second
from tracknoise.experiments.reference_kinds import kind_tables
from tracknoise.experiments.resume import new_manifest, require_versions
from tracknoise.experiments.run_lock import Claim
from tracknoise.experiments.settings import Experiment
from tracknoise.experiments.wrong_tracks import confirmed_share, largest, wrong_in_most, wrong_tracks
from tracknoise.measurement.refined_poses import Leading
from tracknoise.measurement.sequence_tables import require_length
from tracknoise.measurement.tracking import Progress
from tracknoise.processes import raise_if_interruption, release_memory
from tracknoise.sequences.images import content_hash, encode_png
from tracknoise.sequences.poses import pose_notes
from tracknoise.sequences.row_poses import shutter_notes
from tracknoise.sequences.sequence import SWEPT, TRIANGULATED, Sequence, TruthKind, group_of, z_depth_from
from tracknoise.statistics.lifetimes import count_ends
from tracknoise.statistics.summarise import STATISTICS, statistics_of
from tracknoise.tables.manifest import SequenceEntry, joined_fit
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.tracker import sees_second_camera
from tracknoise.truth.beside import require_second_camera
from tracknoise.truth.scan import ScanRule
from tracknoise.truth_faults.assessment import MOST, refutes
from tracknoise.words import DEPTH_FROM_IMAGES, SELF_REFERENTIAL


@keeping_freed_memory()
@one_blas_thread()
def attempt(
    batch: list[Task],
    run: RunFolder,
    *,
    claim: Claim | None = None,
    progress: Progress | None = None,
    debug: bool = False,
    verify: bool = False,
) -> Result:
    """Measure the sequences of a batch, or a part of one, or join its parts, and write the tables into the run folder.

    `batch`: sequences of one experiment that read the same files; `run`: where to write; `claim`: proof that the run
    holds the lock of the folder, checked before anything is written. Not needed by default; `progress`: called after
    each frame; `debug`: raise a failure instead of returning it, as interruptions are; `verify`: compare parts that an
    earlier start measured with their files by content. Returns entries for the manifest, one per task. A sequence
    counts as measured once the manifest contains its entry. Or the parts in which a sequence is to be measured, which
    is too long for one piece.
    """
    task = batch[0]
    try:
        if not task.parts:
            return _measure_batch(batch, run, claim=claim, progress=progress)
        if task.part is None:
            return [_joined(task, run, claim)]
        return [_measure_part(task, run, claim=claim, progress=progress, verify=verify)]
    except BaseException as error:  # a panic of Polars is no Exception, nor is what `sys.exit` raises in a plug-in
        raise_if_interruption(error)
        if debug:
            raise
        return diagnose(error)


def _measure_part(
    task: Task, run: RunFolder, *, claim: Claim | None, progress: Progress | None, verify: bool
) -> SequenceEntry:
    """Measure a part of a sequence, unless an earlier start did. An entry without files if there is nothing in it."""
    before, frames = measured_before(task, run, verify=verify), task.parts[task.part or 0]
    if before is not None:
        if progress is not None:
            progress(len(frames), len(frames))
        return before
    folder = folder_of(task, run)
    try:
        measured = _measure_batch([task], folder, claim=claim, progress=progress, beside=run)
        assert not isinstance(measured, InParts)
        entry = measured[0]
    except NothingToMeasureError:
        entry = SequenceEntry(task.sequence, len(frames), 0, 0, "", 0, 0.0)
    manifest = manifest_of_part(task)
    manifest.sequences[task.key] = entry
    folder.create(task.experiment.to_toml(), manifest)
    return entry


def _joined(task: Task, run: RunFolder, claim: Claim | None) -> SequenceEntry:
    """Write the tables of a sequence from those of its parts."""
    whole = replace(task, parts=())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the notes of the sequence contain the same text
        (sequence,), second = open_batch([whole]), open_second([whole])
    parts, n_frames = measured_parts(task, run), len(sequence)
    if not parts:
        raise NothingToMeasureError(sequence.source, "no feature with a true position", "poses, and depth or a surface")
    leading = with_measured_poses(
        sequence, ((measured.folder, measured.entry, measured.part.first_frame) for measured in parts)
    )
    other = next(iter(second), None if leading is sequence else sequence)
    tables = {
        **dict(joined_tables(task, parts)),
        **camera_tables(leading, n_frames),
        "pose_differences": poses_of_two(leading, other, n_frames),
    }
    middle, entries = parts[len(parts) // 2], [measured.entry for measured in parts]
    if claim:
        claim.check()
    hashes = run.write_sequence(task.key, tables, middle.folder.snapshot(task.key))
    frames = [task.parts[measured.part.place] for measured in parts]
    doubted = [(span, Doubts(entry.doubts, entry.cautions)) for span, entry in zip(frames, entries, strict=True)]
    doubts_of_all = doubts_of_parts(sequence, doubted)
    different = tuple(dict.fromkeys(note for entry in entries for note in entry.notes))
    entry = replace(
        middle.entry,
        n_frames=n_frames,
        snapshot_frame=middle.part.first_frame + middle.entry.snapshot_frame,
        seconds=round(sum(entry.seconds for entry in entries), 3),
        notes=(note_of(task, parts, n_frames), *_notes(sequence, n_frames, middle.entry.truth, different)),
        states_accuracy=all(entry.states_accuracy for entry in entries),
        pose_fit=joined_fit([entry.pose_fit for entry in entries]),
        wrong_tracks=wrong_in_most([entry.wrong_tracks for entry in entries]),
        confirmed_share=largest([entry.confirmed_share for entry in entries]),
        doubts=doubts_of_all.mistakes,
        cautions=doubts_of_all.cautions,
        depth_edges=fmean(entry.depth_edges for entry in entries),
        first_depth_m=entries[0].first_depth_m,
        kernels=" and ".join(sorted({entry.kernels for entry in entries})),
        parts=tuple((span.start, span.stop) for span in task.parts),
        sha256=hashes,
    )
    return _with_inputs(entry, joined_inputs([measured.folder for measured in parts], task.key), run)


@dataclass(frozen=True, slots=True)
class _Beside:
    """Where the reference tracks of a task are kept beside the run: a `KeptTracks`."""

    run: RunFolder
    task: Task
    claim: Claim | None

    def read(self) -> pl.DataFrame | None:
        """See `RunFolder.references`."""
        return self.run.references(self.task.key, self.task.part)

    def write(self, table: pl.DataFrame) -> None:
        """See `RunFolder.write_references`."""
        if self.claim:
            self.claim.check()
        self.run.write_references(self.task.key, self.task.part, table)


def _measure_batch(
    batch: list[Task],
    run: RunFolder,
    *,
    claim: Claim | None,
    progress: Progress | None,
    beside: RunFolder | None = None,
) -> list[SequenceEntry] | InParts:
    """Measure sequences into a folder; `beside`: the one of the whole run, by default the same."""
    beside = beside or run
    started, entries = time.monotonic(), []
    for task in batch:
        task.sequence.require_utf8()
    with warnings.catch_warnings(), recording(batch, beside) as recorder:
        warnings.simplefilter("ignore", DataWarning)  # the notes of the sequence contain the same text
        progress = recorder.following(progress)
        sequences = open_batch(batch, change=recorder.recorded)
        if any(map(sees_second_camera, make_trackers(batch[0].experiment).values())):
            for sequence in sequences:
                require_second_camera(sequence)
        parts = () if batch[0].parts else parts_of(batch[0], sequences[0])
        if parts:
            return InParts(parts)
        for sequence in sequences:
            require_length(sequence, len(sequence), batch[0].speeds)
        truth = batch[0].experiment.truth
        led = Leading.of(
            sequences,
            open_second(batch),
            kind=truth.kind,
            rule=truth.accuracy.rule(),
            only_stated=truth.poses == "stated",
            kept=[_Beside(beside, task, claim) for task in batch],
            progress=progress,
        )
        repeated = _repeated(batch, led.sequences, progress)
        measured = _measure(batch[0], led.sequences, progress, second=led.second)
        for task, made, fit, more in zip(batch, measured, led.fits, repeated, strict=True):
            measurement = replace(made, pose_fit=fit)
            sequence = measurement.sequence
            tables = {**tables_to_keep(task.experiment, measurement), **more}
            if _has_patches(task.experiment, sequences):
                tables["patches"] = track_patches(measurement, speed=min(task.speeds))
                if not task.part:  # of the first part of a sequence
                    tables["film"] = film(measurement)
            snapshot = encode_png(measurement.snapshot)
            release_memory()
            if claim:
                claim.check()
            hashes = run.write_sequence(task.key, tables, snapshot)
            seconds = (time.monotonic() - started) / len(batch)
            entry = sequence_entry(measurement, seconds=seconds, sha256=hashes)
            if task.part is not None:
                entry = replace(entry, notes=measurement.notes)  # those of the sequence are of all of its frames
            else:
                entry = replace(entry, notes=(*one_piece_notes(task, sequence), *entry.notes))
            kinds = {choice.label: choice.kind for choice in task.experiment.trackers}
            entry = _seen_in_images(entry, measurement, task.experiment)
            are_doubted = not (entry.wrong_tracks or refutes(entry.confirmed_share, MOST))
            doubted = doubts(measurement, kinds if are_doubted else {})
            entries.append(replace(entry, doubts=doubted.mistakes, cautions=doubted.cautions))
        inputs = input_tables(batch, recorder, sequences)
    return [_with_inputs(entry, table, run) for entry, table in zip(entries, inputs, strict=True)]


def _seen_in_images(entry: SequenceEntry, measurement: Measurement, experiment: Experiment) -> SequenceEntry:
    """The entry with what the images say of tracks, and of the truth where tracks follow them."""
    wrong = wrong_tracks(measurement, experiment)
    confirmed = None if wrong else confirmed_share(measurement, experiment)
    return replace(entry, wrong_tracks=wrong, confirmed_share=confirmed)


def _with_inputs(entry: SequenceEntry, table: pl.DataFrame, run: RunFolder) -> SequenceEntry:
    """Write what a sequence was measured from, and return its entry with the hash of that."""
    run.write_inputs(entry.key, table)
    return replace(entry, inputs=digest_of(table))


def sequence_entry(measurement: Measurement, *, sha256: dict[str, str], seconds: float = 0.0) -> SequenceEntry:
    """Manifest entry of a measured sequence; see `SequenceEntry` for the parameters."""
    sequence = measurement.sequence
    return SequenceEntry(
        sequence=sequence.id,
        n_frames=measurement.n_frames,
        width=sequence.camera.width,
        height=sequence.camera.height,
        truth=measurement.truth,
        snapshot_frame=measurement.snapshot_frame,
        seconds=round(seconds, 3),
        notes=_notes(sequence, measurement.n_frames, measurement.truth, measurement.notes),
        key_frame=measurement.key_frame,
        group=group_of(sequence),
        kernels=kernels(),
        z_depth_from=_z_depth_from(sequence, measurement.truth),
        depth_edges=depth_edges(measurement),
        first_depth_m=_first_depth_m(measurement),
        states_accuracy=measurement.states_accuracy,
        pose_fit=measurement.pose_fit,
        image=content_hash(measurement.snapshot) or "",
        sha256=sha256,
    )


def _first_depth_m(measurement: Measurement) -> float | None:
    """As in `SequenceEntry`: runs with other depth maps have other true positions."""
    depth = measurement.sequence.depth(0) if measurement.truth == TruthKind.birth else None
    return None if depth is None or not depth.valid.any() else float(np.median(depth.depth_m[depth.valid]))


def _z_depth_from(sequence: Sequence, truth: str) -> str | None:
    """What depths along z were computed from; None where their kind is only stated, or there are none."""
    if truth == SWEPT:
        return "images of other frames"
    return z_depth_from(sequence) if truth in list(TruthKind) else None


def _notes(sequence: Sequence, n_frames: int, truth: str, measured: tuple[str, ...]) -> tuple[str, ...]:
    """What is to be known of a sequence, of its first frames, and of what was measured."""
    return (
        *sequence.notes,
        *pose_notes(sequence.world_from_camera[:n_frames]),
        *shutter_notes(sequence, n_frames),
        *((SELF_REFERENTIAL,) if truth == TRIANGULATED else ()),
        *((DEPTH_FROM_IMAGES,) if truth == SWEPT else ()),
        *measured,
    )


def _repeated(
    batch: list[Task], sequences: Items[Sequence], progress: Progress | None
) -> list[dict[str, pl.DataFrame]]:
    """Tables of `SEED_TABLES` of each sequence, measured with every random seed but the first. Empty if it is one."""
    tables_of_sequences: list[dict[str, list[pl.DataFrame]]] = [{} for _ in batch]
    for repeat in range(1, batch[0].experiment.seeds):
        seed = pl.lit(repeat, dtype=pl.Int32).alias("seed")
        for tables, again in zip(
            tables_of_sequences, _measure(batch[0], sequences, progress, repeat=repeat), strict=True
        ):
            measured = {"moments": again.moments, "ends": count_ends(again.tracks), "frames": again.frames}
            for name, table in measured.items():
                tables.setdefault(f"seed_{name}", []).append(table.select(seed, pl.all()))
    return [{name: pl.concat(parts) for name, parts in tables.items()} for tables in tables_of_sequences]


def _measure(
    task: Task,
    sequences: Items[Sequence],
    progress: Progress | None,
    *,
    repeat: int = 0,
    second: Items[Sequence] = (),
) -> Iterator[Measurement]:
    experiment = task.experiment
    truth = experiment.truth
    return measure_together(
        sequences,
        make_trackers(experiment, repeat=repeat),
        speeds=task.speeds,
        truth=truth.kind,
        scan_rule=ScanRule(truth.scan_radius_px, truth.scan_anchoring),
        accuracy=truth.accuracy.rule(),
        population=truth.population,
        trim_percentile=experiment.statistics.trim_percentile,
        trim_among=experiment.statistics.trim_among,
        second_truth=second,
        seed=experiment.seed,
        progress=progress,
        kept_bytes=KEPT_BYTES if _has_patches(experiment, sequences) and not repeat else 0,
    )


def _has_patches(experiment: Experiment, sequences: Items[Sequence]) -> bool:
    """Whether patches of tracks are kept: not of sequences that are read together, whose images are costly to keep."""
    return experiment.keep == "observations" and len(sequences) == 1


def tables_to_keep(experiment: Experiment, measurement: Measurement) -> dict[str, pl.DataFrame]:
    """The tables of a sequence by name, those of single observations and tracks only if the experiment keeps them."""
    observed = {"observations": measurement.observations, "tracks": measurement.tracks}
    slowest = min(experiment.speeds)  # which figures show
    statistics = statistics_of(
        measurement.prepared,
        [name for name in STATISTICS if name not in ("moments", "covariance_sums")],  # the latter with the geometry
        population=experiment.truth.population,
        slowest=slowest,
    )
    release_memory()
    prepared = replace(measurement.prepared, slowest=slowest)
    return {
        **(observed if experiment.keep == "observations" else {}),
        "frames": measurement.frames,
        "moments": measurement.moments,
        "trims": measurement.trims,
        "pose_differences": measurement.pose_differences,
        "floors": measurement.floors,
        **statistics,
        **geometry_tables(experiment, measurement.sequence, prepared, measurement.n_frames, measurement.truth),
        **kind_tables(measurement.sequence, prepared, experiment.truth.population),
        **({"point_tracking": tap_metrics(measurement)} if experiment.statistics.tap_vid else {}),
    }


def following(task: Task, tell: Callable[[str, int, int, int], None]) -> Progress:
    """Progress within a task, reported with its key: frames done, of all of the sequence, from which frame on."""
    first = 0 if task.frames is None else task.frames.start
    total = sum(len(frames) for frames in task.parts)
    return lambda done, of_part: tell(task.key, done, total or of_part, first)


@dataclass(frozen=True, slots=True)
class Job:
    """What every worker needs besides its batch."""

    run: RunFolder  # the run folder
    claim: Claim  # proof that the run still holds the lock of the folder
    versions: dict[str, str]  # versions at the start of the run of the libraries that affect results
    debug: bool  # raise failures instead of recording them
    one_thread: bool = True  # use one thread in OpenCV, because other workers use the other cores
    verify: bool = False  # see `attempt`

    def __call__(self, batch: Batch) -> Result:
        """Measure a batch in a worker."""
        if self.one_thread or batch[0].parts:
            use_one_opencv_thread()
        require_versions(self.versions, place=f"worker on {socket.gethostname()}")
        self.claim.check()
        progress = following(batch[0], notify)
        return attempt(batch, self.run, claim=self.claim, progress=progress, debug=self.debug, verify=self.verify)


@one_blas_thread()
def write_measurement(folder: RunFolder, experiment: Experiment, measurement: Measurement) -> SequenceEntry:
    """Write the tables of one sequence, and return its entry for the manifest.

    Parameters
    ----------
    folder
        The run folder, which need not exist yet.
    experiment
        Its population, speeds and `keep` are used.
    measurement
        What was measured.
    """
    entry = _seen_in_images(sequence_entry(measurement, sha256={}), measurement, experiment)
    tables = tables_to_keep(experiment, measurement)
    hashes = folder.write_sequence(entry.key, tables, encode_png(measurement.snapshot))
    return replace(entry, sha256=hashes)


def write_settings(folder: RunFolder, experiment: Experiment, entries: Iterable[SequenceEntry]) -> None:
    """Write the manifest and the settings of a run whose sequences have been written.

    Parameters
    ----------
    folder
        The run folder.
    experiment
        Whose run it is.
    entries
        What `write_measurement` returned, at least one.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    manifest = new_manifest(experiment)
    manifest.sequences.update({entry.key: entry for entry in entries})
    folder.create(experiment.to_toml(), manifest)
