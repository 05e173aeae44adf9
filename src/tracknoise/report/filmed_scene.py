"""Frames of one scene with the tracks in them, for the page: what was observed, and where it really was."""

import base64
from collections.abc import Iterator
from typing import Any

import polars as pl

from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import of_first_camera

WIDTH = 640
"""Of the picture that the page draws, px."""
MAGNIFIED = (1, 10, 50)
"""By how much errors can be enlarged."""
_SEEN_PX = 6.0
"""Errors of this size in the picture are seen."""
_FEW = 10
"""Fewer errors have no median that tells where errors are seen."""
MOST_TRACKS, FEWEST_TRACKS, OF_ALL = 150, 20, 600
"""Tracks of each tracker that the page can draw, at least, and of all trackers. A third have the largest errors."""


def filmed_scene(data: ReportData) -> dict[str, Any] | None:
    """Frames and tracks as the script of the page reads them; None where the run keeps none.

    Returns: `scene`, `width` and `height` of the images of the recording, px; `frames`, JPEG or WebP images in base64;
    `start`, the frame with the largest median error, and `magnified`, by how much errors are enlarged to be seen there;
    and `trackers`, by name lists of tracks. A track has its first `frame` and, for each frame from there on, `u`, `v`,
    and `du`, `dv`, which are null where the true position is unknown, in px.
    """
    for key, entry in sorted(data.manifest.sequences.items()):
        if "film" in entry.sha256 and data.keeps_observations and data.trackers:
            images = data.run.sequence_table("film", key).sort("frame")
            if not images.is_empty():
                return _film(data, key, entry, images)
    return None


def _film(data: ReportData, key: str, entry: SequenceEntry, images: pl.DataFrame) -> dict[str, Any]:
    most = max(FEWEST_TRACKS, min(MOST_TRACKS, OF_ALL // len(data.trackers)))
    filmed = pl.col("frame") < images.height, pl.col("speed") == data.slowest
    seen = of_first_camera(data.run.rows("observations", key, *filmed))
    start, size_px = _largest_errors(seen)
    seen_px = size_px * WIDTH / entry.width
    return {
        "scene": entry.sequence.scene,
        "width": entry.width,
        "height": entry.height,
        "start": start,
        "magnified": next((times for times in MAGNIFIED if times * seen_px >= _SEEN_PX), MAGNIFIED[-1]),
        "frames": [base64.b64encode(image).decode() for image in images["image"]],
        "trackers": {
            tracker: list(_tracks(seen.filter(tracker=tracker), most))
            for tracker in data.trackers
            if tracker in {*seen["tracker"]}
        },
    }


def _largest_errors(seen: pl.DataFrame) -> tuple[int, float]:
    """The frame with the largest median error, and this error, px; the first where few are known."""
    size = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt()
    known = seen.with_columns(size=size).filter(pl.col("size") > 0.0)
    frames = known.group_by("frame").agg(pl.len(), pl.col("size").median()).filter(pl.col("len") >= _FEW)
    if frames.is_empty():
        return 0, 0.0
    frame, _, size_px = frames.sort("size", "frame", descending=[True, False]).row(0)
    return int(frame), float(size_px)


def _tracks(seen: pl.DataFrame, most: int) -> Iterator[dict[str, Any]]:
    """Those with the largest errors, and others that are evenly spread over their numbers."""
    size = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).max().sqrt().alias("largest")
    tracks = seen.group_by("track").agg(size).sort("largest", "track", descending=[True, False], nulls_last=True)
    worst, others = tracks.head(most // 3), tracks.slice(most // 3).sort("track")
    step = max(1, -(-others.height // (most - most // 3)))
    chosen = pl.concat([worst, others.gather_every(step)]).select("track")
    for _, rows in (
        seen.join(chosen, on="track", how="semi").sort("track", "frame").group_by("track", maintain_order=True)
    ):
        first = int(rows["frame"][0])
        all_frames = pl.DataFrame(
            {"frame": range(first, int(rows["frame"][-1]) + 1)}, schema={"frame": rows.schema["frame"]}
        )
        path = all_frames.join(rows, on="frame", how="left", maintain_order="left")
        yield {"frame": first, **{name: path[f"{name}_px"].round(2).to_list() for name in ("u", "v", "du", "dv")}}
