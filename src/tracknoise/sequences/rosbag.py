"""The reader of bags: see docs/formats.md."""

import re
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Lt
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.pose import nearest
from tracknoise.rosbag_files import BagFile, Position, find_bags
from tracknoise.sequences.camera_files import CameraFile, Lens, read_camera_file
from tracknoise.sequences.camera_pairs import (
    STATED_PLACES,
    pose_of_numbers,
    read_second,
    require_pose_numbers,
)
from tracknoise.sequences.images import Levels, level_notes, require_levels
from tracknoise.sequences.likely_times import require_likely_rate
from tracknoise.sequences.orientation import turned_notes
from tracknoise.sequences.poses import no_poses, pose_notes
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.rosbag_frames import (
    BagDepths,
    BagImages,
    Clock,
    Frames,
    Scan,
    camera_poses,
    in_order,
    in_unit,
    matching,
    scan_bag,
    static_place,
)
from tracknoise.sequences.rosbag_messages import UNNAMED_DEPTH, Wanted, camera_of, frame_name, place_beside
from tracknoise.sequences.scenes import SceneReader, parent_of, with_option
from tracknoise.sequences.second_camera import SomeImages
from tracknoise.sequences.sequence import Body, SecondCamera
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted, counted_of
from tracknoise.time_units import TimeUnit

_RECTIFIED = re.compile(r"(?:^|[/_])rect(?:ified)?(?:[/_]|$)", re.IGNORECASE)
"""A word of its own: a topic /direct/image is not rectified."""
_LONGEST_SHIFT_S = 86_400.0
_DEPTH_UNIT_M = 0.001
"""Depth of the integer 1 (ROS enhancement proposal 118)."""


@dataclass(frozen=True, slots=True)
class Rosbag(SceneReader):
    """Reader of bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap). ROS is not needed.

    Parameters
    ----------
    root
        A bag, or a folder with bags at any depth.
    image_topic, depth_topic, camera_info_topic, pose_topic
        Topics; by default the only one that fits. ``depth_topic = ""`` means no depth. The poses can be those of a tf
        topic.
    camera_file, camera
        A file with the intrinsics, in place of a topic, and which of its cameras.
    lens
        Lens of a file of OpenCV with 4 coefficients and no word for it: ``radtan`` or ``equidistant``.
    second_image_topic, second_camera_info_topic
        Topics of a second camera; no second camera without the first of them.
    second_camera_file, second_camera
        File of the second camera, and which of its cameras; by default the other one of `camera_file`, or the topic.
    first_from_second
        16 numbers, the rows of the pose of the second camera in the frame of the first, metres; by default that of the
        files, of P in the intrinsics of both, or of static transforms.
    second_gap_s
        Largest difference in time of images of both cameras, seconds.
    world_frame
        Frame of the poses; by default that of the pose topic, or the root of the tf tree.
    camera_frame
        Frame of the camera; by default that of the images.
    pose_frame
        Frame whose pose is measured, where the messages do not name it.
    body_from_camera
        16 numbers, the rows of the pose of the camera in this frame, where neither tf nor the camera file has it.
    time
        Whether the times in the headers count, or those when messages were received.
    time_unit
        Unit of the seconds of the times in headers: s, ms, us or ns; by default seconds, at 1 to 1,000 Hz.
    time_shift_s
        Added to the time of an image to get the time of its pose, seconds; by default that of the camera file, or 0.
    max_gap_s, max_pose_gap_s
        Largest difference in time of an image and its depth, and longest time between two poses that are interpolated,
        seconds.
    depth_unit_m
        Depth of the integer 1 in 16-bit depth maps, metres; by default what the camera file states, else 0.001.
    depth_radius_px
        None for dense depth; for sparse depth, the largest distance to the nearest pixel with depth, px.
    image_levels
        Values of 16-bit images that become 0 and 255.
    """

    name: ClassVar[str] = "rosbag"
    description: ClassVar[str] = "ROS bags: .bag, .db3 and .mcap with images, CameraInfo and poses or tf"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    image_topic: str | None = None
    depth_topic: str | None = None
    camera_info_topic: str | None = None
    pose_topic: str | None = None
    camera_file: Path | None = None
    camera: str | None = None
    lens: Lens | None = None
    second_image_topic: str | None = None
    second_camera_info_topic: str | None = None
    second_camera_file: Path | None = None
    second_camera: str | None = None
    first_from_second: tuple[float, ...] | None = None
    second_gap_s: NotNegative = 0.0
    world_frame: str | None = None
    camera_frame: str | None = None
    pose_frame: str | None = None
    body_from_camera: tuple[float, ...] | None = None
    time: Clock = Clock.header
    time_unit: TimeUnit | None = None
    time_shift_s: Annotated[float, Gt(-_LONGEST_SHIFT_S), Lt(_LONGEST_SHIFT_S)] | None = None
    max_gap_s: NotNegative = 0.02
    max_pose_gap_s: NotNegative = 0.1
    depth_unit_m: Positive | None = None
    depth_radius_px: NotNegative | None = None
    image_levels: Levels | None = None

    def __post_init__(self) -> None:
        require_bounds(self)
        require_levels(self.image_levels)
        require_pose_numbers("body_from_camera", self.body_from_camera)
        require_pose_numbers("first_from_second", self.first_from_second)

    def _scenes(self) -> dict[str, Path]:
        return find_bags(self.root)

    def recordings(self) -> list[SequenceId]:
        """All bags: see `ImageReader.recordings`."""
        return self.sequences()

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Go through one bag once. Images and depths are read later."""
        return self._opened(sequence, with_poses=True)

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """The same without poses: see `ImageReader.open_images`."""
        return self._opened(sequence, with_poses=False)

    def _opened(self, sequence: SequenceId, *, with_poses: bool) -> RecordedSequence:
        path = self._folder(sequence)
        file, calibration = BagFile.at(path), self._calibration()
        scan = in_unit(
            scan_bag(path, replace(self._wanted(), poses_elsewhere=not with_poses)), self.time_unit or TimeUnit.s
        )
        times_ns, positions = in_order(str(path), scan.images, self.time)
        timestamps_s = (times_ns - times_ns[0]) / 1e9
        if self.time_unit is None:
            other = Clock.received if self.time is Clock.header else Clock.header
            place = f"{path} {scan.images.topic}"
            require_likely_rate(timestamps_s, place, partial(with_option, "time_unit"), instead=f'time = "{other}"')
        shift_s = self._shift_s(calibration)
        frames = self._frames(calibration)
        poses, along, sources = no_poses(len(times_ns)), None, tuple[str, ...]()
        if with_poses:
            at_ns = times_ns + round(shift_s * 1e9)
            poses, along, notes = camera_poses(
                path, scan, frames, at_ns, clock=self.time, max_gap_s=self.max_pose_gap_s
            )
            sources = (*notes, *_shifted(shift_s), *pose_notes(poses))
        camera, camera_notes = _camera(path, scan, calibration)
        depths, depth_notes = self._depths(file, scan, times_ns, self._depth_unit_m(calibration))
        second, second_notes = self._second(file, scan, times_ns, calibration)
        return RecordedSequence(
            id=sequence,
            source=f"{path} {scan.images.topic}",
            camera=camera,
            world_from_camera=poses,
            images=BagImages(file, scan.images.topic, positions, self.image_levels),
            depths=depths,
            notes=(
                *camera_notes,
                *level_notes(self.image_levels),
                *sources,
                *depth_notes,
                *second_notes,
                *_repeated(scan, positions),
                *turned_notes(scan.images.topic, scan.images.turned, len(scan.images.positions)),
            ),
            timestamps_s=timestamps_s,
            time_unit_stated=self.time_unit is not None,
            clock_start_ns=int(times_ns[0]),
            group=parent_of(sequence.scene),
            shutter=None if calibration is None else calibration.shutter,
            path=along,
            second=second,
            body=None if frames.body_from_camera is None else Body(frames.body_from_camera, shift_s),
            poses_elsewhere=not with_poses,
        )

    def _wanted(self) -> Wanted:
        return Wanted(
            self.image_topic,
            self.depth_topic,
            self.camera_info_topic,
            self.pose_topic,
            self.second_image_topic,
            self.second_camera_info_topic,
            intrinsics_given=self.camera_file is not None,
            second_intrinsics_given=self._second_by_file,
        )

    @property
    def _second_by_file(self) -> bool:
        """Whether the second camera is that of a file."""
        files = (self.second_camera_file, self.camera_file)
        return self.second_camera_info_topic is None and any(file is not None for file in files)

    def _calibration(self) -> CameraFile | None:
        if self.camera_file is None:
            return None
        return read_camera_file(self.camera_file, camera=self.camera, lens=self.lens)

    def _shift_s(self, calibration: CameraFile | None) -> float:
        stated = None if calibration is None else calibration.time_shift_s
        return next((shift_s for shift_s in (self.time_shift_s, stated) if shift_s is not None), 0.0)

    def _depth_unit_m(self, calibration: CameraFile | None) -> float:
        stated = None if calibration is None else calibration.depth_unit_m
        return self.depth_unit_m or stated or _DEPTH_UNIT_M

    def _frames(self, calibration: CameraFile | None) -> Frames:
        """The frames between which poses are wanted. The option `body_from_camera` precedes the camera file."""
        given = None if calibration is None else calibration.body_from_camera
        if self.body_from_camera is not None:
            given = pose_of_numbers("body_from_camera", self.body_from_camera)
        return Frames(_frame(self.world_frame), _frame(self.camera_frame), _frame(self.pose_frame), given)

    def _depths(
        self, file: BagFile, scan: Scan, times_ns: NDArray[np.int64], depth_unit_m: float
    ) -> tuple[BagDepths | None, tuple[str, ...]]:
        """What reads the depths, and notes on them."""
        if scan.depths is None:
            return None, ("no depth is used: no topic of depth was found or named",)
        depth_ns, messages = in_order(str(file.path), scan.depths, self.time)
        times_s, depth_s = ((times - times_ns[0]) / 1e9 for times in (times_ns, depth_ns))
        positions = matching(times_s, depth_s, messages, max_gap_s=self.max_gap_s)
        topic, missing = scan.depths.topic, positions.count(None)
        have = counted_of(missing, len(positions), "frame", "has", "have")
        notes = [f"{have} no depth"] if missing else []
        if scan.depths.encoding.lower().startswith(UNNAMED_DEPTH):
            notes.append(
                f"{topic} is taken as depth in units of {depth_unit_m:g} m, by its name or the option depth_topic"
            )
        if scan.depths.frame != scan.images.frame:
            frames = f"{scan.depths.frame or '(no name)'} and {scan.images.frame or '(no name)'}"
            notes.append(f"depths and images are in the frames {frames}; they are taken as those of one camera")
        return BagDepths(file, topic, positions, depth_unit_m, self.depth_radius_px), tuple(notes)

    def _second(
        self, file: BagFile, scan: Scan, times_ns: NDArray[np.int64], calibration: CameraFile | None
    ) -> tuple[SecondCamera | None, tuple[str, ...]]:
        """The second camera, and notes on it."""
        if scan.second is None:
            options = ("second_camera_info_topic", "second_camera_file", "second_camera", "first_from_second")
            stated = [name for name in options if getattr(self, name) is not None]
            if stated:
                raise DataError(file.path, f"{stated[0]} and no second_image_topic", "the topic of its images")
            return None, ()
        topic = scan.second.topic
        other_ns, messages = in_order(str(file.path), scan.second, self.time)
        times_s, other_s = ((times - times_ns[0]) / 1e9 for times in (times_ns, other_ns))
        numbers = tuple(nearest(times_s, other_s, max_gap_s=self.second_gap_s).tolist())
        if max(numbers) < 0:
            gap_s = np.abs(other_s - times_s[nearest(other_s, times_s, max_gap_s=np.inf)]).min()
            found = f"no image at any of {counted(len(times_s), 'time')} of frames; the nearest is {gap_s:.3g} s off"
            expected = f"the same times, or {with_option('second_gap_s', 'SECONDS')}"
            raise DataError(f"{file.path} {topic}", found, expected)
        second, place, source = self._second_lens(file.path, scan, calibration)
        if self.first_from_second is not None:
            place, source = pose_of_numbers("first_from_second", self.first_from_second), "the option first_from_second"
        if place is None:
            frames = _frame(self.camera_frame) or scan.images.frame, scan.second.frame
            place, source = static_place(file.path, scan, *frames), "static transforms"
        if place is None:
            found = f"no pose of the second camera in the first: their frames are {' and '.join(map(repr, frames))}"
            expected = f"static transforms between two frames, P with a distance, {STATED_PLACES}"
            raise DataError(f"{file.path} {topic}", found, expected)
        images = SomeImages(BagImages(file, topic, messages, self.image_levels), numbers)
        notes = (f"second camera: {note}" for note in (f"its pose in the first is that of {source}", *second.notes))
        return SecondCamera(second.camera, place, images), (*notes, *images.notes(topic))

    def _second_lens(
        self, path: Path, scan: Scan, calibration: CameraFile | None
    ) -> tuple[CameraFile, NDArray[np.float64] | None, str]:
        """The second camera, its pose in the first (None where it is not stated with it), and what states it."""
        if scan.second_info is None:
            files = self.camera_file, self.second_camera_file
            second, place = read_second(
                calibration, files[0], self.camera, file=files[1], name=self.second_camera, size=None, lens=self.lens
            )
            return second, place, str(files[1] or files[0])
        assert scan.second is not None, "its topic of intrinsics is chosen with it"
        source = f"{path} {scan.second_info_topic}"
        rectified, second_rectified = (bool(_RECTIFIED.search(one.topic)) for one in (scan.images, scan.second))
        second, _ = camera_of(source, scan.second_info, rectified=second_rectified)
        place = None
        if scan.camera_info is not None:
            place = place_beside(source, scan.camera_info, scan.second_info, rectified=(rectified, second_rectified))
        return second, place, f"P of {scan.second_info_topic}"


def _frame(name: str | None) -> str | None:
    return None if name is None else frame_name(name)


def _camera(path: Path, scan: Scan, calibration: CameraFile | None) -> tuple[CameraModel, tuple[str, ...]]:
    if calibration is not None:
        return calibration.camera, calibration.notes
    assert scan.camera_info is not None, "a topic is chosen where no file is given"
    place = f"{path} {scan.camera_info_topic}"
    file, notes = camera_of(place, scan.camera_info, rectified=_RECTIFIED.search(scan.images.topic) is not None)
    return file.camera, notes


def _shifted(shift_s: float) -> tuple[str, ...]:
    return (f"poses are taken {shift_s:g} s after the times of the images",) if shift_s else ()


def _repeated(scan: Scan, positions: tuple[Position, ...]) -> tuple[str, ...]:
    count = len(scan.images.positions) - len(positions)
    have, are = ("has", "is") if count == 1 else ("have", "are")
    return (f"{counted(count, 'image')} {have} the time of another one and {are} left out",) if count else ()
