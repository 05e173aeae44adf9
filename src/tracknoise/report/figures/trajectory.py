"""The camera path, along its two longest axes, and how far the camera moved and rotated along each axis."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.findings.wording import SPACE, count, number, percent
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Chart, Panel, arranged, layered
from tracknoise.report.report_data import ReportData

MOST = 4
_TITLE = "Camera path"
_POINTS, _HEADINGS = 300, 12
_SIZE = {"width": 235, "height": 190}
_STILL_DEG = 1e-5
"""Rotations smaller than this are rounding errors of quaternions."""
_AXES = ("x", "y", "z")
_COLOURS = dict(zip(_AXES, style.colours(_AXES), strict=True))


@dataclass(frozen=True, slots=True)
class Path:
    """The camera path of one scene.

    Attributes
    ----------
    scene
        Its name.
    frame : (n,) int64
        Those that have a pose.
    places_m : (n, 3) float64
        The camera's centre in the world.
    forwards : (n, 3) float64
        Unit vectors along its line of sight, in the world.
    turns_deg : (n, 3) float64
        Rotation about the axes of the camera, summed from frame to frame.
    turned_deg, moved_m
        Sums of rotations and translations from frame to frame.
    depth_m
        Median depth of its features where they were first seen. None where none is known.
    """

    scene: str
    frame: NDArray[np.int64]
    places_m: NDArray[np.float64]
    forwards: NDArray[np.float64]
    turns_deg: NDArray[np.float64]
    turned_deg: float
    moved_m: float
    depth_m: float | None


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: one row per motion, for the first scene of each of the first motions."""
    chosen = first_of_each_motion(list(data.sequences))
    if not chosen:
        return [Absence("trajectory", _TITLE, "No tracker found a feature, so there is no path.")]
    paths = [_path(data, key) for key in chosen[:MOST]]
    more = len(data.sequences) - len(paths)
    others = f" {count(more, 'other scene').capitalize()} {'is' if more == 1 else 'are'} not drawn." if more else ""
    figure = Figure(
        id="trajectory",
        title=_TITLE,
        shows="Left: the camera path along the two world axes in which it extends farthest. The dot is its start. "
        "Strokes show the viewing direction. Middle: displacement from the first frame along each world axis. Right: "
        "rotation about each axis of the camera (x right, y down, z forward), summed from frame to frame. The legend "
        f"holds for both.{others}",
        look_for=" ".join(_sentence(path) for path in paths),
        spec=arranged([panel for path in paths for panel in _row(path)], columns=3),
        message=_message(paths[0]),
    )
    return [figure]


def first_of_each_motion(keys: Sequence[str]) -> list[str]:
    """The first of the sequences whose names differ only in the number at the end of their scene."""
    first: dict[str, str] = {}
    for key in keys:
        first.setdefault(re.sub(r"[-_ ]?\d+(?=@)", "", key), key)
    return list(first.values())


def _path(data: ReportData, key: str) -> Path:
    poses = data.run.sequence_table("poses", key).drop_nulls().sort("frame")
    places = poses.select("x_m", "y_m", "z_m").to_numpy()
    rotations = Rotation.from_quat(poses.select("qx", "qy", "qz", "qw").to_numpy())
    steps = np.rad2deg((rotations[:-1].inv() * rotations[1:]).as_rotvec()).reshape(-1, 3)
    turned = np.linalg.norm(steps, axis=1)
    steps[turned <= _STILL_DEG] = 0.0
    return Path(
        scene=data.sequences[key].sequence.scene,
        frame=poses["frame"].to_numpy().astype(np.int64),
        places_m=places,
        forwards=rotations.apply([0.0, 0.0, 1.0]),
        turns_deg=np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)]),
        turned_deg=float(turned[turned > _STILL_DEG].sum()),
        moved_m=float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()),
        depth_m=_depth_m(data, key),
    )


def _depth_m(data: ReportData, key: str) -> float | None:
    """Median depth of a scene's features, metres. None where none is known, or the tracks are not kept."""
    if not data.keeps_observations:
        return None
    depths = data.run.sequence_table("tracks", key)["depth_m"].drop_nulls()
    return float(np.median(depths.to_numpy())) if depths.len() else None


def _message(path: Path) -> str:
    return f"{path.scene} moves {number(path.moved_m)}{SPACE}m and rotates {number(path.turned_deg)}°"


def _sentence(path: Path) -> str:
    moves = f"In total, {path.scene} moves {number(path.moved_m)}{SPACE}m and rotates {number(path.turned_deg)}°"
    if not path.depth_m or not path.moved_m or not path.turned_deg:
        return f"{moves}."
    seen_deg = float(np.rad2deg(path.moved_m / path.depth_m))
    share = percent(path.turned_deg / (path.turned_deg + seen_deg))
    return (
        f"{moves}. At the median feature depth of {number(path.depth_m)}{SPACE}m, this translation shifts the view by "
        f"up to {number(seen_deg)}°. Rotation is then {share} or more of the total shift."
    )


def _row(path: Path) -> list[Panel]:
    shown = _spread(len(path.frame), _POINTS)
    moved = _along(path.frame[shown], path.places_m[shown] - path.places_m[0], "moved", "m")
    turned = _along(path.frame[shown], path.turns_deg[shown], "rotated", "°")
    legend = (marks.shown("axis", _COLOURS),)
    return [
        Panel(_top_view(path, shown).properties(title=path.scene, **_SIZE)),
        Panel(moved.properties(**_SIZE), legend),
        Panel(turned.properties(**_SIZE), legend),
    ]


def _along(frame: NDArray[np.int64], values: NDArray[np.float64], name: str, unit: str) -> alt.Chart:
    """One line per axis, by frame."""
    title = f"{name} ({unit})"
    table = pl.DataFrame({"frame": frame, **dict(zip(_AXES, values.T, strict=True))})
    long = table.unpivot(_AXES, index="frame", variable_name="axis", value_name=name)
    domain = marks.holding(long[name], pl.Series([], dtype=pl.Float64))
    chart: alt.Chart = alt.Chart(marks.rows(long)).mark_line().encode(
        x=alt.X("frame:Q", title="frame", axis=alt.Axis(tickMinStep=1), scale=alt.Scale(nice=False)),
        y=alt.Y(f"{name}:Q", title=title, scale=alt.Scale(domain=domain, nice=False)),
        color=marks.colour("axis", _COLOURS, "axis"),
        opacity=marks.opacity("axis"),
        tooltip=[alt.Tooltip("frame:Q"), alt.Tooltip("axis:N"), alt.Tooltip(f"{name}:Q", title=title)],
    )  # fmt: skip
    return chart


def _top_view(path: Path, shown: NDArray[np.intp]) -> Chart:
    """The path, with the same scale on both axes."""
    widest = sorted(np.argsort(-np.ptp(path.places_m, axis=0), kind="stable")[:2])
    metres_per_px, middle = _scale(path.places_m[:, widest])
    spans = metres_per_px * np.array([_SIZE["width"], _SIZE["height"]])
    scales = [
        alt.Scale(domain=[float(m - span / 2), float(m + span / 2)], nice=False, zero=False)
        for m, span in zip(middle, spans, strict=True)
    ]
    names = [_AXES[place] for place in widest]
    x, y = (
        alt.X("x:Q", title=f"{names[0]} (m)", scale=scales[0]),
        alt.Y("y:Q", title=f"{names[1]} (m)", scale=scales[1]),
    )
    line = alt.Chart(_table(path.frame[shown], path.places_m[shown][:, widest])).mark_line(color=style.PALETTE[0])
    few = _spread(len(path.frame), _HEADINGS)
    places, ahead = path.places_m[few][:, widest], 0.1 * spans[0] * path.forwards[few][:, widest]
    strokes = alt.Chart(_table(path.frame[few], places, places + ahead)).mark_rule(color=style.PALETTE[1], clip=True)
    start = alt.Chart(_table(path.frame[:1], path.places_m[:1][:, widest])).mark_point(
        color=style.INK, size=45, opacity=1
    )
    return layered(
        line.encode(x=x, y=y, order=alt.Order("frame:Q"), tooltip=[alt.Tooltip("frame:Q")]),
        strokes.encode(x=x, y=y, x2=alt.X2("x_ahead:Q"), y2=alt.Y2("y_ahead:Q"), tooltip=[alt.Tooltip("frame:Q")]),
        start.encode(x=x, y=y),
    )


def _scale(places_m: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Metres per px at which all places and strokes fit, and the middle of the panel."""
    low, high = places_m.min(axis=0), places_m.max(axis=0)
    sizes = 0.75 * np.array([_SIZE["width"], _SIZE["height"]])
    return float(np.max((high - low) / sizes)) or 1.0 / sizes[0], (low + high) / 2


def _table(
    frame: NDArray[np.int64], places: NDArray[np.float64], ahead: NDArray[np.float64] | None = None
) -> alt.InlineData:
    columns = {"frame": frame, "x": places[:, 0], "y": places[:, 1]}
    if ahead is not None:
        columns |= {"x_ahead": ahead[:, 0], "y_ahead": ahead[:, 1]}
    return marks.rows(pl.DataFrame(columns), digits=6)


def _spread(n: int, most: int) -> NDArray[np.intp]:
    """At most `most` of n places, evenly spaced, including the first and the last."""
    return np.linspace(0, n - 1, min(n, most)).round().astype(np.intp)
