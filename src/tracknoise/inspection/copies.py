"""Scenes that are copies of another: their images are the same."""

from collections.abc import Iterator
from collections.abc import Sequence as ListOf

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.sequences.images import content_hash
from tracknoise.sequences.sequence import Sequence

_MOST_READ = 100
"""The first image of each scene is read in data sets of at most this many scenes; in larger ones, where poses agree."""
_FIRST_POSES = 3
_MOST_COMPARED = 50


def copies(scenes: ListOf[Sequence]) -> list[tuple[Sequence, Sequence]]:
    """Scenes whose images are those of an earlier one, in the frames that both have: the copy and the earlier one.

    First images are compared, and where these are the same two later ones. The same poses with other images are a
    motion that scenes share, and no copy.
    """
    recorded = [place for place, scene in enumerate(scenes) if scene.surface is None]  # others take long to make
    every = [recorded] if len(scenes) <= _MOST_READ else []
    found: dict[int, int] = {}
    for places in [*every, *_same_poses(scenes)]:
        for place, earlier in _same_first_image(scenes, places):
            if place not in found and _same_images(scenes[earlier], scenes[place]):
                found[place] = earlier
    return [(scenes[place], scenes[found[place]]) for place in sorted(found)]


def _same_poses(scenes: ListOf[Sequence]) -> list[list[int]]:
    """Places of scenes that have the same poses in the frames that they have in common with the first of them."""
    alike: dict[bytes, list[list[int]]] = {}
    for place, scene in enumerate(scenes):
        poses = scene.world_from_camera
        groups = alike.setdefault(np.ascontiguousarray(poses[:_FIRST_POSES]).tobytes(), [])
        same = next((group for group in groups if _agree(poses, scenes[group[0]].world_from_camera)), None)
        if same is not None:
            same.append(place)
        elif len(groups) < _MOST_COMPARED:
            groups.append([place])
    return [group for groups in alike.values() for group in groups if len(group) > 1]


def _agree(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    n = min(len(one), len(other))
    return np.array_equal(one[:n], other[:n], equal_nan=True)


def _same_first_image(scenes: ListOf[Sequence], places: ListOf[int]) -> Iterator[tuple[int, int]]:
    """Places of scenes whose first image is that of an earlier one, and the place of that one."""
    first: dict[str, int] = {}
    for place in places:
        digest = _digest(scenes[place], 0)
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
