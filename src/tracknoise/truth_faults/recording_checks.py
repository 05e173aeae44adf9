"""Topics about the recording itself: counts, rates, jumps of poses, and whether scenes are independent."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as ListOf
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import first_visits
from tracknoise.sequences.images import content_hash
from tracknoise.sequences.sequence import Sequence, caveats_of, group_of
from tracknoise.text import counted, counted_of, significant
from tracknoise.truth_faults.check_report import Item, Severity, Values
from tracknoise.truth_faults.image_evidence import focal_px, principal_point

_GAP_STEPS = 1.75
_FOCAL_RANGE = 0.25, 4.0
_CENTRE_SHARE = 0.15


def counts(sequence: Sequence) -> Item:
    """Number and size of images, and how many frames have a pose."""
    n = len(sequence)
    posed = int(np.isfinite(sequence.world_from_camera).all(axis=(1, 2)).sum())
    camera = sequence.camera
    size = f"{camera.width}x{camera.height} px"
    have = "has" if posed == 1 else "have"
    text = f"{counted(n, 'image')} of {size}; {posed} of them {have} a pose."
    if n == 1:
        text = f"1 image of {size}, {'with' if posed else 'without'} a pose."
    values: Values = {"n_frames": n, "n_poses": posed, "width_px": camera.width, "height_px": camera.height}
    if posed < 2:
        return Item("counts", Severity.fatal, f"{text} At least 2 poses are needed.", values)
    if posed < n:
        return Item("counts", Severity.caveat, f"{text} The other frames have no truth.", values)
    return Item("counts", Severity.ok, text, values)


def timestamps(sequence: Sequence) -> Item:
    """Rate and gaps."""
    times = sequence.timestamps_s
    if times is None or len(times) < 2:
        return Item("timestamps", Severity.unknown, "There are no timestamps: rates and gaps are unknown.")
    steps = np.diff(times)
    step = float(np.median(steps))
    gaps = int((steps > _GAP_STEPS * step).sum())
    rate = 1.0 / step
    exceed = counted_of(gaps, len(steps), "interval", "exceeds", "exceed")
    text = f"Images come at {significant(rate, 4)} Hz. {exceed} {_GAP_STEPS:g} times the median."
    values: Values = {"rate_hz": rate, "n_gaps": gaps, "longest_s": float(steps.max())}
    if gaps > 0.02 * len(steps) and gaps > 1:
        return Item("timestamps", Severity.caveat, f"{text} Ages count frames, not time.", values)
    return Item("timestamps", Severity.ok, text, values)


def reader_notes(sequence: Sequence) -> list[Item]:
    """What the reader corrected or assumed, rotations that are not orthonormal among it, and its caveats."""
    caveats = caveats_of(sequence)
    return [
        Item("reader", Severity.caveat if note in caveats else Severity.ok, note if note.endswith(".") else f"{note}.")
        for note in sequence.notes
    ]


def rotations(sequence: Sequence) -> Item:
    """Whether rotations are orthonormal."""
    poses = _known_poses(sequence)
    error = np.abs(poses[:, :3, :3] @ np.swapaxes(poses[:, :3, :3], 1, 2) - np.eye(3)).max(initial=0.0)
    values: Values = {"deviation": float(error)}
    if error > 1e-6:
        text = f"Rotations are not orthonormal: entries deviate by up to {error:.2g}."
        return Item("rotations", Severity.fatal, text, values)
    return Item("rotations", Severity.ok, f"Rotations are orthonormal to {max(error, 1e-15):.1g}.", values)


def intrinsics(sequence: Sequence) -> Item:
    """Whether focal length and principal point can belong to images of this size."""
    camera = sequence.camera
    focal, centre = focal_px(camera), principal_point(camera)
    relative = focal / camera.width
    off = np.abs(centre - ((camera.width - 1) / 2, (camera.height - 1) / 2)) / (camera.width, camera.height)
    values: Values = {"focal_px": focal, "cx_px": float(centre[0]), "cy_px": float(centre[1])}
    text = (
        f"The focal length is {significant(focal, 4)} px, {relative:.2f} times the width. "
        f"The principal point is ({centre[0]:.1f}, {centre[1]:.1f})."
    )
    if not _FOCAL_RANGE[0] <= relative <= _FOCAL_RANGE[1]:
        text += " Such a focal length is unusual for images of this size."
        return Item("intrinsics", Severity.caveat, text, values)
    if off.max() > _CENTRE_SHARE:
        text += f" It is {off.max():.0%} of the size of the image away from the centre."
        return Item("intrinsics", Severity.caveat, text, values)
    return Item("intrinsics", Severity.ok, text, values)


def _known_poses(sequence: Sequence) -> NDArray[np.float64]:
    poses = sequence.world_from_camera
    known_poses: NDArray[np.float64] = poses[np.isfinite(poses).all(axis=(1, 2))]
    return known_poses


_JUMP_STEPS, _JUMP_AROUND = 8.0, 3.0
"""A jump is this many times the median step, and this many times the steps around it."""
_JUMP_DEG, _JUMP_M = 1.0, 0.02
"""A jump is at least this large."""
_AWAY = (2, 3)
"""Frames from the pose before one or two wrong poses to the pose after them."""


def pose_jumps(sequence: Sequence) -> Item:
    """Steps of the camera that are far larger than their neighbours."""
    poses = sequence.world_from_camera
    moved_m, turned_deg = steps_of(poses)
    has_step = np.isfinite(moved_m)
    if has_step.sum() < 3:
        return Item("pose jumps", Severity.unknown, "There are too few poses in a row to look for jumps.")
    (far, jumped_m), (wide, jumped_deg) = (
        _jumps(steps, [steps_of(poses, frames)[kind] for frames in _AWAY], least)
        for kind, (steps, least) in enumerate(((moved_m, _JUMP_M), (turned_deg, _JUMP_DEG)))
    )
    jumped, returns = jumped_m | jumped_deg, far | wide
    worst = int(np.nanargmax(np.where(jumped, moved_m / _median(moved_m) + turned_deg / _median(turned_deg), -1.0)))
    median_m, median_deg = float(np.nanmedian(moved_m)), float(np.nanmedian(turned_deg))
    values: Values = {"n_jumps": int(jumped.sum()), "median_step_m": median_m, "median_step_deg": median_deg}
    typical = f"The median step is {significant(median_m, 3)} m and {significant(median_deg, 3)} deg"
    if not jumped.any():
        return Item("pose jumps", Severity.ok, f"{typical}; no step is far larger than those around it.", values)
    text = (
        f"Poses jump in {counted(int(jumped.sum()), 'place')}. The largest jump follows frame {worst}: "
        f"{significant(moved_m[worst], 3)} m and {significant(turned_deg[worst], 3)} deg"
        f"{', and back' if returns[worst] else ''}. {typical}."
    )
    return Item("pose jumps", Severity.caveat, text, {**values, "worst_frame": worst})


_MOST_OF_VIEW = 0.5
"""Neighbouring views that turn by more than this part of the field of view have too little in common."""


def view_changes(sequence: Sequence) -> Item | None:
    """Whether neighbouring views turn so far that no feature is in both; None where they do not."""
    turned_deg = steps_of(sequence.world_from_camera)[1]
    if not np.isfinite(turned_deg).any():
        return None
    camera = sequence.camera
    middle = (camera.height - 1) / 2
    left, right = camera.bearings(np.array([[0.0, middle], [camera.width - 1.0, middle]]))
    seen_deg = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)))
    median_deg = float(np.nanmedian(turned_deg))
    if not median_deg > _MOST_OF_VIEW * seen_deg:
        return None
    text = (
        f"No tracker can follow: neighbouring views turn by {significant(median_deg, 2)} degrees in the median, with a "
        f"field of view of {significant(seen_deg, 2)} degrees. These are probably photos in no order, not frames of "
        "one camera path."
    )
    return Item("views", Severity.fatal, text, {"turned_deg": median_deg, "field_of_view_deg": seen_deg})


_MOST_REPEATED = 0.1


def repeated_frames(sequence: Sequence) -> Item | None:
    """Frames with exactly the pose of an earlier one, which the camera has left since; None where there are few."""
    visits = first_visits(sequence.world_from_camera)
    repeated = int(np.sum(visits < np.arange(len(visits))))
    if repeated <= _MOST_REPEATED * len(visits):
        return None
    text = (
        f"The recording repeats itself: {repeated} of {len(visits)} frames have exactly the pose of an earlier one. "
        "Intervals are too narrow; measure one pass."
    )
    return Item("repeated frames", Severity.caveat, text, {"n_repeated": repeated})


_STILL_PX, _SEEN_PX = 1e-3, 0.05
"""Image motion of repeated images, and what faster images of such a recording have at least, px."""
_SMALL_STEP = 0.25
"""Part of the median step that a camera moves at least where its images should differ."""


def repeated_images(poses: NDArray[np.float64], motion_px: Mapping[int, float], apart: int = 1) -> Item | None:
    """Images that show what the one before shows, although the camera has moved; None where there are none.

    `motion_px`: image motion of most points since the image `apart` frames before, by frame.
    """
    if len(motion_px) < 2 or np.percentile([*motion_px.values()], 90) < _SEEN_PX:
        return None
    has_moved = np.zeros(max(len(poses) - apart, 0), np.bool_)
    for steps in steps_of(poses, apart):
        has_moved |= np.nan_to_num(steps) > _SMALL_STEP * _median(steps)
    repeated = [frame for frame, seen_px in motion_px.items() if seen_px < _STILL_PX and has_moved[frame - apart]]
    if not repeated:
        return None
    text = (
        f"Images repeat: {len(repeated)} of {len(motion_px)} show what the one before shows, although the poses move. "
        f"The first is frame {min(repeated)}. Errors there are not the tracker's."
    )
    return Item("repeated images", Severity.caveat, text, {"n_repeated": len(repeated), "first": min(repeated)})


def steps_of(poses: NDArray[np.float64], frames: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n - frames,) float64 each: distance (m) and angle (deg) from each pose to a later one; NaN without a pose."""
    moved = np.linalg.norm(poses[frames:, :3, 3] - poses[:-frames, :3, 3], axis=1)
    relative = np.swapaxes(poses[:-frames, :3, :3], 1, 2) @ poses[frames:, :3, :3]
    off_axis = np.stack([relative[:, 2, 1], relative[:, 0, 2], relative[:, 1, 0]], axis=1)
    off_axis -= np.stack([relative[:, 1, 2], relative[:, 2, 0], relative[:, 0, 1]], axis=1)
    sine, cosine = np.linalg.norm(off_axis, axis=1) / 2, (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    return moved, np.degrees(np.arctan2(sine, cosine))


def _jumps(
    steps: NDArray[np.float64], across: list[NDArray[np.float64]], least: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Steps (n,) that one of the next two undoes, and jumps: those far above the median of all and their neighbours.

    `across`: how far it is over two steps, and over three. A step and the one that undoes it are one jump.
    """
    padded = np.pad(np.nan_to_num(steps), 2)
    before, after = [padded[1:-3].copy(), padded[:-4].copy()], [padded[3:-1].copy(), padded[4:].copy()]
    undone, undoing = np.zeros((2, len(steps)), np.bool_)
    for apart, over in enumerate(across, start=1):
        first = np.flatnonzero(np.minimum(steps[:-apart], steps[apart:]) > _JUMP_AROUND * over)
        after[apart - 1][first] = before[apart - 1][first + apart] = 0.0
        undone[first] = undoing[first + apart] = True
    around = np.max([*before, *after], axis=0)
    large = (steps > least) & (steps > _JUMP_STEPS * _median(steps)) & (steps > _JUMP_AROUND * around)
    return undone, np.asarray(large & (undone | ~undoing), dtype=np.bool_)


def _median(values: NDArray[np.float64]) -> float:
    """The median, which steps are divided by: never 0."""
    finite = values[np.isfinite(values)]
    return max(float(np.median(finite)), 1e-12) if len(finite) else 1e-12


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
    groups = [recorded] if len(scenes) <= _MOST_READ else []
    earlier_of: dict[int, int] = {}
    for places in [*groups, *_same_poses(scenes)]:
        for place, earlier in _same_first_image(scenes, places):
            if place not in earlier_of and _same_images(scenes[earlier], scenes[place]):
                earlier_of[place] = earlier
    return [(scenes[place], scenes[earlier_of[place]]) for place in sorted(earlier_of)]


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


def _agree(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    n = min(len(first), len(second))
    return np.array_equal(first[:n], second[:n], equal_nan=True)


def _same_first_image(scenes: ListOf[Sequence], places: ListOf[int]) -> Iterator[tuple[int, int]]:
    """Places of scenes whose first image is that of an earlier one, and the place of that one."""
    first: dict[str, int] = {}
    for place in places:
        digest = _digest(scenes[place], 0)
        if digest is not None and (earliest := first.setdefault(digest, place)) != place:
            yield place, earliest


def _same_images(first: Sequence, second: Sequence) -> bool:
    last = min(len(first), len(second)) - 1
    digests = [(_digest(first, index), _digest(second, index)) for index in sorted({0, last // 2, last})]
    return all(a is not None and a == b for a, b in digests)


def _digest(scene: Sequence, index: int) -> str | None:
    """Hash of an image; None where it cannot be read, or is of one gray value."""
    try:
        return content_hash(scene.image(index))
    except DataError:
        return None


_MOST_STEPS = 3.0
"""A scene continues another if it begins within this many median steps, in place and in time, of the other's end."""
_MOST_NAMED = 5


def independence(sequences: ListOf[Sequence]) -> Item | None:
    """Scenes that continue the poses of another, or are copies of another; None for a single scene."""
    scenes = {sequence.id.scene: sequence for sequence in sequences}
    if len(scenes) < 2:
        return None
    ordered = [scenes[name] for name in sorted(scenes)]
    continued = [(a.id.scene, b.id.scene) for a, b in pairwise(ordered) if _continues(a, b)]
    copied = [(a.id.scene, b.id.scene) for a, b in copies(ordered)]
    values: Values = {"n_scenes": len(scenes), "n_continued": len(continued), "n_copies": len(copied)}
    if not continued and not copied:
        text = f"There are {len(scenes)} scenes; none continues the poses of another, and none is a copy."
        return Item("independence", Severity.ok, text, values)
    return Item("independence", Severity.caveat, " ".join(_sentences(len(scenes), continued, copied)), values)


def _sentences(n_scenes: int, continued: ListOf[tuple[str, str]], copied: ListOf[tuple[str, str]]) -> Iterator[str]:
    if continued:
        named = ", ".join(f"{b} continues {a}" for a, b in continued[:_MOST_NAMED])
        yield (
            f"{len(continued) + 1} of {n_scenes} scenes are pieces of one recording ({named}). They are not "
            "independent: declare them as a group with dataset.groups."
        )
    if copied:
        named = ", ".join(f"{a} those of {b}" for a, b in copied[:_MOST_NAMED])
        are = "is a copy" if len(copied) == 1 else "are copies"
        yield (
            f"{len(copied)} of {n_scenes} scenes {are}, with the images of another ({named}). Copies are not "
            "independent: leave them out with dataset.scenes."
        )


def _continues(first: Sequence, second: Sequence) -> bool:
    """Whether one begins where and when the other ends. Scenes that their reader groups are known already."""
    is_grouped = group_of(first) is not None and group_of(first) == group_of(second)
    end, begin = first.world_from_camera[-1], second.world_from_camera[0]
    if is_grouped or min(len(first), len(second)) < 3 or _apart_in_time(first, second):
        return False
    if not (np.isfinite(end).all() and np.isfinite(begin).all()) or np.allclose(begin, np.eye(4), atol=1e-9):
        return False  # a recording that begins at the origin of its own world continues no other
    moved, turned = steps_of(np.stack([end, begin]))
    steps = [np.stack(steps_of(scene.world_from_camera)) for scene in (first, second)]
    typical = [of_scene[:, np.isfinite(of_scene).all(axis=0)] for of_scene in steps]
    if not all(of_scene.size for of_scene in typical):
        return False  # of a scene without two poses in a row, a typical step is not known
    most_m, most_deg = np.max([np.median(of_scene, axis=1) for of_scene in typical], axis=0)
    return bool(moved[0] <= _MOST_STEPS * most_m and turned[0] <= _MOST_STEPS * max(most_deg, 0.01))


def _apart_in_time(first: Sequence, second: Sequence) -> bool:
    """Whether both have timestamps of one clock, and the second does not follow the first within a few frames.

    Times may have any origin. Where both scenes begin at the same time, it is that of the first frame of each, and says
    nothing.
    """
    before, after = first.timestamps_s, second.timestamps_s
    if before is None or after is None or before[0] == after[0]:
        return False
    return not 0.0 < after[0] - before[-1] <= _MOST_STEPS * float(np.median(np.diff(before)))
