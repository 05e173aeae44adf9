"""Scenes that are copies of another: their images are the same."""

from collections.abc import Iterator
from collections.abc import Sequence as ListOf

import numpy as np

from tracknoise.exceptions import DataError
from tracknoise.sequences.images import content_hash
from tracknoise.sequences.sequence import Sequence

_MOST_READ = 100
"""The first image of each scene is read in data sets of at most this many scenes; in larger ones, where poses agree."""
_FIRST_POSES = 3
_MOST_COMPARED = 50


def copies(scenes: ListOf[Sequence]) -> list[tuple[Sequence, Sequence]]:
    """Scenes whose images are those of an earlier one, in the frames that both have: the copy and the earlier one.

    Scenes with the same poses are compared, and scenes with the same first image. Three images decide. The same poses
    with other images are a motion that scenes share, and no copy.
    """
    found: dict[int, tuple[Sequence, Sequence]] = {}
    for place, earlier in [*_same_poses(scenes), *_same_first_image(scenes)]:
        if place not in found and _same_images(scenes[earlier], scenes[place]):
            found[place] = scenes[place], scenes[earlier]
    return [found[place] for place in sorted(found)]


def _same_poses(scenes: ListOf[Sequence]) -> Iterator[tuple[int, int]]:
    """Places of scenes with the poses of an earlier one in the frames that both have, and of that one."""
    alike: dict[bytes, list[int]] = {}
    for place, scene in enumerate(scenes):
        poses = scene.world_from_camera
        others = alike.setdefault(np.ascontiguousarray(poses[:_FIRST_POSES]).tobytes(), [])
        for other in others:
            n = min(len(poses), len(scenes[other]))
            if np.array_equal(poses[:n], scenes[other].world_from_camera[:n], equal_nan=True):
                yield place, other
                break
        else:
            if len(others) < _MOST_COMPARED:
                others.append(place)


def _same_first_image(scenes: ListOf[Sequence]) -> Iterator[tuple[int, int]]:
    """The same of first images. Those of simulated scenes take long to make, and are not compared."""
    if len(scenes) > _MOST_READ:
        return
    first: dict[str, int] = {}
    for place, scene in enumerate(scenes):
        digest = None if scene.surface is not None else _digest(scene, 0)
        if digest is not None and (other := first.setdefault(digest, place)) != place:
            yield place, other


def _same_images(one: Sequence, other: Sequence) -> bool:
    last = min(len(one), len(other)) - 1
    digests = [(_digest(one, index), _digest(other, index)) for index in sorted({0, last // 2, last})]
    return all(a is not None and a == b for a, b in digests)


def _digest(scene: Sequence, index: int) -> str | None:
    """Hash of an image; None where it cannot be read, or is of one gray value."""
    try:
        return content_hash(scene.image(index))
    except DataError:
        return None
