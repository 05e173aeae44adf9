"""The scenes of a data set in a tree of folders, and how the user gives an option of a reader."""

import os
import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import ClassVar

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.sequence import require_directory
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId


class SceneReader:
    """A `tracknoise.sequences.sequence.Reader` of folders with a scene each, in a data set without lightings."""

    __slots__ = ()

    name: ClassVar[str]

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: see `Reader.sequences`."""
        return [SequenceId(self.name, scene) for scene in self._scenes()]

    def _scenes(self) -> dict[str, Path]:
        """Folder of each scene: see `find_scenes`."""
        raise NotImplementedError

    def _folder(self, sequence: SequenceId) -> Path:
        return scene_folder(self._scenes(), sequence)


def find_scenes(root: Path, is_scene: Callable[[list[str], list[str]], bool], *, expected: str) -> dict[str, Path]:
    """Find the folders that hold a scene. Folders below a scene are not searched.

    Parameters
    ----------
    root
        The data set's folder at any level, or a scene itself. Links are followed; each folder is visited once.
    is_scene
        Whether a folder is a scene, from the names of its subfolders and files.
    expected
        What makes a scene, for the error.

    Returns
    -------
    dict of str to Path
        Folder of each scene by its path below the root, with ``/``, sorted; the root's own name if it is the scene.

    Raises
    ------
    DataError
        If the root is not a folder, or there is no scene.
    """
    scenes: dict[str, Path] = {}
    visited: set[str] = set()
    for name, below, files in os.walk(require_directory(root), followlinks=True):
        real, folder = os.path.realpath(name), Path(name)
        if real not in visited and is_scene(below, files):
            scenes[_scene_name(root, folder)] = folder
            below.clear()
        elif real in visited:
            below.clear()
        visited.add(real)
        below.sort()
    if not scenes:
        raise DataError(root, "no scene", expected)
    return dict(sorted(scenes.items()))


def parent_of(scene: str, *, levels: int = 1) -> str | None:
    """Name of the folder that a scene shares with others, such as a place; None where it is the data set's folder."""
    return "/".join(scene.split("/")[:-levels]) or None


def scene_folder(scenes: Mapping[str, Path], sequence: SequenceId) -> Path:
    """Folder of a sequence, in a data set without lightings."""
    if sequence.scene not in scenes:
        raise UnknownNameError("scene", sequence.scene, scenes)
    if sequence.lighting != DEFAULT_LIGHTING:
        raise UnknownNameError("lighting", sequence.lighting, [DEFAULT_LIGHTING])
    return scenes[sequence.scene]


def numbered_files(folder: Path, pattern: str) -> dict[int, Path]:
    """Files of a folder whose whole name matches a pattern, by the frame number in its first group, sorted."""
    matches = ((re.fullmatch(pattern, path.name), path) for path in require_directory(folder).iterdir())
    files: dict[int, Path] = {}
    for number, path in sorted((int(match[1]), path) for match, path in matches if match):
        if number in files:
            raise DataError(path, f"the number of {files[number].name} again", "one file for each frame")
        files[number] = path
    return files


def any_numbered_files(folder: Path, pattern: str) -> dict[int, Path]:
    """As `numbered_files`; none where there is no folder."""
    return numbered_files(folder, pattern) if folder.exists() else {}


def require_unbroken(images: Collection[int], others: Collection[int], path_of: Callable[[int], Path]) -> range:
    """Check that every frame from the first to the last has an image. A gap would silently change the speed."""
    if not images:
        folder = path_of(0).parent
        raise DataError(folder, f"no images{_instead(folder)}", f"files such as {path_of(0).name}")
    numbers = {*images, *others}
    frames = range(min(numbers), max(numbers) + 1)
    for number in frames:
        if number not in images:
            raise DataError(path_of(number), "missing image", f"images {frames[0]} to {frames[-1]} without a gap")
    return frames


def _instead(folder: Path) -> str:
    """What a folder holds instead of images, such as files whose endings are in capitals."""
    names = sorted(path.name for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []
    return f", but files such as {names[0]}" if names else ""


def _scene_name(root: Path, folder: Path) -> str:
    return root.resolve().name if folder == root else folder.relative_to(root).as_posix()


def with_option(name: str, value: str) -> str:
    """``--option image_topic=/cam0, or image_topic in [dataset.options]``: on the command line, or in an experiment."""
    return f"--option {name}={value}, or {name} in [dataset.options]"
