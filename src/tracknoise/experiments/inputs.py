"""Files besides the images that a sequence's numbers depend on: a change in them makes a measurement stale."""

import hashlib
from pathlib import Path

from tracknoise.experiments.plan import Task


def inputs_digest(task: Task) -> str:
    """Hash of the contents of all files that trackers read for a sequence: those that an option `path` names.

    Returns
    -------
    str
        Hexadecimal SHA-256; the same whenever there is no such file.
    """
    digest = hashlib.sha256()
    for path in _track_files(task):
        digest.update(path.read_bytes() if path.is_file() else b"missing")
    return digest.hexdigest()


def _track_files(task: Task) -> list[Path]:
    name = task.sequence
    paths = [choice.path for choice in task.experiment.trackers if choice.path is not None]
    return [
        Path(
            path.format(
                scene=name.scene, lighting=name.lighting, rotation=name.rotation, direction=name.direction, speed=speed
            )
        )
        for path in paths
        for speed in task.speeds
    ]
