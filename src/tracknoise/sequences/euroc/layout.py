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
_CHAIN_FOLDERS = (".", "dso", "mav0")
_CAMERA_CHAIN, _ANY_CHAIN, _CHAIN_WITH_IMU = "camchain.yaml", "*camchain*.yaml", "camchain-imucam"
"""Kalibr writes ``camchain-NAME.yaml`` or ``NAME-camchain.yaml``, and ``camchain-imucam`` where the body is known."""
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
        return self.device / camera / "data" / name.removeprefix("data/")

    def calibration(self, camera: str) -> Path:
        """The file with a camera's intrinsics: its own, or a Kalibr chain of all cameras.

        Raises
        ------
        DataError
            If there is none.
        """
        own = self.device / camera / _SENSOR
        return own if own.exists() else self._camera_chain(own)

    def _camera_chain(self, missing: Path) -> Path:
        """Kalibr's file: in the first folder that has one; those with the place of the cameras on the body first."""
        named = with_option("camera_file", "FILE")
        for folder in (self.folder / name for name in _CHAIN_FOLDERS):
            if (folder / _CAMERA_CHAIN).exists():
                return folder / _CAMERA_CHAIN
            found = sorted(folder.glob(_ANY_CHAIN))
            best = [path for path in found if _CHAIN_WITH_IMU in path.name] or found
            if len(best) > 1:
                raise DataError(folder, f"several files: {', '.join(path.name for path in best)}", f"one, or {named}")
            if best:
                return best[0]
        raise DataError(missing, "no such file", f"it, {_CAMERA_CHAIN} in the recording, dso or mav0, or {named}")

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
