"""Long recordings are measured in parts, each like a sequence of its own, and their tables are joined.

The memory of a worker depends on the length of a part, all cores measure one recording, and a crash loses the parts
that were being measured. Tracks end at the end of a part, as at the end of a sequence: their lifetimes are censored
there. The parts depend on the settings and the recording only, never on workers. They are blocks of one scene
(`tracknoise.statistics.joining`), not scenes.

Until a recording is complete, its parts are in the folder ``parts`` of the run, each as a run folder of its own.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.exceptions import StoreError
from tracknoise.experiments.inputs import InputCheck
from tracknoise.experiments.plan import Task, make_trackers
from tracknoise.experiments.resume import new_manifest
from tracknoise.experiments.settings import EstimatorSettings, Experiment, FindingsSettings
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.sequences.sequence import TruthKind
from tracknoise.statistics.joining import OF_THE_WHOLE, Part, join, place
from tracknoise.tables.enumerations import InputKind
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.schema import INPUTS, layout_of
from tracknoise.tables.store import OBSERVED, RunFolder, schema_of
from tracknoise.text import counted
from tracknoise.trackers.tracker import begins_anywhere, needs_frames_only
from tracknoise.words import listing

_USUAL = 640 * 480
BUDGET = 500 * _USUAL
"""Pixels that all trackers process in a part at all speeds, unless the experiment says how long parts are.

Memory depends on features. Small images have nearly as many as those of 640x480, and count as these.
"""
_LONGEST = 1.2
"""Length of a part, relative to what is wanted, at most."""
SHORTEST = 120
"""Frames of a part, at least, unless the experiment says how long parts are."""


def parts_of(task: Task, sequence: Recording) -> tuple[range, ...]:
    """Frames of the parts in which a sequence is measured; none if it is measured in one piece.

    Sequences that are read together are measured in one piece, and so are those whose true positions are fixed in one
    key frame, and those of trackers that need the whole sequence.
    """
    return () if _of_the_whole(task) else _possible_parts(task, sequence)


def one_piece_notes(task: Task, sequence: Recording) -> tuple[str, ...]:
    """Which trackers alone keep a sequence in one piece, a sentence; none where none does."""
    names = _of_the_whole(task)
    if not names or not _possible_parts(task, sequence):
        return ()
    need = "need" if len(names) > 1 else "needs"
    return (f"measured in one piece, all frames: {listing(names)} {need} the whole sequence",)


def _of_the_whole(task: Task) -> list[str]:
    """Trackers that need the whole sequence."""
    trackers = make_trackers(task.experiment).items()
    return [name for name, tracker in trackers if not (needs_frames_only(tracker) or begins_anywhere(tracker))]


def _possible_parts(task: Task, sequence: Recording) -> tuple[range, ...]:
    """The parts, whatever the trackers need."""
    of_one_frame = (task.experiment.truth.kind or next(iter(sequence.truths), None)) == TruthKind.scan
    if task.shares or of_one_frame:
        return ()
    pixels = sequence.camera.width * sequence.camera.height
    return ranges_of(len(sequence), task.experiment, task.speeds, pixels=pixels)


def ranges_of(n_frames: int, experiment: Experiment, speeds: Sequence[int], *, pixels: int) -> tuple[range, ...]:
    """Frames of the parts of a sequence of so many frames with so many pixels; none if it is one piece.

    Parts begin with a frame that trackers of all speeds see, where a part is long enough for that. Each has more frames
    than the largest speed. Their number is even, unless the experiment says how long they are, or they would be short.
    """
    per_frame = len(experiment.trackers) * sum(1 / speed for speed in speeds) * max(pixels, _USUAL)
    wanted = max(experiment.part_frames or max(SHORTEST, int(BUDGET / per_frame)), 2 * max(speeds) + 2)
    together = math.lcm(*speeds)
    step = together if 2 * together <= wanted else 1
    if experiment.clips is not None and experiment.clips * wanted < n_frames:
        return _clips(n_frames, experiment.clips, length=wanted // step * step, step=step)
    count = max(round(n_frames / wanted), math.ceil(n_frames / (_LONGEST * wanted)))
    if experiment.part_frames is None and count > 1 and n_frames >= (count + count % 2) * SHORTEST:
        count += count % 2  # of three parts, one of two cores would measure two
    starts = [round(number * n_frames / count / step) * step for number in range(count)]
    ranges = tuple(range(*ends) for ends in zip(starts, [*starts[1:], n_frames], strict=True))
    return ranges if count > 1 and min(map(len, ranges)) > max(speeds) else ()


def _clips(n_frames: int, count: int, *, length: int, step: int) -> tuple[range, ...]:
    """Frames of clips, with equal gaps before, between and after them. `length`: a multiple of `step`."""
    gap = (n_frames - count * length) / (count + 1)
    starts = [int((gap + number * (gap + length)) / step) * step for number in range(count)]
    return tuple(range(start, start + length) for start in starts)


def folder_of(task: Task, run: RunFolder) -> RunFolder:
    """Where the tables of a task are written: those of a part in a folder of its own."""
    return run if task.part is None else run.part(task.key, task.part)


def measured_before(task: Task, run: RunFolder, *, verify: bool = False) -> SequenceEntry | None:
    """Entry of a part that an earlier start measured with the same versions, settings and files, if it is intact."""
    folder = folder_of(task, run)
    try:
        if not folder.exists:
            return None
        manifest, now = folder.manifest(), manifest_of_part(task)
    except StoreError:
        return None
    entry = manifest.sequences.get(task.key)
    is_same = (manifest.settings_hash, manifest.versions) == (now.settings_hash, now.versions)
    if entry is None or not is_same or not folder.has_sequence(entry):
        return None
    return entry if InputCheck(folder, verify=verify).change(task, entry) is None else None


def manifest_of_part(task: Task) -> Manifest:
    """Begin the manifest of a part, with a hash of its frames and of the settings that its tables depend on."""
    alike = task.experiment.with_groups(None).with_scenes(None)
    alike = alike.model_copy(update={"findings": FindingsSettings(), "estimator": EstimatorSettings()})
    manifest = new_manifest(task.experiment)
    manifest.settings_hash = f"{alike.digest()} {task.frames}"
    return manifest


@dataclass(frozen=True, slots=True)
class MeasuredPart:
    """A part of a sequence that was measured."""

    part: Part  # where it belongs
    folder: RunFolder  # where its tables are
    entry: SequenceEntry  # its entry


def measured_parts(task: Task, run: RunFolder) -> list[MeasuredPart]:
    """All parts of a sequence that show anything, in their order."""
    tracks: dict[tuple[str, int], int] = {}
    measured = []
    for number, frames in enumerate(task.parts):
        folder = run.part(task.key, number)
        entry = folder.manifest().sequences[task.key]
        if not entry.sha256:  # nothing could be measured there
            continue
        part = Part(number, len(task.parts), frames.start, dict(tracks))
        measured.append(MeasuredPart(part, folder, entry))
        for tracker, speed, count in (
            folder.sequence_table("trims", task.key).select("tracker", "speed", "n_tracks").rows()
        ):
            tracks[tracker, speed] = tracks.get((tracker, speed), 0) + count
    return measured


def joined_tables(task: Task, parts: Sequence[MeasuredPart]) -> Iterator[tuple[str, pl.DataFrame | pl.LazyFrame]]:
    """Tables of a sequence from those of its parts; those of single observations are read when they are written."""
    names = dict.fromkeys(name for measured in parts for name in measured.folder.names_of_tables(task.key))
    for name in names:
        if name in OF_THE_WHOLE:
            continue
        having = [measured for measured in parts if name in measured.entry.sha256]
        if name in OBSERVED:
            yield name, _observed(name, task.key, having)
        else:
            tables = ((measured.part, measured.folder.sequence_table(name, task.key)) for measured in having)
            yield name, join(name, tables, schema_of(name))


def _observed(name: str, key: str, parts: Sequence[MeasuredPart]) -> pl.LazyFrame:
    """Rows of each tracker and speed, part after part."""
    conditions = dict.fromkeys(condition for measured in parts for condition in _conditions(measured, key))
    scanned = [(measured.part, measured.folder.scan(name, key)) for measured in parts]
    rows = [
        place(table.filter(tracker=tracker, speed=speed), part, name)
        for tracker, speed in conditions
        for part, table in scanned
    ]
    together = pl.concat(rows, how="diagonal")
    return together.select(list(layout_of(schema_of(name), together.collect_schema().names())))


def _conditions(measured: MeasuredPart, key: str) -> list[tuple[str, int]]:
    table = measured.folder.sequence_table("frames", key)
    return table.select("tracker", "speed").unique(maintain_order=True).rows()


def joined_inputs(parts: Sequence[RunFolder], key: str) -> pl.DataFrame:
    """What a sequence was measured from: all that its parts were measured from."""
    tables = [table for table in (folder.inputs(key) for folder in parts) if table is not None]
    every = (
        pl.concat(tables)
        .filter(pl.col("kind") != InputKind.frames)
        .unique(["kind", "in_data", "path", "size", "content"], keep="first", maintain_order=True)
    )
    frames = tables[0].filter(pl.col("kind") == InputKind.frames)
    return pl.concat([every, frames]).select(list(INPUTS)).sort("kind", "in_data", "path")


def note_of(task: Task, parts: Sequence[MeasuredPart], n_frames: int) -> str:
    """How a sequence was measured, one sentence."""
    lengths = [len(frames) for frames in task.parts]
    if sum(lengths) < n_frames:
        note = f"measured in {counted(len(lengths), 'clip')} of {max(lengths)} frames, spread over {n_frames} frames"
    else:
        length = f"{min(lengths)} to {max(lengths)}"
        note = f"measured in {len(lengths)} parts of {length} frames; tracks end at the end of a part"
    shown = {measured.part.place for measured in parts}
    empty = [f"{frames[0]} to {frames[-1]}" for place, frames in enumerate(task.parts) if place not in shown]
    return f"{note}; nothing could be measured in frames {', '.join(empty)}" if empty else note
