"""Where the files of a recording in the ASL layout lie: below ``mav0``, a folder for each sensor."""

import re
from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.scenes import find_scenes

_DEVICE, _DATA, _SENSOR = "mav0", "data.csv", "sensor.yaml"
POSE_SOURCES = ("state_groundtruth_estimate0", "mocap0", "vicon0", "gt")
"""Folders of poses, best first: what others were fused and aligned into is better than a sensor alone."""

_POSITIONS_ONLY = "leica0"
_CAMERA_CHAINS = ("camchain.yaml", "dso/camchain.yaml", "mav0/camchain.yaml")
_PLACES = (r"(MH)_\d", r"(V[12])_\d", r"dataset-([a-z]+)\d")


@dataclass(frozen=True, slots=True)
class Files:
    """The files of one recording.

    Parameters
    ----------
    folder
        Its own folder.
    """

    folder: Path

    @property
    def device(self) -> Path:
        """The folder of all sensors: the recording's, if its sensors lie there."""
        return self.folder / _DEVICE if (self.folder / _DEVICE).exists() else self.folder

    def list_of_images(self, camera: str) -> Path:
        """The list of a camera's images.

        Raises
        ------
        UnknownNameError
            If there is no such camera.
        """
        if not (self.device / camera).exists():
            raise UnknownNameError("camera", camera, self.cameras())
        return self.device / camera / _DATA

    def cameras(self) -> list[str]:
        """Names of all cameras, sorted."""
        return sorted(folder.name for folder in self.device.glob("cam*") if folder.is_dir())

    def image(self, camera: str, name: str) -> Path:
        """An image from its name in the list."""
        return self.device / camera / "data" / name

    def calibration(self, camera: str) -> Path:
        """The file with a camera's intrinsics: its own, or a Kalibr chain of all cameras.

        Raises
        ------
        DataError
            If there is none.
        """
        own = self.device / camera / _SENSOR
        chains = (self.folder / name for name in _CAMERA_CHAINS)
        file = next((path for path in (own, *chains) if path.exists()), None)
        if file is None:
            expected = f"it, {' or '.join(_CAMERA_CHAINS)}, or {with_option('camera_file', 'FILE')}"
            raise DataError(own, "no such file", expected)
        return file

    def pose_source(self, name: str | None) -> str:
        """The folder of the poses: the one of this name, or the best that there is.

        Raises
        ------
        DataError
            If there is none.
        UnknownNameError
            If there is no such folder.
        """
        sources = [source for source in POSE_SOURCES if (self.device / source / _DATA).exists()]
        if name is not None:
            if not (self.device / name / _DATA).exists():
                raise UnknownNameError("pose_source", name, sources)
            return name
        if not sources:
            positions = (self.device / _POSITIONS_ONLY).exists()
            found = f"{_POSITIONS_ONLY} only, which has no rotations" if positions else "no poses"
            raise DataError(self.device, found, f"{', '.join(POSE_SOURCES)}, each with {_DATA}")
        return sources[0]

    def poses(self, source: str) -> Path:
        """The table of poses."""
        return self.device / source / _DATA

    def sensor(self, source: str) -> Path:
        """The file that states where a sensor of poses is on the body; it may be missing."""
        return self.device / source / _SENSOR


def find_recordings(root: Path) -> dict[str, Path]:
    """Find the recordings in or below a folder, by name, sorted.

    Raises
    ------
    DataError
        If there is none.
    """

    def is_recording(below: list[str], _files: list[str]) -> bool:
        return _DEVICE in below or ("cam0" in below and not {*POSE_SOURCES, "imu0"}.isdisjoint(below))

    return find_scenes(root, is_recording, expected=f"folders with {_DEVICE}/, which holds cam0/ and poses")


def place_of(scene: str) -> str | None:
    """The place that recordings of EuRoC and TUM-VI share, from their names; None for others."""
    matches = (re.search(pattern, scene) for pattern in _PLACES)
    return next((match[1] for match in matches if match), None)
