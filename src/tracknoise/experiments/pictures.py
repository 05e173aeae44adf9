"""Pictures of a sequence: its first frames as a film, and patches around tracks with large, middle and small errors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.sequences.images import encode_jpeg, encode_webp, reduced
from tracknoise.statistics.samples import extreme_tracks
from tracknoise.tables.defaults import LONGEST_STRIP, PATCH_PX
from tracknoise.tables.schema import FILM, ORIGIN, PATCHES, of_first_camera

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement

KEPT_BYTES = 64 * 2**20
"""Size of the images of a sequence that are kept while it is measured. Others are read again where they are needed."""
_PATCH_QUALITY, _FILM_QUALITY = 80, 50
_MOST_FRAMES, _MOST_BYTES = 120, 2_000_000
"""Frames of a film, and its size."""
_WIDEST_PX = 480

_COLUMNS = (*ORIGIN, "track", "frame", "age", "u_px", "v_px", "truth", "du_px", "dv_px")
Patch = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Chosen:
    """Tracks of one tracker and age, and where the worst of them was seen."""

    n_each: int  # tracks of each kind
    # now, first: their observations at this age, and where they were anchored: frame, u_px, v_px
    now: pl.DataFrame
    first: pl.DataFrame
    path: pl.DataFrame  # those of the worst track, from its anchor frame on


def film(measurement: "Measurement") -> pl.DataFrame:
    """Images of the first frames, at most `_WIDEST_PX` wide. Those that were not kept while tracking are read again.

    JPEG takes a fiftieth of the time of WebP, which would be a third smaller. Returns schema `FILM`.
    """
    rows: list[tuple[int, bytes]] = []
    size = 0
    for frame in range(min(measurement.n_frames, _MOST_FRAMES)):
        image = encode_jpeg(reduced(measurement.image(frame), _WIDEST_PX), quality=_FILM_QUALITY)
        size += len(image)
        if size > _MOST_BYTES:
            break
        rows.append((frame, image))
    return pl.DataFrame(rows, schema=dict(FILM), orient="row")


def track_patches(measurement: "Measurement", *, speed: int) -> pl.DataFrame:
    """Cut patches around the tracks that are worth a look. Images that were not kept are read again, each once.

    Returns schema `PATCHES`.
    """
    observed = of_first_camera(measurement.observations).lazy().filter(speed=speed).select(_COLUMNS).collect()
    extremes = extreme_tracks(observed, speed=speed, population=measurement.population, key_frame=measurement.key_frame)
    chosen = [_located(observed, n_each, rows) for n_each, rows in extremes]
    patches = _cut(measurement, chosen)
    return pl.DataFrame([_row(track, patches) for track in chosen], schema=dict(PATCHES))


def _located(observed: pl.DataFrame, n_each: int, now: pl.DataFrame) -> _Chosen:
    places = observed.filter(tracker=now["tracker"][0]).select("track", "frame", "u_px", "v_px")
    first = now.select("track", frame="anchor_frame").join(
        places, on=["track", "frame"], how="left", maintain_order="left"
    )
    worst = now.row(0, named=True)
    seen = pl.col("frame").is_between(worst["anchor_frame"], worst["frame"])
    path = places.filter(seen, track=worst["track"]).sort("frame").tail(LONGEST_STRIP)
    return _Chosen(n_each, now, first, path)


def _cut(measurement: "Measurement", chosen: Sequence[_Chosen]) -> Mapping[tuple[int, float, float], Patch]:
    """Patches by frame and position. Each image is read once."""
    tables = [
        table.select("frame", "u_px", "v_px") for track in chosen for table in (track.now, track.first, track.path)
    ]
    if not tables:
        return {}
    wanted = pl.concat(tables).drop_nulls().unique().sort("frame")
    patches = {}
    for (frame,), rows in wanted.group_by("frame", maintain_order=True):
        image = measurement.image(frame)
        patches.update({(frame, u, v): _patch(image, u, v) for _, u, v in rows.iter_rows()})
    return patches


def _patch(image: NDArray[np.uint8], u: float, v: float) -> Patch:
    """(PATCH_PX, PATCH_PX) uint8 around the nearest pixel; the border of the image is repeated beyond it."""
    reach = np.arange(PATCH_PX) - PATCH_PX // 2
    rows = np.clip(round(v) + reach, 0, image.shape[0] - 1)
    columns = np.clip(round(u) + reach, 0, image.shape[1] - 1)
    return np.ascontiguousarray(image[np.ix_(rows, columns)])


def _row(track: _Chosen, patches: Mapping[tuple[int, float, float], Patch]) -> dict[str, Any]:
    lists = {name: track.now[name].to_list() for name in ("track", "frame", "anchor_frame", "du_px", "dv_px")}
    pairs = [np.hstack(pair) for pair in zip(_of(track.first, patches), _of(track.now, patches), strict=True)]
    strip = np.hstack(list(_of(track.path, patches)))
    return {
        **track.now.select(*ORIGIN, "at").row(0, named=True),
        "n_each": track.n_each,
        **lists,
        "sheet": encode_webp(np.vstack(pairs), quality=_PATCH_QUALITY),
        "strip": encode_webp(strip, quality=_PATCH_QUALITY),
    }


def _of(table: pl.DataFrame, patches: Mapping[tuple[int, float, float], Patch]) -> Iterator[Patch]:
    """Patches of the rows of a table; a grey one where the tracker reports no position."""
    nothing = np.full((PATCH_PX, PATCH_PX), 128, np.uint8)
    for place in table.select("frame", "u_px", "v_px").iter_rows():
        yield patches.get(place, nothing)
