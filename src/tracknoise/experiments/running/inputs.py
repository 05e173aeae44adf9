"""Files besides the images that a sequence's numbers depend on: a change in them makes a measurement stale."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

from tracknoise.experiments.running.plan import Task
from tracknoise.sequences.registry import path_options


def with_inputs(tasks: list[Task]) -> list[Task]:
    """Fill in `Task.inputs`, as the files are now: those that trackers read, and those that the reader's options name.

    Of files it is the contents that count, of folders (Gazebo models, depth maps) the names and sizes of all files in
    them. Each is looked at once, however many tasks depend on it. A file that changes after this, and before its
    sequence is measured, leaves a measurement that the next start takes to be stale, though it is not.
    """
    once = cache(_digest)
    return [replace(task, inputs=_combined(once(path) for path in _paths(task))) for task in tasks]


def _paths(task: Task) -> list[Path]:
    return [*_track_files(task), *_reader_paths(task)]


def _combined(digests: Iterator[bytes]) -> str:
    """Hexadecimal SHA-256; the same whenever there is no such file."""
    return hashlib.sha256(b"".join(digests)).hexdigest()


def _digest(path: Path) -> bytes:
    digest = hashlib.sha256()
    for part in _parts(path):
        digest.update(part)
    return digest.digest()


def _parts(path: Path) -> Iterator[bytes]:
    if not path.is_dir():
        yield path.read_bytes() if path.is_file() else b"missing"
        return
    for file in sorted(item for item in path.rglob("*") if item.is_file()):
        yield f"{file.relative_to(path)} {file.stat().st_size}\n".encode()


def _reader_paths(task: Task) -> list[Path]:
    dataset = task.experiment.dataset
    values = [dataset.options.get(name) for name in path_options(dataset.reader)]
    return [Path(value) for value in values if isinstance(value, str)]


def _track_files(task: Task) -> list[Path]:
    name = task.sequence
    paths = [choice.path for choice in task.experiment.trackers if choice.path is not None]
    return [
        Path(
            path.format(
                scene=name.scene,
                lighting=name.lighting,
                rotation=name.rotation,
                direction=name.direction,
                speed=speed,
            )
        )
        for path in paths
        for speed in task.speeds
    ]
