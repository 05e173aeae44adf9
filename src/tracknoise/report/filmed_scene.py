"""Frames of one scene with the tracks in them, for the page: what was observed, and where it really was."""

import base64
from collections.abc import Iterator
from typing import Any

import polars as pl

from tracknoise.report.figures.frames import magnification
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import of_first_camera

_VISIBLE = 1 / 3
"""Errors are visible once their median is this share of the largest median of a frame."""
MOST_TRACKS, FEWEST_TRACKS, OF_ALL = 150, 20, 600
"""Tracks of each tracker that the page can draw, at least, and of all trackers. A third have the largest errors."""


def filmed_scene(data: ReportData) -> dict[str, Any] | None:
    """Frames and tracks as the script of the page reads them; None where the run keeps none.

    Returns: `scene`, `width` and `height` of the images of the recording, px; `frames`, JPEG or WebP images in base64;
    `start`, the first frame in which errors are visible, and `magnified`, how many times longer they are drawn;
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
    size = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt().alias("size")
    errors = seen.select("frame", size).drop_nulls("size")
    start = _first_visible(errors, images.height)
    return {
        "scene": entry.sequence.scene,
        "width": entry.width,
        "height": entry.height,
        "start": start,
        "magnified": magnification(errors.filter(pl.col("frame") >= start)["size"], entry.width),
        "frames": [base64.b64encode(image).decode() for image in images["image"]],
        "trackers": {
            tracker: list(_tracks(seen.filter(tracker=tracker), most))
            for tracker in data.trackers
            if tracker in {*seen["tracker"]}
        },
    }


def _first_visible(errors: pl.DataFrame, n_frames: int) -> int:
    """The first frame in which errors are visible; in the first half, so that there is something to see."""
    medians = errors.group_by("frame").agg(pl.col("size").median()).sort("frame")
    visible = medians.filter(pl.col("size") >= _VISIBLE * pl.col("size").max())["frame"]
    return min(int(visible[0]), n_frames // 2) if visible.len() else 0


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
