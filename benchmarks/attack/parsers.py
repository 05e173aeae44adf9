"""The one list of everything in tracknoise that reads a file which somebody else wrote."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from benchmarks.attack import recordings, samples, timed
from benchmarks.attack.mutations import with_png_checksums
from tracknoise.estimators.cpp_header import cpp_header
from tracknoise.estimators.exports import estimators
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.load import load_experiment
from tracknoise.geometry.cameras import Camera
from tracknoise.options import PathTemplate
from tracknoise.paper.dtu import read_calibration, read_leds
from tracknoise.paper.dtu import read_scan as read_dtu_scan
from tracknoise.report.contents import read_contents
from tracknoise.sequences.camera_files import read_camera_file
from tracknoise.sequences.colmap import Colmap
from tracknoise.sequences.euroc import Euroc
from tracknoise.sequences.folder import Folder
from tracknoise.sequences.images import (
    image_size,
    read_depth_npy,
    read_depth_png16,
    read_depth_png_float32,
    read_gray,
)
from tracknoise.sequences.kitti import Kitti, KittiDepth
from tracknoise.sequences.kitti_files import read_camera, read_camera_from_velodyne
from tracknoise.sequences.kitti_odometry import KittiOdometry
from tracknoise.sequences.kitti_writer import CAMERA_FROM_VELODYNE
from tracknoise.sequences.nerfstudio import Nerfstudio
from tracknoise.sequences.poses import checked_poses, quaternion_poses, read_matrix, read_rows
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.rosbag import Rosbag
from tracknoise.sequences.sequence import Reader
from tracknoise.sequences.sevenscenes import SevenScenes
from tracknoise.sequences.tartanair import TartanAir
from tracknoise.sequences.tum import Tum
from tracknoise.simulation.sdf_worlds import load_model, load_world
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.keypoint_network import NetworkUnits, find_keypoints, require_network
from tracknoise.trackers.tracker import SequenceContext
from tracknoise.trackers.tracker_registry import make_tracker

CAMERA = Camera(*samples.SIZE, 20.0, 20.0, 11.5, 7.5)
_TRACKS = ("csv", "parquet", "txt", "npz", "db")
_VELODYNE = KittiDepth(1.0, CAMERA_FROM_VELODYNE)


@dataclass(frozen=True, slots=True)
class Parser:
    """One reader of foreign files.

    Parameters
    ----------
    name
        In the table of counts.
    write
        Writes valid files into a new folder.
    files
        Pattern of the files that are damaged, one at a time.
    read
        Reads the damaged file, given its path.
    repair
        Makes checksums right again, so that the damage is not refused at once; applied to half of the inputs.
    """

    name: str
    write: Callable[[Path], None]
    files: str
    read: Callable[[Path], object]
    repair: Callable[[bytes], bytes] | None = None

    def repaired(self, content: bytes, rng: Random) -> bytes:
        """The content with its checksums made right, in half of the cases."""
        return self.repair(content) if self.repair is not None and rng.random() < 0.5 else content


def _open(reader: type[Any], levels: int, path: Path) -> None:
    """Open the first sequence of a data set, and read its first frame."""
    made: Reader = reader(path.parents[levels])
    sequence = made.open(made.sequences()[0])
    sequence.image(0)
    sequence.depth(0)


def _open_file(path: Path) -> None:
    """Open a bag, and read its first frame."""
    reader = Rosbag(path)
    sequence = reader.open(reader.sequences()[0])
    sequence.image(0)
    sequence.depth(0)


def _read_options(path: Path) -> None:
    """Options of trackers and readers, as a JSON file has them."""
    for kind, name, options in _listed_options(path):
        make_tracker(name, options) if kind == "tracker" else make_reader(name, Path(), options)


def _export_noise(path: Path) -> None:
    """To every estimator that takes it, and as a header of C++."""
    model = NoiseModel.read(path)
    cpp_header(model)
    for name in estimators():
        with suppress(SettingsError):  # which needs observations, a focal length or a rate, or has no sigma
            model.export(name)


def _listed_options(path: Path) -> list[Any]:
    """What can be handed to the package at all: a kind, a name and options each."""
    try:
        parsed = json.loads(path.read_text())
    except (ValueError, RecursionError):
        return []
    listed = parsed if isinstance(parsed, list) else []
    return [item for item in listed if isinstance(item, list) and [*map(type, item)] == [str, str, dict]]


def _read_tracks(path: Path) -> None:
    """As the tracker `imported` does, for a sequence of four frames at 10 Hz."""
    context = SequenceContext(SequenceId("d", "s"), (100, 100), 4, 1, 0, None, timestamps_s=np.arange(4) / 10)
    Imported(PathTemplate(str(path).replace("{", "{{").replace("}", "}}"))).start(context)


def _find_keypoints(path: Path) -> None:
    require_network(path)
    find_keypoints(np.zeros(samples.SIZE[::-1], np.uint8), path, NetworkUnits.pixels)


def _read_run(path: Path) -> None:
    run = RunFolder(path.parent)
    run.manifest()


def _clear_run(path: Path) -> None:
    content = path.read_bytes()
    try:
        RunFolder(path.parent).clear()
    finally:
        path.write_bytes(content)


def _read_table(path: Path) -> None:
    RunFolder(path.parents[1]).sequence_table("moments", path.stem)


def _model(path: Path) -> None:
    load_model(next(level for level in path.parents if (level / "model.config").exists()))


def _image(path: Path) -> None:
    image_size(path)
    read_gray(path, CAMERA, levels=(0, 65535))


def _matrix_pose(path: Path) -> None:
    checked_poses(read_matrix(path, size=4)[None], [path])


def _quaternion_poses(path: Path) -> None:
    rows, places = read_rows(path, "x y z qx qy qz qw")
    quaternion_poses(rows[:, :3], rows[:, 3:], places)


def _kitti_calibration(path: Path) -> None:
    read_camera(path.parent)
    read_camera_from_velodyne(path.parent)


_KINECT = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
_REAL = (
    Parser("real model", samples.real_model, "mailbox/**/*.*", _model, with_png_checksums),
    Parser("real kitti calibration", samples.real_files, "calib*.txt", _kitti_calibration),
    Parser("real matrix pose", samples.real_files, "*.pose.txt", _matrix_pose),
    Parser("real quaternion poses", samples.real_files, "pose_left.txt", _quaternion_poses),
    Parser("real jpeg", samples.real_files, "*.color.jpg", partial(read_gray, camera=_KINECT)),
    Parser(
        "real depth map",
        samples.real_files,
        "*.depth.png",
        partial(read_depth_png16, camera=_KINECT, metres_per_unit=0.001),
        with_png_checksums,
    ),
)
PARSERS: tuple[Parser, ...] = (
    Parser("experiment", samples.experiments, "*.toml", load_experiment),
    Parser("options", samples.options, "*.json", _read_options),
    Parser("noise model", samples.noise_model, "*.json", _export_noise),
    *(Parser(f"tracks {suffix}", samples.tracks, f"*.{suffix}", _read_tracks) for suffix in _TRACKS),
    Parser("image", samples.images, "gray/*", _image, with_png_checksums),
    Parser("depth npy", samples.images, "depth/*.npy", partial(read_depth_npy, camera=CAMERA)),
    Parser(
        "depth png16",
        samples.images,
        "depth/16.png",
        partial(read_depth_png16, camera=CAMERA, metres_per_unit=0.001),
        with_png_checksums,
    ),
    Parser(
        "depth png float32",
        samples.images,
        "depth/float32.png",
        partial(read_depth_png_float32, camera=CAMERA),
        with_png_checksums,
    ),
    Parser("network", samples.networks, "*.onnx", _find_keypoints),
    Parser("camera file", samples.camera_files, "*", read_camera_file),
    Parser("folder camera", samples.folder, "camera.json", partial(_open, Folder, 0)),
    Parser("folder poses", samples.folder, "poses.txt", partial(_open, Folder, 0)),
    Parser("sevenscenes", samples.sevenscenes, "*.txt", partial(_open, SevenScenes, 0)),
    Parser("tartanair", samples.tartanair, "pose_left.txt", partial(_open, TartanAir, 0)),
    Parser("kitti calibration", samples.kitti, "*/calib*.txt", partial(_open, Kitti, 1)),
    Parser("kitti oxts", samples.kitti, "*/*/oxts/data/*.txt", partial(_open, Kitti, 4)),
    Parser("kitti timestamps", samples.kitti, "*/*/image_02/timestamps.txt", partial(_open, Kitti, 3)),
    Parser("kitti poses", samples.kitti_poses, "*/*/poses_image_02.txt", partial(_open, Kitti, 2)),
    Parser("velodyne", samples.kitti, "*/*/velodyne_points/data/*.bin", partial(_VELODYNE, camera=CAMERA)),
    Parser("kitti odometry", timed.kitti_odometry, "sequences/00/*.txt", partial(_open, KittiOdometry, 2)),
    Parser("kitti odometry poses", timed.kitti_odometry, "poses/00.txt", partial(_open, KittiOdometry, 1)),
    Parser("tum", timed.tum, "*.txt", partial(_open, Tum, 0)),
    Parser("tum pairs", timed.tum_pairs, "[al]*.*", partial(_open, Tum, 0)),
    Parser("euroc", timed.euroc, "mav0/*/*.*", partial(_open, Euroc, 2)),
    Parser("dtu calibration", samples.dtu, "Calib*.mat", read_calibration),
    Parser("dtu scan", samples.dtu, "Clean*.mat", read_dtu_scan),
    Parser("dtu leds", samples.dtu, "leds.csv", read_leds),
    Parser("ros 1 bag", recordings.bags, "*.bag", _open_file),
    Parser("ros 2 sqlite", recordings.bags, "sqlite3/*.db3", _open_file),
    Parser("ros 2 mcap", recordings.bags, "mcap/*.mcap", _open_file),
    Parser("ros 2 metadata", recordings.bags, "*/metadata.yaml", partial(_open, Rosbag, 0)),
    Parser("colmap", recordings.colmap, "*/*.*", partial(_open, Colmap, 0)),
    Parser("colmap depth", recordings.colmap, "*/stereo/*/*.bin", partial(_open, Colmap, 2)),
    Parser("nerfstudio", recordings.nerfstudio, "transforms.json", partial(_open, Nerfstudio, 0)),
    Parser("world", samples.world, "*.world", partial(load_world, models=None)),
    Parser("model", samples.world, "models/*/model.*", _model),
    Parser("material script", samples.world, "models/*/materials/scripts/*", _model),
    Parser("texture", samples.world, "models/*/materials/textures/*", _model, with_png_checksums),
    Parser("obj and mtl", samples.world, "models/*/meshes/*.[om]*", _model),
    Parser("collada", samples.world, "models/*/meshes/*.dae", _model),
    Parser("stl", samples.world, "models/*/meshes/*.stl", _model),
    Parser("manifest", samples.run, "manifest.json", _read_run),
    Parser("manifest of a cleared run", samples.run, "manifest.json", _clear_run),
    Parser("table", samples.run, "moments/*.parquet", _read_table),
    Parser("contents of a report", samples.run, "report/contents.json", lambda path: read_contents(path.parent)),
    *(_REAL if samples.has_real_samples() else ()),
)
