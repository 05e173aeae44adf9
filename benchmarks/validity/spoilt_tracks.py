"""Whether tracks that were spoilt on import are named, and right ones never, on simulated and recorded images.

    python -m benchmarks.validity.spoilt_tracks DATA [--only NAME ...] [--trackers NAME ...]

DATA is a folder with `tartanair_v1`, `tartanair_v2`, `tum_rgbd`, `sevenscenes` and `kitti`; what it lacks is left
out. Built-in trackers follow each recording once. Their tracks are spoilt in eight ways, and compared with the
images as those of an imported tracker are. Printed is for each recording and tracker which readings are named instead
of the spoilt ones, and how many sets of right tracks are accused: as they are, with noise, drift and outliers, few, and
shifted by half a pixel, which images cannot show.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.measurement.tracking import TrackerSetup, start_tracker
from tracknoise.sequences.reader_registry import open_sequences
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth_faults.tracks_in_images import AS_GIVEN, Reading, Tracked, wrong_reading

TRACKERS = ("lucas-kanade", "correspondence", "svo")
RECORDINGS: Mapping[str, tuple[str, str | None, Mapping[str, object]]] = {
    "simulated": ("simulated", None, {"motions": ["arvr"], "frames": 30, "width": 320, "height": 240, "seed": 6}),
    "TartanAir v1": ("tartanair", "tartanair_v1", {}),
    "TartanAir v2": ("tartanair", "tartanair_v2", {}),
    "TUM": ("tum", "tum_rgbd", {}),
    "7-Scenes": ("sevenscenes", "sevenscenes", {}),
    "KITTI": ("kitti", "kitti", {}),
}


@dataclass(frozen=True, slots=True)
class Spoilt:
    """Tracks that were changed, and the reading that is right."""

    tracked: Tracked
    right: Reading


def resized(tracked: Tracked, raster: tuple[float, float]) -> Spoilt:
    """Positions in images of another size."""
    uv = (tracked.uv + 0.5) * (np.array(raster) / np.array(tracked.size)) - 0.5
    return Spoilt(replace(tracked, uv=uv), Reading(raster=raster))


def turned(tracked: Tracked, columns: tuple[int, int]) -> Spoilt:
    """Positions whose columns are swapped or count from the other end; each of these undoes itself."""
    return Spoilt(replace(tracked, uv=Reading(columns).moved(tracked, tracked.uv)), Reading(columns))


def late(tracked: Tracked, frames: int) -> Spoilt:
    """Frame numbers that are too large; too small where negative."""
    frame = tracked.frame + frames
    kept = (frame >= 0) & (frame < tracked.n_frames)
    changed = replace(tracked, frame=frame, track=tracked.track, uv=tracked.uv, true=tracked.true)
    return Spoilt(chosen(changed, kept), Reading(later=-frames))


def shuffled(tracked: Tracked) -> Spoilt:
    """Ids that name other features in each frame."""
    rng, track = np.random.default_rng(7), tracked.track.copy()
    for frame in np.unique(tracked.frame):
        rows = np.flatnonzero(tracked.frame == frame)
        track[rows] = rng.permutation(track[rows])
    return Spoilt(replace(tracked, track=track), Reading(shuffled=True))


SPOILS: Mapping[str, Callable[[Tracked], Spoilt]] = {
    "resized to 256 x 256": lambda tracked: resized(tracked, (256, 256)),
    "half the size": lambda tracked: resized(tracked, (tracked.size[0] / 2, tracked.size[1] / 2)),
    "u and v swapped": lambda tracked: turned(tracked, (2, 1)),
    "v upwards": lambda tracked: turned(tracked, (1, -2)),
    "u to the left": lambda tracked: turned(tracked, (-1, 2)),
    "frames from 1": lambda tracked: late(tracked, 1),
    "3 frames early": lambda tracked: late(tracked, -3),
    "ids shuffled": shuffled,
}


def chosen(tracked: Tracked, kept: NDArray[np.bool_]) -> Tracked:
    """Some of the observations."""
    parts = {name: getattr(tracked, name)[kept] for name in ("track", "frame", "uv", "true")}
    return replace(tracked, **parts)


def right_tracks(tracked: Tracked) -> Iterator[tuple[str, Tracked]]:
    """The same tracks as worse trackers would report them."""
    rng, uv = np.random.default_rng(3), tracked.uv
    yield "as they are", tracked
    for sigma in (1.0, 2.0):
        yield f"noise of {sigma:g} px", replace(tracked, uv=uv + rng.normal(0.0, sigma, uv.shape))
    order = np.lexsort([tracked.frame, tracked.track])
    begins = np.diff(tracked.track[order], prepend=-1) != 0
    steps = np.where(begins[:, None], 0.0, rng.normal(0.0, 0.2, uv.shape))
    walk = np.cumsum(steps, axis=0)
    drift = np.empty_like(uv)
    drift[order] = walk - walk[np.flatnonzero(begins)][np.cumsum(begins) - 1]
    yield "drift of 0.2 px per frame", replace(tracked, uv=uv + drift)
    outliers = rng.random(len(uv)) < 0.2
    yield "20 % outliers", replace(tracked, uv=np.where(outliers[:, None], uv + rng.normal(0.0, 15.0, uv.shape), uv))
    names = rng.permutation(np.unique(tracked.track))
    share = min(60.0 / np.bincount(tracked.frame).mean(), 1.0)
    yield "60 features", chosen(tracked, np.isin(tracked.track, names[: int(share * len(names))]))
    yield "half a pixel", replace(tracked, uv=uv + 0.5)


def followed(sequence: Sequence, tracker: str) -> Tracked:
    """What a built-in tracker reports."""
    setup = TrackerSetup(tracker, make_tracker(tracker), 1)
    run = start_tracker(setup, sequence, None, 0, len(sequence))
    steps = [run.step(Frame(index, sequence.image(index))) for index in range(len(sequence))]
    uv = np.concatenate([step.uv for step in steps])
    frame = np.repeat(np.arange(len(steps)), [len(step.ids) for step in steps])
    size = sequence.camera.width, sequence.camera.height
    track = np.concatenate([step.ids for step in steps])
    return Tracked(track, frame, uv, np.full_like(uv, np.nan), size, size, len(sequence))


def lines(name: str, sequence: Sequence, trackers: list[str]) -> Iterator[str]:
    """What is printed of a recording."""
    image = cache(sequence.image)
    for tracker in trackers:
        tracked = followed(sequence, tracker)
        found = {
            spoil: (spoilt := make(tracked), wrong_reading(spoilt.tracked, image)) for spoil, make in SPOILS.items()
        }
        others = [f"{spoil}: {_text(one)}" for spoil, (spoilt, one) in found.items() if one != spoilt.right]
        named = sum(one is not None for _, one in found.values())
        yield f"{name}, {tracker}: {named} of {len(found)} named, {len(found) - len(others)} rightly"
        yield from (f"    {other}" for other in others)
        accused = {kind: one for kind, right in right_tracks(tracked) if (one := wrong_reading(right, image))}
        yield f"    right tracks accused: {'none' if not accused else ''}"
        yield from (f"        {kind}: {_text(one)}" for kind, one in accused.items())


def _text(found: Reading | None) -> str:
    """A reading by what differs from that as given."""
    if found is None:
        return "not determined"
    names = ("columns", "raster", "later", "shuffled")
    return ", ".join(
        f"{name} {getattr(found, name)}" for name in names if getattr(found, name) != getattr(AS_GIVEN, name)
    )


def main() -> None:
    """Print what is found of each recording."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="*", default=list(RECORDINGS))
    parser.add_argument("--trackers", nargs="*", default=list(TRACKERS))
    given = parser.parse_args()
    for name in given.only:
        reader, folder, options = RECORDINGS[name]
        root = None if folder is None else given.data / folder
        if root is not None and not root.exists():
            print(f"{name}: {root} is missing")
            continue
        for line in lines(name, next(iter(open_sequences(reader, root, **options))), given.trackers):
            print(line, flush=True)


if __name__ == "__main__":
    main()
