"""Poses of the camera at the times of its images, from a chain of transforms."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.interpolation import interpolate_poses
from tracknoise.geometry.pose import invert
from tracknoise.sequences.option_text import with_option
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


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Transforms between frames. A frame that has several parents is an error only where a chain leads through it.

    Parameters
    ----------
    place
        The bag, for errors.
    by_child
        One transform by the name of its child frame.
    several
        All parents of the frames that have more than one.
    """

    place: str | Path
    by_child: dict[str, Link]
    several: dict[str, set[str]]

    @classmethod
    def of(cls, place: str | Path, links: Iterable[Link]) -> "Tree":
        """From all transforms. Of those with the same two frames, one that changes precedes a static one."""
        by_child: dict[str, Link] = {}
        parents: dict[str, set[str]] = {}
        for link in sorted(links, key=lambda link: not link.is_static):
            by_child[link.child] = link
            parents.setdefault(link.child, set()).add(link.parent)
        return cls(place, by_child, {child: found for child, found in parents.items() if len(found) > 1})

    def root_of(self, frame: str) -> str:
        """The frame at the root of the tree that a frame is in.

        Raises
        ------
        DataError
            If a frame on the way has several parents, or the transforms go in a circle.
        """
        root = self._above(frame)[-1]
        self._require_one_parent(root)
        return root

    def chain(self, target: str, source: str) -> list[Step]:
        """The steps from a source frame to a target frame, in this order.

        Raises
        ------
        DataError
            If there is no chain of transforms between them.
        """
        above_source, above_target = self._above(source), self._above(target)
        common = next((frame for frame in above_source if frame in above_target), None)
        if common is None:
            self._require_one_parent(above_source[-1], above_target[-1])
            found = f"no chain of transforms from {source or '(no name)'} to {target or '(no name)'}"
            raise DataError(
                self.place,
                found,
                f"connected frames among {self.names()}, or {with_option('body_from_camera', '[16 NUMBERS]')}",
            )
        up = above_source[: above_source.index(common)]
        down = above_target[: above_target.index(common)][::-1]
        return [Step(self.by_child[frame], True) for frame in up] + [
            Step(self.by_child[frame], False) for frame in down
        ]

    def names(self) -> str:
        """Names of all frames in one line."""
        frames = sorted({*self.by_child, *(link.parent for link in self.by_child.values())})
        return ", ".join(frames[:_SHOWN]) + (" and others" if len(frames) > _SHOWN else "") if frames else "no frames"

    def _above(self, frame: str) -> list[str]:
        """A frame, its parent, the parent of this one and so on, up to the root or to a frame with several parents."""
        frames = [frame]
        while frames[-1] in self.by_child and frames[-1] not in self.several:
            parent = self.by_child[frames[-1]].parent
            if parent in frames:
                raise DataError(self.place, f"transforms in a circle: {', '.join(frames)}", "a tree of frames")
            frames.append(parent)
        return frames

    def _require_one_parent(self, *frames: str) -> None:
        for frame in frames:
            if frame in self.several:
                parents = " and in ".join(sorted(self.several[frame]))
                raise DataError(self.place, f"frame {frame} in {parents}", "one parent frame")


def poses_along(
    steps: list[Step], times_of: Callable[[Link], NDArray[np.float64]], at_s: NDArray[np.float64], *, max_gap_s: float
) -> NDArray[np.float64]:
    """Transforms of the source frame of a chain to its target frame: each is interpolated, then they are combined.

    Parameters
    ----------
    steps
        From `Tree.chain`.
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


def _at(link: Link, times_s: NDArray[np.float64], at_s: NDArray[np.float64], max_gap_s: float) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the parent from the child at each time. Of samples with the same time, the last holds."""
    if link.is_static:
        constant = link.parent_from_child[-1] if len(times_s) else np.full((4, 4), np.nan)
        return np.broadcast_to(constant, (len(at_s), 4, 4))
    backward, last = np.unique(times_s[::-1], return_index=True)
    poses = link.parent_from_child[::-1][last]
    return interpolate_poses(backward, poses, at_s, max_gap_s=max_gap_s)
