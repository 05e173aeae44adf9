"""Reasons to doubt the data of a sequence, from what was measured in it; images are read again for a second camera.

What changes gradually, such as errors of poses, is not among them: how much of the errors it explains is measured
(`tracknoise.truth_faults.assessment`).
"""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.experiments.settings import SYNTHETIC
from tracknoise.sequences.depth_samples import edge_share, sampled_depths
from tracknoise.sequences.sequence import SWEPT, TRIANGULATED, Sequence, TruthKind
from tracknoise.tables.schema import of_second_camera
from tracknoise.text import significant
from tracknoise.truth_faults.check_report import Item, Severity
from tracknoise.truth_faults.depth_checks import FARTHEST_M, NEAREST_M, clipped_depth
from tracknoise.truth_faults.image_evidence import FEWEST_POINTS, Evidence, Flow, Pair, seen_by_one_camera
from tracknoise.truth_faults.motion_checks import mistakes
from tracknoise.truth_faults.recording_checks import (
    intrinsics,
    pose_jumps,
    repeated_frames,
    repeated_images,
    timestamps,
    view_changes,
)
from tracknoise.truth_faults.rig_check import is_of_pair, second_camera

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement

_MOST_PAIRS, _MOST_POINTS = 24, 150
_BASELINES = 1, 2, 3, 4, 6, 8, 12, 16, 24
_YOUNG_FRAMES = 5
_STILL_SHARE = 0.95
"""Share of the tracks that stand still where an image repeats."""
_RIVAL_SHARE, _LEAST_ERROR_PX = 0.8, 1.0
_HIDDEN_SHARE = 0.5
_KNOWN = ("valid", "occluded", "out_of_image", "behind_camera")


@dataclass(frozen=True, slots=True)
class Doubts:
    """Sentences that say why the data of a sequence look wrong, the most telling first."""

    mistakes: tuple[str, ...] = ()  # with any of them, errors are not those of the trackers
    cautions: tuple[str, ...] = ()  # about single parts of the data, such as one jump of the poses


def doubts(measurement: "Measurement", kinds: Mapping[str, str]) -> Doubts:
    """Why the data of a sequence look wrong; nothing where only synthetic trackers saw it.

    `kinds`: of trackers, by name. Without any, only poses and intrinsics are asked.
    """
    if not kinds:
        return _split(_of_poses(measurement.sequence))
    beside = of_second_camera(measurement.observations)
    of_images = [name for name, kind in kinds.items() if kind not in SYNTHETIC and name not in beside]
    observed = measurement.observations.filter(pl.col("tracker").is_in(of_images))
    if observed.is_empty():
        return _split(_of_second_camera(measurement)) if beside else Doubts()
    if (views := view_changes(measurement.sequence)) is not None:
        return Doubts((views.text,))
    slowest = observed.filter(pl.col("speed") == observed["speed"].min())
    of_first = slowest.filter(tracker=slowest["tracker"][0])
    items = [
        *_of_poses(measurement.sequence),
        *_of_repeated(measurement.sequence, of_first),
        *_of_mistakes(measurement, of_first),
        *_of_second_camera(measurement),
    ]
    mistakes_and_cautions = _split(items)
    return Doubts(
        (*mistakes_and_cautions.mistakes, *_of_errors(slowest), *_of_depths(measurement)),
        mistakes_and_cautions.cautions,
    )


def _split(items: Items[Item]) -> Doubts:
    """Sentences of items by what they mean."""
    fatal = tuple(item.text for item in items if item.severity is Severity.fatal)
    return Doubts(fatal, tuple(item.text for item in items if item.severity is Severity.caveat))


def depth_edges(measurement: "Measurement") -> float:
    """Share of the pixels with depth at which depths of neighbours differ; 0 where features have no depth of a map."""
    if measurement.truth != TruthKind.birth:
        return 0.0
    return edge_share(measurement.sequence, sampled_depths(measurement.sequence, measurement.n_frames))


def _of_poses(sequence: Sequence) -> list[Item]:
    """Topics that need times, poses and intrinsics alone."""
    items = [timestamps(sequence), pose_jumps(sequence), intrinsics(sequence), repeated_frames(sequence)]
    return [item for item in items if item is not None]


def doubts_of_parts(sequence: Sequence, parts: Items[tuple[range, Doubts]]) -> Doubts:
    """Those of a sequence that was measured in parts, of each of which they are known.

    What its poses say is said of all of it. What is a mistake in at least half of the parts is one of the sequence,
    reported as in the first of them.
    """
    if (views := view_changes(sequence)) is not None:
        return Doubts((views.text,))
    of_poses = _split(_of_poses(sequence))
    wrong = [(frames, of_part.mistakes) for frames, of_part in parts if of_part.mistakes]
    reported = [f"Frames {frames[0]} to {frames[-1]}: {texts[0]}" for frames, texts in wrong]
    if reported and 2 * len(wrong) >= len(parts):
        return Doubts((*of_poses.mistakes, reported[0]), of_poses.cautions)
    return Doubts(of_poses.mistakes, (*of_poses.cautions, *reported[:1]))


def _of_repeated(sequence: Sequence, observed: pl.DataFrame) -> list[Item]:
    """Images in which no track has moved since the image before, although the poses have."""
    apart = int(observed["speed"][0])
    now = observed.select("track", "frame", "u_px", "v_px")
    before = now.with_columns(pl.col("frame") + apart).rename({"u_px": "u", "v_px": "v"})
    moved = (pl.col("u_px") - pl.col("u")) ** 2 + (pl.col("v_px") - pl.col("v")) ** 2
    of_most = moved.quantile(_STILL_SHARE).sqrt()  # whole pixels of slow tracks often repeat
    steps = now.join(before, on=["track", "frame"]).group_by("frame").agg(motion_px=of_most)
    motion_px = dict(steps.select("frame", "motion_px").sort("frame").iter_rows())
    item = repeated_images(sequence.world_from_camera, motion_px, apart)
    return [] if item is None else [item]


def _of_mistakes(measurement: "Measurement", observed: pl.DataFrame) -> list[Item]:
    """The usual mistakes and clipped depths, from the tracks of one tracker."""
    sequence = measurement.sequence
    born = measurement.truth in (TruthKind.birth, TruthKind.raycast)
    pairs = tuple(_pairs(observed, _depths_at_birth(measurement, observed) if born else {}))
    poses = sequence.world_from_camera[: measurement.n_frames]
    seen = seen_by_one_camera(Flow(pairs, ()), sequence)
    evidence = Evidence.stated(seen, poses, sequence)
    named = mistakes(evidence)
    clipped = clipped_depth(evidence) if named.severity is not Severity.fatal else None
    return [named, *filter(None, [clipped])]


def _of_second_camera(measurement: "Measurement") -> list[Item]:
    """What is wrong with the second camera, where it tells depths or trackers see it.

    Its distance alone counts only where trackers see it: depths of a sweep do not use a camera whose distance does not
    fit the poses.
    """
    is_seen = bool(of_second_camera(measurement.observations))
    if not (is_seen or measurement.truth == SWEPT or is_of_pair(measurement.sequence)):
        return []
    item = second_camera(measurement.sequence)
    if item is None or item.severity not in ((Severity.fatal, Severity.caveat) if is_seen else (Severity.fatal,)):
        return []
    return [replace(item, severity=Severity.fatal)]


def _depths_at_birth(measurement: "Measurement", observed: pl.DataFrame) -> dict[int, float]:
    tracker, speed = observed["tracker"][0], observed["speed"][0]
    tracks = measurement.tracks.filter(tracker=tracker, speed=speed).drop_nulls("depth_m")
    return dict(zip(tracks["track"].to_list(), tracks["depth_m"].to_list(), strict=True))


def _pairs(observed: pl.DataFrame, depths_m: Mapping[int, float]) -> Iterator[Pair]:
    """Tracks from the frame in which they began to some frames later, spread evenly over the sequence."""
    step = int(observed["speed"][0])
    born = observed.filter(pl.col("age") == 0).select("track", first="frame", u="u_px", v="v_px")
    later = observed.filter(pl.col("age").is_in([step * baseline for baseline in _BASELINES]))
    joined = later.join(born, on="track", maintain_order="left")
    groups = joined.partition_by("first", "frame", maintain_order=True)
    enough = sorted(
        (group for group in groups if group.height >= FEWEST_POINTS),
        key=lambda group: group.row(0, named=True)["first"],
    )
    for place in np.unique(np.linspace(0, len(enough) - 1, min(_MOST_PAIRS, len(enough))).astype(int)).tolist():
        yield _pair(enough[place].head(_MOST_POINTS), depths_m)


def _pair(group: pl.DataFrame, depths_m: Mapping[int, float]) -> Pair:
    depth = np.array([depths_m.get(track, np.nan) for track in group["track"].to_list()])
    return Pair(
        first=int(group["first"][0]),
        second=int(group["frame"][0]),
        uv_first=group.select("u", "v").to_numpy(),
        uv_second=group.select("u_px", "v_px").to_numpy(),
        depth_first_m=depth,
        depth_second_m=np.full(len(depth), np.nan),
    )


def _of_errors(observed: pl.DataFrame) -> Iterator[str]:
    """What the errors and statuses of young tracks say."""
    young = observed.filter(pl.col("age").is_between(1, _YOUNG_FRAMES * int(observed["speed"][0])))
    with_truth = young.filter(pl.col("truth").is_in(_KNOWN))
    if with_truth.height >= FEWEST_POINTS:
        share = with_truth.filter(pl.col("truth") != "valid").height / with_truth.height
        if share > _HIDDEN_SHARE:
            yield (
                f"{share:.0%} of true positions are occluded or out of the image right after features were found. "
                "Poses, depth or intrinsics are probably wrong."
            )
    yield from _rivals(observed, young)


def _rivals(observed: pl.DataFrame, young: pl.DataFrame) -> Iterator[str]:
    """Errors as large as the image motion."""
    born = observed.filter(pl.col("age") == 0).select("track", "tracker", u="u_px", v="v_px")
    moved = young.drop_nulls("du_px").join(born, on=["track", "tracker"])
    if moved.height < FEWEST_POINTS:
        return
    error_px = float(np.median(np.hypot(moved["du_px"], moved["dv_px"])))
    motion_px = float(np.median(np.hypot(moved["u_px"] - moved["u"], moved["v_px"] - moved["v"])))
    if error_px > _LEAST_ERROR_PX and error_px > _RIVAL_SHARE * motion_px:
        yield (
            f"Errors rival the image motion: the median error is {significant(error_px, 2)} px, the median motion "
            f"since birth is {significant(motion_px, 2)} px. Poses, depth or intrinsics are probably wrong."
        )


def _of_depths(measurement: "Measurement") -> Iterator[str]:
    """A median depth of features that cannot be in metres."""
    if measurement.truth == SWEPT:  # whose errors do not depend on the unit
        return
    depths_m: NDArray[np.float64] = measurement.tracks["depth_m"].drop_nulls().to_numpy()
    if not len(depths_m) or NEAREST_M <= float(np.median(depths_m)) <= FARTHEST_M:
        return
    median = significant(float(np.median(depths_m)), 3)
    if measurement.truth != TRIANGULATED:
        yield f"The median depth of features is {median} m. The unit is probably not metres."
        return
    missed = measurement.observations.select(pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).drop_nulls().to_series()
    missed_px = float(np.sqrt(np.median(missed.to_numpy()))) if len(missed) else 0.0
    fitted = f"The median depth of points that are fitted to the tracks is {median} m"
    if missed_px > _LEAST_ERROR_PX:
        missing = f"these points miss the tracks by {significant(missed_px, 2)} px in the median"
        yield f"{fitted}, and {missing}. Errors of the poses are probably larger than the parallax."
    else:
        yield f"{fitted}. The unit of the positions is not metres, or the parallax is too small to show depths."
