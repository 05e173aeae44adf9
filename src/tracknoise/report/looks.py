"""Tracks to look at: the worst, middle and best ones of each tracker at a few ages, with their patches and paths."""

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.report.report_data import ReportData
from tracknoise.statistics.samples import KINDS
from tracknoise.tables.defaults import LONGEST_STRIP, PATCH_PX

MOST_BYTES = 1_300_000
"""Size of all groups in a page, as JSON. Those of further scenes are left out."""
_OF_PATHS = "frame", "u_px", "v_px", "truth", pl.col("du_px", "dv_px").round_sig_figs(3)
_Row = Mapping[str, Any]
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
        scene_groups = list(_groups(data, key)) if "patches" in entry.sha256 and data.keeps_observations else []
        size += len(json.dumps(scene_groups))
        if size > MOST_BYTES:
            break
        groups += [{"scene": entry.sequence.scene, **group} for group in scene_groups]
    return {"patch_px": PATCH_PX, "kinds": KINDS, "groups": groups}


def _groups(data: ReportData, key: str) -> Iterator[dict[str, Any]]:
    """Groups of one sequence."""
    patches = data.run.sequence_table("patches", key).filter(speed=data.slowest)
    shown = pl.col("track").is_in(patches["track"].explode().unique().to_list()), pl.col("speed") == data.slowest
    observed, ends = (data.run.rows(name, key, *shown) for name in ("observations", "tracks"))
    for row in patches.to_dicts():
        observations = observed.filter(pl.col("track").is_in(row["track"]), tracker=row["tracker"])
        reasons = ends.filter(pl.col("track").is_in(row["track"]), tracker=row["tracker"])
        paths = observations.sort("frame").select("track", *_OF_PATHS).rows_by_key("track", named=True, unique=False)
        ended = {lived["track"]: lived for lived in reasons.to_dicts()}
        strip = [observation["frame"] for observation in _between(row, 0, paths[row["track"][0]])][-LONGEST_STRIP:]
        yield {
            "tracker": row["tracker"],
            "at": row["at"],
            "sheet": base64.b64encode(row["sheet"]).decode(),
            "strip": base64.b64encode(row["strip"]).decode(),
            "strip_at": strip,
            "tracks": [_track(row, place, paths[track], ended[track]) for place, track in enumerate(row["track"])],
        }


def _between(row: _Row, place: int, path: Sequence[_Row]) -> list[_Row]:
    """The rows of a chosen track from its anchor to the frame that is shown."""
    return [
        observation for observation in path if row["anchor_frame"][place] <= observation["frame"] <= row["frame"][place]
    ]


def _track(row: _Row, place: int, path: Sequence[_Row], lived: _Row) -> dict[str, Any]:
    """One of the chosen tracks."""
    until = _between(row, place, path)
    last = until[-1]
    measured = [observation for observation in until if observation["du_px"] is not None]
    return {
        "kind": KINDS[place // row["n_each"]],
        "row": place,
        "track": row["track"][place],
        "frame": row["frame"][place],
        "anchor_frame": row["anchor_frame"][place],
        "within": [last[name] - round(last[name]) for name in ("u_px", "v_px")],
        "error": [row["du_px"][place], row["dv_px"][place]],
        "end": _NOT_RECORDED if lived["end"] is None else lived["end"].replace("_", " "),
        "lifetime": lived["lifetime"],
        "largest": None if lived["max_error_px"] is None else float(f"{lived['max_error_px']:.6g}"),
        "truth": last["truth"].replace("_", " "),
        "path": {
            "frame": [observation["frame"] for observation in measured],
            **{name: [observation[name] for observation in measured] for name in ("du_px", "dv_px")},
        },
    }
