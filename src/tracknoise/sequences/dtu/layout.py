"""Names of files and folders in both releases of the data set."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from tracknoise.exceptions import DataError
from tracknoise.sequences.dtu.relighting import LIGHTINGS
from tracknoise.sequences.scenes import find_scenes

CALIBRATION = "Calib_Results_11.mat"
SCANS = "CleanRecon_2009_11_16"
LEDS = "leds.csv"

POSITIONS = range(1, 50)
"""Numbers of the camera positions of arc 1."""
KEY_POSITION = 25
"""From where the scan was made."""

_FOLDERS_ABOVE = 2


@dataclass(frozen=True, slots=True)
class Release:
    """How one of the two releases names its images.

    Parameters
    ----------
    image
        Format of a file's name, without extension, from ``position`` and ``number``.
    pattern
        Matches a file's name; its groups are position and number.
    numbers
        Numbers of the files of each position that are needed.
    lightings
        For images that are relit already, the number of each lighting's file; empty where they are those of the LEDs.
    """

    image: str
    pattern: re.Pattern[str]
    numbers: range
    lightings: Mapping[str, int]

    @property
    def names(self) -> tuple[str, ...]:
        """The lightings that there are."""
        return tuple(self.lightings) or LIGHTINGS


FULL = Release(
    image="Img{position:03d}_{number:02d}",
    pattern=re.compile(r"Img(\d{3})_(\d{2})\.(?:bmp|png)"),
    numbers=range(19),
    lightings=MappingProxyType({}),
)
"""An image for each LED, numbered from 0."""
CONDENSED = Release(
    image="{position:03d}_{number:02d}",
    pattern=re.compile(r"(\d{3})_(\d{2})\.(?:bmp|png)"),
    numbers=range(36),
    lightings=MappingProxyType(
        {"diffuse": 0, **{f"LR{k}": 20 + k for k in range(9)}, **{f"BF{k}": 29 + k for k in range(7)}}
    ),
)
"""Diffuse light first, then an image for each LED, then those from left to right and from back to front."""


def dtu_scenes(root: Path) -> dict[str, Path]:
    """Folder of each scene, by its path below the root, sorted.

    Raises
    ------
    DataError
        If there is none.
    """
    return find_scenes(
        root,
        lambda _, files: _release(files) is not None,
        expected="folders such as SET001 with Img001_00.bmp (or .png), or scene001 with 001_00.png",
    )


def release_of(folder: Path) -> Release:
    """The release that a scene's folder belongs to, by the names of its files."""
    release = _release([path.name for path in folder.iterdir()])
    assert release is not None, "only a folder with images is a scene"
    return release


def image_files(folder: Path, release: Release) -> dict[tuple[int, int], Path]:
    """The images of arc 1 that a scene needs, by position and number.

    Raises
    ------
    DataError
        Naming the first that is missing, or that is there in two formats.
    """
    found: dict[tuple[int, int], Path] = {}
    for path in sorted(folder.iterdir()):
        if match := release.pattern.fullmatch(path.name):
            key = int(match[1]), int(match[2])
            if key in found:
                raise DataError(path, f"the number of {found[key].name} again", "one file for each image")
            found[key] = path
    needed = [(position, number) for position in POSITIONS for number in release.numbers]
    for position, number in needed:
        if (position, number) not in found:
            name = release.image.format(position=position, number=number)
            suffix = next(iter(found.values())).suffix
            expected = f"{len(release.numbers)} images (numbers {release.numbers[0]:02d} to {release.numbers[-1]:02d})"
            expected += f" of each of positions {POSITIONS[0]} to {POSITIONS[-1]}"
            raise DataError(folder / f"{name}{suffix}", "missing image", expected)
    return {key: found[key] for key in needed}


def scan_name(scene: Path) -> str:
    """Name of the file with a scene's scan, from the number at the end of the name of the scene's folder.

    Raises
    ------
    DataError
        If there is no number.
    """
    match = re.search(r"(\d+)$", scene.resolve().name)
    if match is None:
        raise DataError(scene, "a folder without a number", "one such as SET001, whose number is that of its scan")
    return f"Clean_Reconstruction_{int(match[1]):02d}.mat"


def find_beside(root: Path, name: str) -> Path:
    """Find what belongs to all scenes: in the data set's folder or one within it, or up to two folders above.

    Raises
    ------
    DataError
        If it is in none of them.
    """
    above = root.resolve().parents[:_FOLDERS_ABOVE]
    within = sorted(path for path in root.iterdir() if path.is_dir())
    for folder in (root, *within, *above):
        if (folder / name).exists():
            return folder / name
    raise DataError(root / name, "no such file or folder", "it here, in a folder within, or up to two folders above")


def _release(files: list[str]) -> Release | None:
    for release in (FULL, CONDENSED):
        if any(release.pattern.fullmatch(name) for name in files):
            return release
    return None
