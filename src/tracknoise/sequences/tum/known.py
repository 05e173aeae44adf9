"""Published facts of recordings in this format: cameras, places, and what their poses are poses of.

TUM RGB-D: the benchmark's page on file formats, cameras of ROS calibrations; freiburg3 is published undistorted.
ICL-NUIM: the data set's page; its images come from a renderer whose y axis points up, so fy is negative.
Bonn RGB-D dynamic: the data set's page; its poses are those of markers on the camera, in another convention of axes.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.pose import nearest_rigid


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """Recordings with one camera.

    Parameters
    ----------
    name
        Of the recordings, for notes.
    pattern
        Found in the names of their folders.
    place
        What all of them show; None where they show several places.
    camera
        Published intrinsics.
    upside_down
        Whether the published fy is negative: the y axes of camera and world point up.
    body_from_camera
        (4, 4) float64: from the camera to what the poses are poses of; None where that is the camera.
    """

    name: str
    pattern: str
    place: str | None
    camera: Camera
    upside_down: bool = False
    body_from_camera: NDArray[np.float64] | None = None


def _bonn_body_from_camera() -> NDArray[np.float64]:
    """Published as T_ros T_m after the pose; the rotation of T_m has a scale of 1.06, which is left out."""
    axes = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    marker = [
        [1.0157, 0.1828, -0.2389, 0.0113],
        [0.0009, -0.8431, -0.6413, -0.0098],
        [-0.3009, 0.6147, -0.8085, 0.0111],
        [0.0, 0.0, 0.0, 1.0],
    ]
    rigid, _ = nearest_rigid(np.array([marker]))
    body_from_camera: NDArray[np.float64] = axes @ rigid[0]
    return body_from_camera


_ICL_NUIM = Camera(640, 480, 481.2, 480.0, 319.5, 239.5)
RECORDINGS = (
    Recording(
        name="freiburg1",
        pattern=r"freiburg1|(?<![a-z])fr1(?![0-9])",
        place="freiburg1",
        camera=Camera(640, 480, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    ),
    Recording(
        name="freiburg2",
        pattern=r"freiburg2|(?<![a-z])fr2(?![0-9])",
        place="freiburg2",
        camera=Camera(640, 480, 520.9, 521.0, 325.1, 249.7, (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    ),
    Recording(
        name="freiburg3",
        pattern=r"freiburg3|(?<![a-z])fr3(?![0-9])",
        place="freiburg3",
        camera=Camera(640, 480, 535.4, 539.2, 320.1, 247.6),
    ),
    Recording(
        name="ICL-NUIM",
        pattern=r"living_?room_?traj",
        place="living_room",
        camera=_ICL_NUIM,
        upside_down=True,
    ),
    Recording(
        name="ICL-NUIM",
        pattern=r"office_?room_?traj|^traj[0-9]n?_frei_png",
        place="office_room",
        camera=_ICL_NUIM,
        upside_down=True,
    ),
    Recording(name="ICL-NUIM", pattern=r"icl[-_ ]?nuim", place=None, camera=_ICL_NUIM, upside_down=True),
    Recording(
        name="Bonn",
        pattern=r"rgbd_bonn",
        place="bonn",
        camera=Camera(
            640, 480, 542.822841, 542.57687, 315.59352, 237.756098, (0.039903, -0.099343, -0.00073, -0.000144, 0.0)
        ),
        body_from_camera=_bonn_body_from_camera(),
    ),
)


def find_recording(names: list[str]) -> Recording | None:
    """The known recording that a folder's name fits; None if it fits none.

    Parameters
    ----------
    names
        Of the folder and of those above, nearest first.
    """
    pairs = ((name, recording) for name in names for recording in RECORDINGS)
    return next((recording for name, recording in pairs if re.search(recording.pattern, name.lower())), None)
