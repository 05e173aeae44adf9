"""Poses from the images of a sequence alone: structure from motion with COLMAP (package pycolmap, extra ``sfm``).

Intrinsics are fixed. Images of a path are matched with their successors, near and far. Bounds on errors are smaller
than COLMAP's, which are meant for photographs of several thousand pixels: pairs of video frames with a small baseline
have wrong solutions within them. Pairs that lie along the viewing direction may begin a reconstruction, and points of
little parallax count, because successive frames have little.
"""

import math
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera, CameraModel, EquidistantCamera, FovCamera
from tracknoise.geometry.pose import invert, position_rows
from tracknoise.sequences.colmap import CORNER_PX
from tracknoise.sequences.poses import no_poses
from tracknoise.sequences.sequence import Sequence, clock_start_of, times_of
from tracknoise.sequences.writing import only_camera
from tracknoise.text import counted

_MOST_FEATURES = 2000
_SEED = 0
_WIDE_PX = 640
"""Up to this width, errors are bounded by the following; of larger images in proportion."""
_MATCH_PX, _POINT_PX, _POSE_PX = 1.5, 2.0, 4.0
_MOST_PX = 4.0
_LEAST_PARALLAX_DEG, _BEGINNING_PARALLAX_DEG = 0.25, 4.0
_FEWEST_REGISTERED = 2


def require_colmap() -> ModuleType:
    """The package pycolmap.

    Raises
    ------
    SettingsError
        If it is not installed: the message says what to install.
    """
    try:
        import pycolmap
    except ImportError as error:
        found = "poses from images alone need pycolmap, which is not installed"
        raise SettingsError(f"{found}: pip install 'tracknoise[sfm]', or give poses: --trajectory FILE") from error
    return pycolmap


def reconstruct(sequence: Sequence, *, say: Callable[[str], None] = lambda _: None) -> NDArray[np.float64]:
    """Reconstruct the poses of a sequence from its images. The unit of length is arbitrary.

    Parameters
    ----------
    sequence
        Its poses are not used.
    say
        Called with a line before each step.

    Returns
    -------
    (n, 4, 4) float64
        world_from_camera of the largest connected part; NaN for frames that it does not contain.

    Raises
    ------
    SettingsError
        If pycolmap is not installed.
    DataError
        If the camera changes or COLMAP does not know its model, or no two frames could be connected.
    """
    colmap = require_colmap()
    model, parameters = _camera(only_camera(sequence), sequence.source)
    colmap.logging.minloglevel = colmap.logging.FATAL
    colmap.set_random_seed(_SEED)
    with tempfile.TemporaryDirectory(prefix="tracknoise-sfm-") as name:
        folder = Path(name)
        images, database, models = folder / "images", folder / "database.db", folder / "models"
        images.mkdir()
        models.mkdir()
        say(f"reconstructing poses from {counted(len(sequence), 'image')}: features")
        _write_images(sequence, images)
        reader = colmap.ImageReaderOptions(camera_model=model, camera_params=",".join(map(repr, parameters)))
        colmap.extract_features(
            database,
            images,
            camera_mode=colmap.CameraMode.SINGLE,
            reader_options=reader,
            extraction_options=_extraction(colmap),
            device=colmap.Device.cpu,
        )
        scale = min(max(sequence.camera.width, sequence.camera.height) / _WIDE_PX, _MOST_PX / _MATCH_PX)
        scale = max(scale, 1.0)
        say("reconstructing poses: matches")
        _match(colmap, database, scale)
        say("reconstructing poses: cameras and points")
        found = colmap.incremental_mapping(database, images, models, _mapping(colmap, scale))
    poses = no_poses(len(sequence))
    largest = max(found.values(), key=lambda model: model.num_reg_images(), default=None)
    for image in () if largest is None else largest.images.values():
        if image.has_pose:
            camera_from_world = np.vstack([image.cam_from_world().matrix(), (0.0, 0.0, 0.0, 1.0)])
            poses[int(Path(image.name).stem)] = invert(camera_from_world[None])[0]
    registered = int(np.isfinite(poses[:, 0, 0]).sum())
    if registered < _FEWEST_REGISTERED:
        expected = "images with overlap, texture and parallax, or poses: --trajectory FILE"
        raise DataError(sequence.source, "images from which COLMAP reconstructs no poses", expected)
    return poses


def trajectory_text(sequence: Sequence, poses: NDArray[np.float64], heading: str) -> str:
    """Poses (n, 4, 4) in the format of TUM, at the times of frames, or their numbers where times are unknown.

    Parameters
    ----------
    sequence
        Whose times they are: by the clock of the recording where that is known.
    poses
        One for each frame; frames without a pose have no row.
    heading
        A comment.
    """
    times_s, start_ns = times_of(sequence), clock_start_of(sequence) or 0
    known = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    nanoseconds = [start_ns + round(1e9 * time) for time in ([] if times_s is None else times_s.tolist())]
    rows = zip(known.tolist(), position_rows(poses[known], canonical=True).tolist(), strict=True)
    lines = [
        " ".join([_stamp(nanoseconds[frame]) if nanoseconds else str(frame), *(f"{value:.12g}" for value in row)])
        for frame, row in rows
    ]
    return "\n".join([f"# {heading}", "# timestamp tx ty tz qx qy qz qw (world_from_camera)", *lines, ""])


def _stamp(ns: int) -> str:
    sign, seconds = "-" * (ns < 0), divmod(abs(ns), 10**9)
    return f"{sign}{seconds[0]}.{seconds[1]:09d}"


def _camera(camera: CameraModel, source: str) -> tuple[str, tuple[float, ...]]:
    """COLMAP's model of a camera and its parameters."""
    if not isinstance(camera, Camera | EquidistantCamera | FovCamera):
        known = "radtan, equidistant or fov, or poses: --trajectory FILE"
        raise DataError(source, f"a camera of the model {type(camera).__name__}, which COLMAP does not have", known)
    pinhole = (camera.fx, camera.fy, camera.cx + CORNER_PX, camera.cy + CORNER_PX)
    if isinstance(camera, FovCamera):
        return "FOV", (*pinhole, camera.omega)
    if isinstance(camera, EquidistantCamera):
        return "OPENCV_FISHEYE", (*pinhole, *camera.distortion)
    count = len(camera.distortion)
    if count <= 4:
        return ("OPENCV", (*pinhole, *camera.distortion)) if count else ("PINHOLE", pinhole)
    return "FULL_OPENCV", (*pinhole, *camera.distortion, *[0.0] * (8 - count))


def _write_images(sequence: Sequence, folder: Path) -> None:
    digits = max(6, math.ceil(math.log10(len(sequence) + 1)))
    for index in range(len(sequence)):
        _, png = cv2.imencode(".png", sequence.image(index))
        (folder / f"{index:0{digits}d}.png").write_bytes(png.tobytes())
    if shutil.disk_usage(folder).free == 0:
        raise DataError(str(folder), "a full disk", "space for the images of the sequence")


def _extraction(colmap: ModuleType) -> object:
    options = colmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features = _MOST_FEATURES
    return options


def _match(colmap: ModuleType, database: Path, scale: float) -> None:
    verification = colmap.TwoViewGeometryOptions()
    verification.ransac.max_error = _MATCH_PX * scale
    verification.ransac.random_seed = _SEED
    colmap.match_sequential(
        database,
        matching_options=colmap.FeatureMatchingOptions(use_gpu=False),
        pairing_options=colmap.SequentialPairingOptions(),
        verification_options=verification,
        device=colmap.Device.cpu,
    )


def _mapping(colmap: ModuleType, scale: float) -> object:
    options = colmap.IncrementalPipelineOptions(random_seed=_SEED, extract_colors=False)
    options.ba_refine_focal_length = options.ba_refine_principal_point = options.ba_refine_extra_params = False
    options.ba_global_frames_ratio = options.ba_global_points_ratio = 1.3
    mapper, points = options.mapper, options.triangulation
    mapper.random_seed = points.random_seed = _SEED
    mapper.abs_pose_refine_focal_length = mapper.abs_pose_refine_extra_params = False
    mapper.init_max_error = mapper.filter_max_reproj_error = _POINT_PX * scale
    points.merge_max_reproj_error = points.complete_max_reproj_error = _POINT_PX * scale
    mapper.abs_pose_max_error = _POSE_PX * scale
    mapper.init_max_forward_motion = 1.0
    mapper.init_min_tri_angle = _BEGINNING_PARALLAX_DEG
    mapper.filter_min_tri_angle = points.min_angle = _LEAST_PARALLAX_DEG
    mapper.ba_local_min_tri_angle = 2.0
    return options
