"""Poses of the camera at the times of its images, from a chain of transforms."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.interpolation import interpolate_poses
from tracknoise.geometry.pose import invert
from tracknoise.sequences.rosbag.links import Link

_SHOWN = 12


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a chain of frames: a transform, or its inverse.

    Parameters
    ----------
    link
        The transform.
    upward
        Whether the step goes from the child frame to its parent.
    """

    link: Link
    upward: bool


def tree(place: str | Path, links: Iterable[Link]) -> dict[str, Link]:
    """Transforms by child frame. Of static transforms with the same two frames, the last holds.

    Raises
    ------
    DataError
        If a frame has several parents.
    """
    found: dict[str, Link] = {}
    for link in links:
        other = found.get(link.child)
        if other is not None and other.parent != link.parent:
            raise DataError(place, f"frame {link.child} in {other.parent} and in {link.parent}", "one parent frame")
        both = (other, link) if other is not None else (link,)
        found[link.child] = next((one for one in both if not one.is_static), link)
    return found


def root_of(place: str | Path, by_child: dict[str, Link], frame: str) -> str:
    """The frame at the root of the tree that a frame is in.

    Raises
    ------
    DataError
        If the transforms go in a circle.
    """
    visited = [frame]
    while frame in by_child:
        frame = by_child[frame].parent
        if frame in visited:
            raise DataError(place, f"transforms in a circle: {', '.join(visited)}", "a tree of frames")
        visited.append(frame)
    return frame


def chain(place: str | Path, by_child: dict[str, Link], target: str, source: str) -> list[Step]:
    """The steps from a source frame to a target frame, in this order.

    Raises
    ------
    DataError
        If there is no chain of transforms between them.
    """
    root_of(place, by_child, source)
    above_source, above_target = _ancestry(by_child, source), _ancestry(by_child, target)
    common = next((frame for frame in above_source if frame in above_target), None)
    if common is None:
        found = f"no chain of transforms from {source or '(no name)'} to {target or '(no name)'}"
        raise DataError(place, found, f"connected frames among {frame_list(by_child)}, or body_from_camera")
    up = above_source[: above_source.index(common)]
    down = above_target[: above_target.index(common)][::-1]
    return [Step(by_child[frame], True) for frame in up] + [Step(by_child[frame], False) for frame in down]


def poses_along(
    steps: list[Step], times_of: Callable[[Link], NDArray[np.float64]], at_s: NDArray[np.float64], *, max_gap_s: float
) -> NDArray[np.float64]:
    """Transforms of the source frame of a chain to its target frame: each is interpolated, then they are combined.

    Parameters
    ----------
    steps
        From `chain`.
    times_of
        Times of the samples of a link, (k,) float64, seconds.
    at_s
        (n,) float64, seconds.
    max_gap_s
        Longest time between two samples that are interpolated, seconds.

    Returns
    -------
    (n, 4, 4) float64
        ``target_from_source``; NaN where a transform is not known.
    """
    poses = np.broadcast_to(np.eye(4), (len(at_s), 4, 4))
    for step in steps:
        parent_from_child = _at(step.link, times_of(step.link), at_s, max_gap_s)
        poses = (parent_from_child if step.upward else invert(parent_from_child)) @ poses
    found = poses.copy()
    found[~np.isfinite(found).all(axis=(1, 2))] = np.nan
    return found


def frame_list(by_child: dict[str, Link]) -> str:
    """Names of all frames in one line."""
    frames = sorted({*by_child, *(link.parent for link in by_child.values())})
    return ", ".join(frames[:_SHOWN]) + (" and others" if len(frames) > _SHOWN else "") if frames else "no frames"


def _ancestry(by_child: dict[str, Link], frame: str) -> list[str]:
    """A frame, its parent, the parent of this one, and so on."""
    frames = [frame]
    while frames[-1] in by_child and by_child[frames[-1]].parent not in frames:
        frames.append(by_child[frames[-1]].parent)
    return frames


def _at(link: Link, times_s: NDArray[np.float64], at_s: NDArray[np.float64], max_gap_s: float) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the parent from the child at each time. Of samples with the same time, the last holds."""
    if link.is_static:
        constant = link.parent_from_child[-1] if len(times_s) else np.full((4, 4), np.nan)
        return np.broadcast_to(constant, (len(at_s), 4, 4))
    backward, last = np.unique(times_s[::-1], return_index=True)
    poses = link.parent_from_child[::-1][last]
    return interpolate_poses(backward, poses, at_s, max_gap_s=max_gap_s)
