"""Which bags lie below a folder: ROS 1 files, folders of ROS 2 bags, and single files of ROS 2."""

import os
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MIB, is_folder, is_regular_file, require_regular
from tracknoise.sequences.sequence import require_directory

ROS1_SUFFIX = ".bag"
COMPRESSED_SUFFIX = ".zstd"
"""Of files of ROS 2 that are compressed as a whole, after their own."""
_PLAIN_SUFFIXES = (".db3", ".mcap")
_ROS2_SUFFIXES = (*_PLAIN_SUFFIXES, *(suffix + COMPRESSED_SUFFIX for suffix in _PLAIN_SUFFIXES))
_SUFFIXES = (ROS1_SUFFIX, *_ROS2_SUFFIXES)
METADATA = "metadata.yaml"
_BAG = "a ROS 1 bag (.bag) or a ROS 2 bag (.db3, .mcap, these with .zstd, or a folder with metadata.yaml)"
_MOST_BYTES, _MOST_METADATA_BYTES = 1 << 50, 64 * MIB


def find_bags(root: Path) -> dict[str, Path]:
    """Find all bags below a folder. Links are followed; each folder is visited once.

    Parameters
    ----------
    root
        A folder, or a bag.

    Returns
    -------
    dict of str to Path
        File or folder of each bag by its path below the root, with ``/``, sorted; its own name if the root is the bag.

    Raises
    ------
    DataError
        If the root does not exist, or there is no bag.
    """
    if (is_regular_file(root) and root.name.endswith(_SUFFIXES)) or _is_ros2_folder(root):
        return {root.resolve().name: root}
    bags: dict[str, Path] = {}
    visited: set[str] = set()
    for name, below, files in os.walk(require_directory(root), followlinks=True):
        real, folder = os.path.realpath(name), Path(name)
        found = [] if real in visited else _bags_in(folder, files)
        bags |= {path.relative_to(root).as_posix(): path for path in found}
        if real in visited or found == [folder]:
            below.clear()
        visited.add(real)
    if not bags:
        raise DataError(root, "no bag", _BAG)
    return dict(sorted(bags.items()))


def bag_size(path: Path) -> int:
    """Size of all files of a bag, bytes.

    Raises
    ------
    DataError
        If one is missing or is not a regular file.
    """
    if not is_folder(path):
        return require_regular(path, _BAG, most=_MOST_BYTES)
    files = (file for file in path.iterdir() if file.name.endswith(_ROS2_SUFFIXES))
    metadata = require_regular(path / METADATA, "the metadata of a ROS 2 bag", most=_MOST_METADATA_BYTES)
    return metadata + sum(require_regular(file, _BAG, most=_MOST_BYTES) for file in files)


def _bags_in(folder: Path, files: list[str]) -> list[Path]:
    if METADATA in files and _is_ros2_folder(folder):
        return [folder]
    return [folder / name for name in files if name.endswith(_SUFFIXES) and not name.startswith(".")]


def _is_ros2_folder(folder: Path) -> bool:
    """Whether a folder holds metadata of a ROS 2 bag, and not a file of that name from something else."""
    path = folder / METADATA
    if not is_regular_file(path):
        return False
    with path.open("rb") as file:
        return b"rosbag2_bagfile_information" in file.read(4096)
