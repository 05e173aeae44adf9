"""Tracks to look at: the worst, middle and best ones of each tracker at a few ages, with their patches and paths."""

import base64
import json
from collections.abc import Iterator, Mapping
from typing import Any

import polars as pl

from tracknoise.report.report_data import ReportData
from tracknoise.statistics.samples import KINDS
from tracknoise.tables.defaults import LONGEST_STRIP, PATCH_PX

MOST_BYTES = 1_300_000
"""Size of all groups in a page, as JSON. Those of further scenes are left out."""
_DIGITS = 3
_NOT_RECORDED = "not recorded"
"""How a track ended whose tracker reports no causes."""


def looks(data: ReportData) -> dict[str, Any]:
    """Patches and tracks as the script of the page reads them.

    Returns: `patch_px`; `kinds`, names in the order of the tracks; `groups`, one for each scene, tracker and age:
    `scene`, `tracker`, `at`, `sheet` and `strip` (WebP, base64), `strip_at` (its frames) and `tracks`.
    """
    groups: list[dict[str, Any]] = []
    size = 0
    for key, entry in data.sequences.items():
        found = list(_groups(data, key)) if "patches" in entry.sha256 and data.keeps_observations else []
        size += len(json.dumps(found))
        if size > MOST_BYTES:
            break
        groups += [{"scene": entry.sequence.scene, **group} for group in found]
    return {"patch_px": PATCH_PX, "kinds": KINDS, "groups": groups}


def _groups(data: ReportData, key: str) -> Iterator[dict[str, Any]]:
    """Groups of one sequence."""
    patches = data.run.sequence_table("patches", key).filter(speed=data.slowest)
    shown = pl.col("track").is_in(patches["track"].explode().unique().to_list()), pl.col("speed") == data.slowest
    observed, ends = (data.run.rows(name, key, *shown) for name in ("observations", "tracks"))
    for row in patches.to_dicts():
        own = observed.filter(pl.col("track").is_in(row["track"]), tracker=row["tracker"]).sort("frame")
        reasons = ends.filter(pl.col("track").is_in(row["track"]), tracker=row["tracker"])
        paths = {track: part for (track,), part in own.group_by("track")}
        ended = {lived["track"]: lived for lived in reasons.to_dicts()}
        worst = paths[row["track"][0]]["frame"]
        strip = worst.filter(worst.is_between(row["anchor_frame"][0], row["frame"][0])).tail(LONGEST_STRIP)
        yield {
            "tracker": row["tracker"],
            "at": row["at"],
            "sheet": base64.b64encode(row["sheet"]).decode(),
            "strip": base64.b64encode(row["strip"]).decode(),
            "strip_at": strip.to_list(),
            "tracks": [_track(row, place, paths[track], ended[track]) for place, track in enumerate(row["track"])],
        }


def _track(row: Mapping[str, Any], place: int, path: pl.DataFrame, lived: Mapping[str, Any]) -> dict[str, Any]:
    """One of the chosen tracks."""
    frame, anchor = row["frame"][place], row["anchor_frame"][place]
    now = path.filter(frame=frame).row(0, named=True)
    known = path.filter(pl.col("frame").is_between(anchor, frame)).drop_nulls(["du_px", "dv_px"])
    return {
        "kind": KINDS[place // row["n_each"]],
        "row": place,
        "track": row["track"][place],
        "frame": frame,
        "anchor_frame": anchor,
        "within": [now[name] - round(now[name]) for name in ("u_px", "v_px")],
        "error": [row["du_px"][place], row["dv_px"][place]],
        "end": _NOT_RECORDED if lived["end"] is None else lived["end"].replace("_", " "),
        "lifetime": lived["lifetime"],
        "largest": None if lived["max_error_px"] is None else float(f"{lived['max_error_px']:.6g}"),
        "truth": now["truth"].replace("_", " "),
        "path": {
            "frame": known["frame"].to_list(),
            **{name: known[name].round_sig_figs(_DIGITS).to_list() for name in ("du_px", "dv_px")},
        },
    }
