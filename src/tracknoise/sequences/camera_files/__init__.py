"""Cameras from the files of calibration programs: see docs/formats/cameras.md."""

from tracknoise.sequences.camera_files.camera_file import CameraFile
from tracknoise.sequences.camera_files.read import read_camera_file
from tracknoise.sequences.camera_files.yaml_file import read_yaml

__all__ = ["CameraFile", "read_camera_file", "read_yaml"]
