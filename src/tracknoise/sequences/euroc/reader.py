"""The reader of recordings in the ASL layout, such as EuRoC MAV and TUM-VI: see docs/formats/euroc.md."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds, require_finite
from tracknoise.geometry.interpolation import PosePath
from tracknoise.sequences.euroc.layout import Files, find_recordings, place_of
from tracknoise.sequences.euroc.second import find_second
from tracknoise.sequences.euroc.sensors import read_camera, read_sensor_from_body
from tracknoise.sequences.euroc.tables import file_names, pose_rows, read_table
from tracknoise.sequences.frame_files import ImageFiles
from tracknoise.sequences.images import require_levels
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import scene_folder
from tracknoise.sequences.timed.order import in_order, order_notes
from tracknoise.sequences.timed.trajectory import path_through, poses_at, trajectory
from tracknoise.tables.identity import SequenceId


@dataclass(frozen=True, slots=True)
class Euroc:
    """Reader of EuRoC MAV, TUM-VI and others in the ASL layout.

    Parameters
    ----------
    root
        Folder of one recording, or of several at any depth.
    camera
        Folder of the camera.
    camera_file
        Intrinsics and place of the camera on the body; by default the camera's ``sensor.yaml``, else a Kalibr
        ``camchain.yaml``.
    pose_source
        Folder of the poses; by default the first of `tracknoise.sequences.euroc.layout.POSE_SOURCES` that there is.
    time_shift_s
        Added to the times of the images to get the clock of the poses, seconds; by default what the camera's file
        states, else 0.
    max_pose_gap_s
        Longest time between two poses that are interpolated, seconds. Images in longer gaps have no pose.
    image_levels
        Values of 16-bit images that become 0 and 255; values between are scaled linearly, others are clipped. Images
        of 8 bits are not changed.

    Raises
    ------
    ValueError
        If an option has an impossible value.
    """

    name: ClassVar[str] = "euroc"
    description: ClassVar[str] = "EuRoC MAV, TUM-VI and the ASL layout: poses of the body in nanoseconds, no depth"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera: str = "cam0"
    camera_file: Path | None = None
    pose_source: str | None = None
    time_shift_s: float | None = None
    max_pose_gap_s: NotNegative = 0.1
    image_levels: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        require_bounds(self)
        require_finite("time_shift_s", self.time_shift_s or 0.0)
        if self.image_levels is not None:
            require_levels("image_levels", self.image_levels)

    def sequences(self) -> list[SequenceId]:
        """All recordings, sorted: each folder with ``mav0``.

        Raises
        ------
        DataError
            If there is none.
        """
        return [SequenceId(self.name, scene) for scene in find_recordings(self.root)]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one recording, except for its images.

        Raises
        ------
        DataError
            If a table, the poses or the calibration is missing or damaged, or no image has a pose.
        UnknownNameError
            If there is no such scene, lighting, camera or source of poses.
        """
        files = Files(scene_folder(find_recordings(self.root), sequence))
        images = read_table(files.list_of_images(self.camera), "a time and the name of an image")
        file = self.camera_file or files.calibration(self.camera)
        calibration = read_camera(file, self.camera)
        assert calibration.body_from_camera is not None, "checked when it was read"
        order = in_order(images.times_ns)
        names = file_names(images)
        paths = tuple(files.image(self.camera, names[index]) for index in order)
        start_ns = images.times_ns[order[0]]
        times_s = _seconds_after(images.times_ns[order], start_ns)
        shift_s = (calibration.time_shift_s or 0.0) if self.time_shift_s is None else self.time_shift_s
        poses, path, notes = self._camera_poses(files, calibration.body_from_camera, start_ns, times_s, shift_s)
        second, second_notes = find_second(
            files,
            self.camera,
            calibration.body_from_camera,
            images.times_ns[order],
            camera_file=self.camera_file,
            levels=self.image_levels,
        )
        return RecordedSequence(
            id=sequence,
            source=str(files.folder),
            camera=calibration.camera,
            world_from_camera=poses,
            images=ImageFiles(paths, calibration.camera, self.image_levels),
            notes=(
                f"the camera is that of {file}",
                *calibration.notes,
                *_shift_notes(shift_s),
                *order_notes(images.path, images.times_ns),
                *notes,
                *second_notes,
            ),
            timestamps_s=times_s,
            group=place_of(sequence.scene),
            second=second,
            shutter=calibration.shutter,
            path=path,
        )

    def _camera_poses(
        self,
        files: Files,
        body_from_camera: NDArray[np.float64],
        start_ns: np.int64,
        times_s: NDArray[np.float64],
        shift_s: float,
    ) -> tuple[NDArray[np.float64], PosePath, tuple[str, ...]]:
        """Poses of the camera at the times of its images, and between them; times are after that of the first image."""
        source = files.pose_source(self.pose_source)
        table = read_table(files.poses(source), "a time, a position and a quaternion")
        recorded = trajectory(table.path, _seconds_after(table.times_ns, start_ns), pose_rows(table), table.places)
        sensor_from_body, sensor_notes = read_sensor_from_body(files.sensor(source))
        sensor_from_camera = sensor_from_body @ body_from_camera
        sensors, notes = poses_at(recorded, times_s + shift_s, max_gap_s=self.max_pose_gap_s)
        poses = sensors @ sensor_from_camera
        along = PosePath(recorded.times_s - shift_s, recorded.poses @ sensor_from_camera)
        path = path_through(times_s, poses, along, max_gap_s=self.max_pose_gap_s)
        return poses, path, (f"poses come from {source}", *sensor_notes, *notes)


def _seconds_after(times_ns: NDArray[np.int64], start_ns: np.int64) -> NDArray[np.float64]:
    """Seconds after a start. Whole nanoseconds are subtracted first: seconds since 1970 would be rounded to 0.2 us."""
    seconds: NDArray[np.float64] = (times_ns - start_ns) / 1e9
    return seconds


def _shift_notes(shift_s: float) -> tuple[str, ...]:
    return (
        (f"{1e3 * shift_s:g} ms were added to the times of the images for the clock of the poses",) if shift_s else ()
    )
