"""The camera path, along its two longest axes, and how far the camera moved and rotated."""

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
_STILL = 1e-7
"""Rotations smaller than this, rad, are rounding errors of quaternions."""
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
    angles_deg : (n,) float64
        Rotation from its first frame.
    turned_deg, moved_m
        Sums of rotations and translations from frame to frame.
    depth_m
        Median depth of its features where they were first seen. None where none is known.
    """

    scene: str
    frame: NDArray[np.int64]
    places_m: NDArray[np.float64]
    forwards: NDArray[np.float64]
    angles_deg: NDArray[np.float64]
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
        f"rotation from the first frame.{others}",
        look_for=" ".join(_sentence(path) for path in paths),
        spec=arranged([panel for path in paths for panel in _row(path)], columns=3),
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
    steps = np.asarray((rotations[:-1].inv() * rotations[1:]).magnitude())
    return Path(
        scene=data.sequences[key].sequence.scene,
        frame=poses["frame"].to_numpy().astype(np.int64),
        places_m=places,
        forwards=rotations.apply([0.0, 0.0, 1.0]),
        angles_deg=np.rad2deg((rotations[0].inv() * rotations).magnitude()),
        turned_deg=float(np.rad2deg(steps[steps > _STILL].sum())),
        moved_m=float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()),
        depth_m=_depth_m(data, key),
    )


def _depth_m(data: ReportData, key: str) -> float | None:
    """Median depth of a scene's features, metres. None where none is known, or the tracks are not kept."""
    if not data.keeps_observations:
        return None
    depths = data.run.sequence_table("tracks", key)["depth_m"].drop_nulls()
    return float(np.median(depths.to_numpy())) if depths.len() else None


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
    moved = pl.DataFrame({"frame": path.frame[shown], **dict(zip(_AXES, path.places_m[shown].T, strict=True))})
    since = moved.with_columns(pl.col(axis) - path.places_m[0, place] for place, axis in enumerate(_AXES))
    long = since.unpivot(_AXES, index="frame", variable_name="axis", value_name="moved")
    turned = pl.DataFrame({"frame": path.frame[shown], "turned": path.angles_deg[shown]})
    x = alt.X("frame:Q", title="frame", axis=alt.Axis(tickMinStep=1), scale=alt.Scale(nice=False))
    distance = alt.Chart(marks.rows(long)).mark_line().encode(
        x=x,
        y=alt.Y("moved:Q", title="moved (m)"),
        color=marks.colour("axis", _COLOURS, "axis"),
        opacity=marks.opacity("axis"),
        tooltip=[alt.Tooltip("frame:Q"), alt.Tooltip("axis:N"), alt.Tooltip("moved:Q", title="moved (m)")],
    )  # fmt: skip
    angle = alt.Chart(marks.rows(turned)).mark_line(color=style.INK).encode(
        x=x,
        y=alt.Y("turned:Q", title="rotated (°)", scale=alt.Scale(domain=[0, 1.05 * path.angles_deg.max() or 1.0])),
        tooltip=[alt.Tooltip("frame:Q"), alt.Tooltip("turned:Q", title="rotated (°)")],
    )  # fmt: skip
    return [
        Panel(_top_view(path, shown).properties(title=path.scene, **_SIZE)),
        Panel(distance.properties(**_SIZE), (marks.shown("axis", _COLOURS),)),
        Panel(angle.properties(**_SIZE)),
    ]


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
