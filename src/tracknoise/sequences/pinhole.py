"""The camera of a sequence, for formats that can hold only one, and for those that can hold only a pinhole camera."""

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.sequences.sequence import Sequence, camera_at


def pinhole_of(sequence: Sequence) -> Camera:
    """The pinhole camera of all frames.

    Raises
    ------
    DataError
        If the camera is of another model, or changes from frame to frame.
    """
    camera = sequence.camera
    if not isinstance(camera, Camera):
        raise DataError(sequence.source, f"a camera of the model {type(camera).__name__}", "a pinhole camera")
    only_camera(sequence)
    return camera


def only_camera(sequence: Sequence) -> CameraModel:
    """The camera of all frames.

    Raises
    ------
    DataError
        If it changes from frame to frame.
    """
    camera = sequence.camera
    if any(camera_at(sequence, index) != camera for index in range(len(sequence))):
        raise DataError(sequence.source, "a camera that changes from frame to frame", "one camera for all frames")
    return camera
