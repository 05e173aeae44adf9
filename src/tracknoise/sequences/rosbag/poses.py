"""Poses of the camera in a bag: from a topic of poses or from tf, for the frames that the user names or by default."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.interpolation import PosePath
from tracknoise.printable import counted
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.rosbag.frames import Clock, times_ns
from tracknoise.sequences.rosbag.links import Link
from tracknoise.sequences.rosbag.scan import Scan
from tracknoise.sequences.rosbag.trajectory import Step, Tree, poses_along
from tracknoise.sequences.timed.trajectory import path_through

_BODY = "(body)"
_OPTICAL = "optical"
_FEWEST_POSES = 2


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Which frames a trajectory connects, and how; None for what is to be found.

    Parameters
    ----------
    world, camera
        Names of the frames between which poses are wanted.
    body
        Name of the frame whose pose is measured.
    body_from_camera
        (4, 4) float64; None where tf has it.
    """

    world: str | None = None
    camera: str | None = None
    body: str | None = None
    body_from_camera: NDArray[np.float64] | None = None


def camera_poses(
    path: Path, scan: Scan, frames: Frames, at_ns: NDArray[np.int64], *, clock: Clock, max_gap_s: float
) -> tuple[NDArray[np.float64], PosePath, tuple[str, ...]]:
    """Poses of the camera at given times, and between them.

    Parameters
    ----------
    path
        The bag, for errors.
    scan
        What it holds.
    frames
        Which frames are connected.
    at_ns
        (n,) int64, nanoseconds, increasing.
    clock
        Which time of the transforms counts.
    max_gap_s
        Longest time between two transforms that are interpolated, seconds.

    Returns
    -------
    world_from_camera : (n, 4, 4) float64
        NaN where the pose is not known.
    path : PosePath
        At these times, in seconds after the first, and at all times of transforms.
    notes : tuple of str
        Where the poses come from, and what was assumed.

    Raises
    ------
    DataError
        If no chain of transforms connects the frames, or fewer than two images have a pose.
    """

    def seconds(link: Link) -> NDArray[np.float64]:
        times: NDArray[np.float64] = (times_ns(link, clock) - at_ns[0]) / 1e9
        return times

    steps, notes = _steps(path, scan, frames)
    at_s: NDArray[np.float64] = (at_ns - at_ns[0]) / 1e9
    poses = poses_along(steps, seconds, at_s, max_gap_s=max_gap_s)
    _require_some(path, steps, [seconds(step.link) for step in steps], at_s, int(np.count_nonzero(has_pose(poses))))
    recorded_s = np.unique(np.concatenate([seconds(step.link) for step in steps if not step.link.is_static]))
    recorded = poses_along(steps, seconds, recorded_s, max_gap_s=max_gap_s)
    if frames.body_from_camera is not None:
        poses, recorded = poses @ frames.body_from_camera, recorded @ frames.body_from_camera
    along = path_through(at_s, poses, PosePath(recorded_s, recorded), max_gap_s=max_gap_s)
    return poses, along, (*notes, *_left_out(steps))


def _steps(path: Path, scan: Scan, frames: Frames) -> tuple[list[Step], tuple[str, ...]]:
    """The chain from the camera, or from the body where its camera is given, to the world."""
    camera = frames.camera or scan.images.frame
    body = frames.body or ("" if scan.pose is None else scan.pose.child)
    given = frames.body_from_camera is not None
    if not camera and not given and (body or scan.pose is None):
        raise DataError(
            f"{path} {scan.images.topic}",
            "no frame in the headers",
            f"a frame, or {with_option('camera_frame', 'NAME')}",
        )
    if scan.pose is None:
        if given and not body:
            raise DataError(
                path,
                f"body_from_camera, poses from {scan.pose_topic} and no pose_frame",
                with_option("pose_frame", "NAME"),
            )
        steps = _of_tf(path, scan, frames.world, body if given else camera)
    else:
        measured = body or (_BODY if given else camera)
        steps = _of_topic(path, scan, scan.pose, frames.world, measured, measured if given else camera)
    return steps, tuple(_notes(scan, steps, camera=camera, body=body, given=given))


def _of_tf(path: Path, scan: Scan, world: str | None, source: str) -> list[Step]:
    """The chain through tf alone, of which something must move."""
    tree = Tree.of(path, scan.transforms)
    steps = tree.chain(world or tree.root_of(source), source)
    if not steps:
        raise DataError(f"{path} {scan.pose_topic}", f"no transform of {source}", f"one of {tree.names()}")
    if all(step.link.is_static for step in steps):
        found = f"no transform between {source} and {world or steps[-1].link.parent} that changes"
        raise DataError(
            f"{path} {scan.pose_topic}",
            found,
            f"a camera that moves; choose pose_topic, or {with_option('world_frame', 'NAME')}",
        )
    return steps


def _of_topic(path: Path, scan: Scan, pose: Link, world: str | None, measured: str, source: str) -> list[Step]:
    """The chain through tf to the frame whose pose is measured, through this pose, and through tf to the world."""
    tree = Tree.of(path, scan.transforms)
    before, after = tree.chain(measured, source), tree.chain(world or pose.parent, pose.parent)
    return [*before, Step(replace(pose, child=measured), True), *after]


def _notes(scan: Scan, steps: list[Step], *, camera: str, body: str, given: bool) -> Iterator[str]:
    stated = "; the pose of the camera in the body is given" if given else ""
    ends = [_near_end(steps[0]), *(_far_end(step) for step in steps)]
    yield f"poses are those of {scan.pose_topic}, interpolated: {' from '.join(reversed(ends))}{stated}"
    if scan.pose is not None and not body and not given:
        yield (
            f"the messages of {scan.pose_topic} do not name the frame whose pose they hold; "
            "it is taken as that of the camera"
        )
    if _OPTICAL not in camera.lower() and not given:
        yield (
            f"the axes of the frame {camera or '(no name)'} are taken as those of a camera (x right, y down, "
            "z forward), although its name does not contain 'optical'"
        )


def _near_end(step: Step) -> str:
    return (step.link.child if step.upward else step.link.parent) or "(no name)"


def _far_end(step: Step) -> str:
    return (step.link.parent if step.upward else step.link.child) or "(no name)"


def _left_out(steps: list[Step]) -> Iterator[str]:
    for link in (step.link for step in steps):
        if link.left_out:
            count = counted(link.left_out, "message")
            yield f"{count} of {link.topic} without a pose (NaN, or a quaternion of zeros)"


def _require_some(
    path: Path, steps: list[Step], times_s: list[NDArray[np.float64]], at_s: NDArray[np.float64], known: int
) -> None:
    """Check that enough images have a pose; the error says when the images and the transforms are."""
    if known >= min(_FEWEST_POSES, len(at_s)):
        return
    moving = [(step.link, times) for step, times in zip(steps, times_s, strict=True) if not step.link.is_static]
    link, times = next(((link, times) for link, times in moving if not len(times)), moving[0])
    when = f"from {times.min():.3f} s to {times.max():.3f} s" if len(times) else "without a pose"
    found = f"poses for {known} of {len(at_s)} images; the images are from 0 s to {at_s[-1]:.3f} s, {link.child} {when}"
    raise DataError(
        f"{path} {link.topic}", found, f"poses at the times of images, or {with_option('max_pose_gap_s', 'SECONDS')}"
    )
