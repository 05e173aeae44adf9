"""Files besides the images that a sequence's numbers depend on: a change in them makes a measurement stale."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

from tracknoise.experiments.option_paths import option_paths
from tracknoise.experiments.running.plan import Task


def with_inputs(tasks: list[Task]) -> list[Task]:
    """Fill in `Task.inputs` from the files that the options of the reader and the trackers name, as they are now.

    Of a file the contents are hashed. Of a folder (Gazebo models, depth maps) the names and sizes of all files in it
    are hashed. Each is read once, however many tasks depend on it. If a file changes after this and before its sequence
    is measured, the next start measures the sequence again, although it is up to date.
    """
    once = cache(_digest)
    return [replace(task, inputs=_combined(once(path) for path in _paths(task))) for task in tasks]


def _paths(task: Task) -> Iterator[Path]:
    """What the options of the reader and the trackers name; of a template, the file of each speed."""
    for path in option_paths(task.experiment):
        if isinstance(path, Path):
            yield path
        else:
            yield from (task.sequence.expand(path, speed=speed) for speed in task.speeds)


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
        yield f"{file.relative_to(path)} {file.stat().st_size}\n".encode(errors="surrogateescape")
