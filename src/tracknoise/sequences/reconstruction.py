"""Poses from the images of a sequence alone: structure from motion with COLMAP (package pycolmap, extra ``sfm``).

Intrinsics are fixed. Images of a path are matched with their successors, near and far, and all poses are found
together (global mapping, GLOMAP): what begins with two frames and adds others ends in a wrong minimum where successive
frames have little parallax. The bound on matches is smaller than COLMAP's, which is meant for photographs of several
thousand pixels: pairs of video frames have wrong solutions within it.

Where points move by little more than rotations of the camera explain, other rotations, positions and depths fit them as
well, by errors that look small. What is left beside the best rotation of two frames needs none of these, and has to
exceed the errors of the reconstruction by far.
"""

import math
import tempfile
from collections.abc import Callable, Iterable
from itertools import combinations
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera, CameraModel, EquidistantCamera, FovCamera
from tracknoise.geometry.depth import sample
from tracknoise.geometry.pose import invert, position_rows
from tracknoise.sequences.colmap import CORNER_PX
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.poses import no_poses
from tracknoise.sequences.sequence import Sequence, camera_at, clock_start_of, times_of
from tracknoise.sequences.writing import only_camera
from tracknoise.text import counted
from tracknoise.words import pixels

_MOST_FEATURES = 1500
_SEED = 0
_MATCH_PX, _MOST_MATCH_PX, _USUAL_PX = 1.5, 4.0, 640
"""Distance of matches from epipolar lines: up to the usual width of images, and at most, where it grows with them."""
_FEWEST_REGISTERED = 2
_LEAST_PARALLAX, _FRAMES_OF_PARALLAX, _FEWEST_OF_PARALLAX = 15.0, 8, 20
"""Parallax of points in two frames over errors of the reconstruction, at least; frames that are compared, at most, and
the fewest points of two."""
_ROTATION_STEPS, _ROUNDING_PX = 10, 0.01
_FRAMES_OF_SCALE, _FEWEST_OF_SCALE = 30, 20
"""Frames whose depth is read for the scale, and the fewest points that give it."""


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
        problem = "poses from images alone need pycolmap, which is not installed"
        raise SettingsError(f"{problem}: pip install 'tracknoise[sfm]', or give poses: --trajectory FILE") from error
    return pycolmap


def reconstruct(sequence: Sequence, *, say: Callable[[str], None] = lambda _: None) -> NDArray[np.float64]:
    """Reconstruct the poses of a sequence from its images.

    The unit of length is the metre where frames have depth: the median over all points gives it. Otherwise it is
    arbitrary, which errors in pixels do not see.

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
        If the camera changes or COLMAP does not know its model, no two frames could be connected, or the camera hardly
        changes its position.
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
        reader = colmap.ImageReaderOptions(camera_model=model, camera_params=_written(parameters))
        common = {
            "camera_mode": colmap.CameraMode.SINGLE,
            "image_names": sorted(path.name for path in images.iterdir()),
        }
        colmap.Database.open(database).close()
        colmap.import_images(database, images, options=reader, **common)  # numbers in order, whichever is ready first
        colmap.extract_features(
            database,
            images,
            reader_options=reader,
            extraction_options=_extraction(colmap),
            device=colmap.Device.cpu,
            **common,
        )
        say("reconstructing poses: matches")
        _match(colmap, database, max(sequence.camera.width, sequence.camera.height))
        say("reconstructing poses: cameras and points")
        reconstructions = colmap.global_mapping(database, images, models, _mapping(colmap))
        largest = max(reconstructions.values(), key=lambda model: model.num_reg_images(), default=None)
        poses = no_poses(len(sequence))
        frames = {} if largest is None else _registered(largest)
        for index, image in frames.items():
            camera_from_world = np.vstack([image.cam_from_world().matrix(), (0.0, 0.0, 0.0, 1.0)])
            poses[index] = invert(camera_from_world[None])[0]
        unit_m = None if largest is None else _unit_m(sequence, largest, frames)
        parallax_px, error_px = (np.nan, np.nan) if largest is None else _parallax_px(sequence, largest, frames)
    if unit_m is not None:
        say(f"reconstructing poses: depth gives the scale (1 unit is {unit_m:.4g} m)")
        poses[:, :3, 3] *= unit_m
    registered = int(np.isfinite(poses[:, 0, 0]).sum())
    if registered < _FEWEST_REGISTERED or not np.isfinite(parallax_px):
        expected = "images with overlap, texture and parallax, or poses: --trajectory FILE"
        raise DataError(sequence.source, "images from which COLMAP reconstructs no poses", expected)
    if not parallax_px > _LEAST_PARALLAX * error_px:
        found = f"points that move by {pixels(parallax_px)} px beside rotations, where errors are {pixels(error_px)} px"
        expected = f"{_LEAST_PARALLAX:g} times as much: a camera that changes its position; or poses: --trajectory FILE"
        raise DataError(sequence.source, found, expected)
    return poses


def _registered(model: Any) -> dict[int, Any]:
    """Images of a reconstruction that have a pose, by the number of their frame."""
    posed = ((int(Path(image.name).stem), image) for image in model.images.values() if image.has_pose)
    return dict(sorted(posed, key=lambda item: item[0]))


def _parallax_px(sequence: Sequence, model: Any, frames: dict[int, Any]) -> tuple[float, float]:
    """What no rotation explains of the displacements between two frames, and errors of reprojection: medians, px.

    Of pairs of frames, that with the most parallax counts. NaN where no two frames have points in common.
    """
    seen = {}
    for index in list(frames)[:: max(len(frames) // _FRAMES_OF_PARALLAX, 1)]:
        points = [point for point in frames[index].points2D if point.has_point3D()]
        seen[index] = {point.point3D_id: point.xy - CORNER_PX for point in points}
    largest = np.nan
    for first, second in combinations(seen.values(), 2):
        shared = [*(first.keys() & second.keys())]
        if len(shared) >= _FEWEST_OF_PARALLAX:
            pair = (np.array([positions[point] for point in shared]) for positions in (first, second))
            largest = float(np.fmax(largest, _beside_rotation_px(sequence.camera, *pair)))
    return largest, float(np.median([point.error for point in model.points3D.values()] or [np.inf]))


def _beside_rotation_px(camera: CameraModel, first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Median distance of positions (n, 2) in a frame from those in another, turned by the best rotation, px."""
    first_rays, second_rays = (
        camera.bearings(uv) / np.linalg.norm(camera.bearings(uv), axis=1)[:, None] for uv in (first, second)
    )
    valid = np.isfinite(first_rays).all(axis=1) & np.isfinite(second_rays).all(axis=1)
    first_rays, second_rays, second = first_rays[valid], second_rays[valid], second[valid]
    weight = np.ones(len(first_rays))
    for _ in range(_ROTATION_STEPS):
        turned = Rotation.align_vectors(second_rays, first_rays, weights=weight)[0].apply(first_rays)
        apart_px = np.linalg.norm(camera.project(turned) - second, axis=1)
        weight = 1.0 / np.maximum(np.nan_to_num(apart_px, nan=np.inf), _ROUNDING_PX)
    return float(np.nanmedian(apart_px))


def _unit_m(sequence: Sequence, model: Any, frames: dict[int, Any]) -> float | None:
    """Metres in a unit of a reconstruction: the median of measured over reconstructed depths; None without depth."""
    ratios = []
    for index in list(frames)[:: max(len(frames) // _FRAMES_OF_SCALE, 1)]:
        depth, image = sequence.depth(index), frames[index]
        seen = [point for point in image.points2D if point.has_point3D()]
        if depth is None or not seen:
            continue
        measured = sample(depth, np.array([point.xy for point in seen]) - CORNER_PX, camera_at(sequence, index))
        points = np.array([model.point3D(point.point3D_id).xyz for point in seen])
        reconstructed = (points @ image.cam_from_world().matrix()[:, :3].T + image.cam_from_world().matrix()[:, 3])[
            :, 2
        ]
        usable = measured.valid & (reconstructed > 0.0)
        ratios.append(measured.depth_m[usable] / reconstructed[usable])
    joined = np.concatenate(ratios) if ratios else np.empty(0)
    return float(np.median(joined)) if len(joined) >= _FEWEST_OF_SCALE else None


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
    posed = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    nanoseconds = [start_ns + round(1e9 * time) for time in ([] if times_s is None else times_s.tolist())]
    rows = zip(posed.tolist(), position_rows(poses[posed], canonical=True).tolist(), strict=True)
    lines = [
        " ".join([_stamp(nanoseconds[frame]) if nanoseconds else str(frame), *(f"{value:.12g}" for value in row)])
        for frame, row in rows
    ]
    return "\n".join([f"# {heading}", "# timestamp tx ty tz qx qy qz qw (world_from_camera)", *lines, ""])


def _stamp(ns: int) -> str:
    sign, seconds = "-" * (ns < 0), divmod(abs(ns), 10**9)
    return f"{sign}{seconds[0]}.{seconds[1]:09d}"


def _written(parameters: Iterable[float]) -> str:
    """Parameters of a camera as COLMAP reads them, whichever type of numbers a file gave."""
    return ",".join(repr(float(parameter)) for parameter in parameters)


def _camera(camera: CameraModel, source: str) -> tuple[str, tuple[float, ...]]:
    """COLMAP's model of a camera and its parameters."""
    if not isinstance(camera, Camera | EquidistantCamera | FovCamera):
        expected = "radtan, equidistant or fov, or poses: --trajectory FILE"
        raise DataError(source, f"a camera of the model {type(camera).__name__}, which COLMAP does not have", expected)
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
        (folder / f"{index:0{digits}d}.png").write_bytes(encode_png(sequence.image(index)))


def _extraction(colmap: ModuleType) -> object:
    options = colmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features = _MOST_FEATURES
    return options


def _match(colmap: ModuleType, database: Path, size_px: int) -> None:
    """Match images in a single thread, as they are mapped: several would find other poses each time."""
    verification = colmap.TwoViewGeometryOptions()
    verification.ransac.max_error = min(_MATCH_PX * max(size_px / _USUAL_PX, 1.0), _MOST_MATCH_PX)
    verification.ransac.random_seed = _SEED
    colmap.match_sequential(
        database,
        matching_options=colmap.FeatureMatchingOptions(use_gpu=False, num_threads=1),
        pairing_options=colmap.SequentialPairingOptions(num_threads=1),
        verification_options=verification,
        device=colmap.Device.cpu,
    )


def _mapping(colmap: ModuleType) -> object:
    options = colmap.GlobalPipelineOptions(random_seed=_SEED, num_threads=1)
    mapper, adjustment = options.mapper, options.mapper.bundle_adjustment
    mapper.random_seed, mapper.num_threads = _SEED, 1
    for part in (mapper.rotation_averaging, mapper.global_positioning, mapper.retriangulation):
        part.random_seed = _SEED
    adjustment.refine_focal_length = adjustment.refine_principal_point = adjustment.refine_extra_params = False
    mapper.global_positioning.use_gpu = adjustment.ceres.use_gpu = False
    return options
