"""Recognise the format of a data set from the names of its files and folders."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_folder, is_regular_file
from tracknoise.sequences.reader_registry import READERS

_ANY_IMAGE = r".*\.(?:png|jpe?g|bmp)"
_MOST_ENTRIES, _MOST_LEVELS = 20_000, 6


@dataclass(frozen=True, slots=True)
class Signature:
    """Names by which the files of a reader are known."""

    reader: str  # its name
    # Regular expression that a whole path below the data set's folder matches, this folder's name included. Folders end
    # with a slash.
    pattern: str
    layout: str  # what the pattern means, for people
    names: frozenset[str]  # further files and folders of the layout, to find the nearest format where none fits


def _signature(reader: str, pattern: str, layout: str, names: str) -> Signature:
    return Signature(reader, rf"(?:.*/)?(?:{pattern})", layout, frozenset(names.split()))


SIGNATURES = (
    _signature("rosbag", r"[^/]+\.(?:bag|(?:db3|mcap)(?:\.zstd)?)", "a .bag, .db3 or .mcap file", "metadata.yaml"),
    _signature("euroc", r"mav0/|cam0/data\.csv", "mav0/cam0/data.csv", "mav0 cam0 sensor.yaml imu0 body.yaml data.csv"),
    _signature("nerfstudio", r"transforms(?:_train)?\.json", "transforms.json", "transforms_train.json images"),
    _signature(
        "colmap", r"(?:cameras|images)\.(?:bin|txt)", "cameras.bin or cameras.txt", "points3D.bin points3D.txt sparse"
    ),
    _signature(
        "tum",
        r"(?:rgb\.txt|groundtruth\.txt|associat(?:ions?|ed)\.txt|[^/]+\.gt\.freiburg)",
        "rgb.txt and groundtruth.txt",
        "rgb depth depth.txt accelerometer.txt",
    ),
    _signature(
        "sevenscenes",
        r"frame-\d+\.(?:pose\.txt|color\.(?:png|jpg))",
        "frame-NNNNNN.color.png and frame-NNNNNN.pose.txt",
        "camera-intrinsics.txt",
    ),
    _signature(
        "tartanair",
        r"pose_(?:left|right|[lr]cam_[a-z]+)\.txt",
        "image_left/ and pose_left.txt",
        "image_left depth_left image_lcam_front depth_lcam_front flow",
    ),
    _signature(
        "kitti-odometry",
        r"(?:sequences/\d\d/calib\.txt|image_[0-3]/)",
        "sequences/NN/ and poses/NN.txt",
        "poses times.txt",
    ),
    _signature(
        "kitti",
        r"(?:calib_cam_to_cam\.txt|image_0[0-3]/data/|oxts/)",
        "image_02/data/ and calib_cam_to_cam.txt",
        "velodyne_points proj_depth image_02",
    ),
    _signature(
        "dtu",
        r"(?:Img|scene\d+/)\d{3}_\d{2}\.(?:bmp|png)|Calib_Results_11\.mat",
        "SETnnn/Img025_07.bmp",
        "CleanRecon_2009_11_16",
    ),
    _signature(
        "folder", r"(?:poses\.txt|camera\.json)", "images/, camera.json and poses.txt", "images depth poses.csv"
    ),
)
"""The most telling names come first."""


def recognise(path: Path, *, images_alone: bool = False) -> str:
    """Name of the reader whose layout a data set has.

    Parameters
    ----------
    path
        Folder of the data set, or a file such as a bag.
    images_alone
        Whether a folder of images in no known layout is one of the reader ``folder``.

    Raises
    ------
    DataError
        If there is nothing there, or no reader knows the layout. The message names the nearest format.
    """
    if not is_folder(path) and not is_regular_file(path):
        raise DataError(path, "no such file or folder", "a recording")
    names = list(_names(path))
    readers = set(READERS.names())
    for signature in SIGNATURES:
        if signature.reader in readers and any(re.fullmatch(signature.pattern, name) for name in names):
            return signature.reader
    if images_alone and any(re.fullmatch(_ANY_IMAGE, name, re.IGNORECASE) for name in names):
        return "folder"
    raise DataError(path, *_unknown(names, readers))


def _unknown(names: list[str], readers: set[str]) -> tuple[str, str]:
    """What was found and expected where no layout fits."""
    offered = [signature for signature in SIGNATURES if signature.reader in readers]
    parts = {part for name in names for part in name.strip("/").split("/")}
    nearest = max(offered, key=lambda signature: len(signature.names & parts))
    layouts = "; ".join(f"{signature.reader} ({signature.layout})" for signature in offered)
    examples = ", ".join(name.split("/", 1)[-1] for name in names[1:5]) or "nothing"
    hint = f"the nearest format is {nearest.reader}. " if nearest.names & parts else ""
    return (
        f"no known layout ({examples})",
        f"one of: {layouts}; {hint.rstrip('. ') + '; ' if hint else ''}"
        "other recordings can be put into the layout of reader folder (docs/data.md)",
    )


def _names(path: Path) -> Iterator[str]:
    """Paths of files and folders from the data set's own name on, with slashes; folders first, up to a limit."""
    root_name = path.resolve().name
    if not is_folder(path):
        yield root_name
        return
    yield f"{root_name}/"
    left = _MOST_ENTRIES
    for name, folders, files in os.walk(path):
        below = Path(name).relative_to(path)
        entries = [*(f"{folder}/" for folder in sorted(folders)), *sorted(files)]
        yield from (f"{root_name}/{(below / entry).as_posix()}{'/' * entry.endswith('/')}" for entry in entries[:left])
        left -= len(entries)
        if left <= 0:
            return
        if len(below.parts) >= _MOST_LEVELS:
            folders.clear()
