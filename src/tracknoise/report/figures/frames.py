"""Frames of a sequence with what trackers saw in them, and the path of the camera.

- The stored image of a sequence as the background of a panel, with its axes in pixels.
- One frame of each scene with the features of every tracker, their magnified errors and their trails.
- The image of one scene with the features of a tracker whose tracks trimming kept, and of those that it dropped.
- One frame of one scene under the reference light, and under the first, middle and last light of each sweep.
- The camera path, along its two longest axes, and how far the camera moved and rotated along each axis.
"""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.report import style
from tracknoise.report.figures import light_sweeps, marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import values
from tracknoise.report.figures.panels import Chart, Panel, Spec, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import of_first_camera
from tracknoise.words import SPACE, count, listing, number, percent, px

IMAGE = "image"
"""Name of the image of figures that have one."""


def stored_image(data: ReportData, entry: SequenceEntry) -> bytes | None:
    """The PNG file with the image of a sequence. None if the run has none."""
    if not data.run.snapshot_path(entry.key).exists():
        return None
    content = data.run.snapshot(entry.key)
    return content if content.startswith(b"\x89PNG") else None


def with_images(spec: Spec, images: Mapping[str, tuple[SequenceEntry, bytes]]) -> Spec:
    """A specification with the images that its backgrounds show."""
    return {**spec, "datasets": {**spec["datasets"], **{name: [_placed(*image)] for name, image in images.items()}}}


def _placed(entry: SequenceEntry, png: bytes) -> dict[str, Any]:
    """An image and its edges, px."""
    url = "data:image/png;base64," + base64.b64encode(png).decode()
    return {"url": url, "left": -0.5, "right": entry.width - 0.5, "top": -0.5, "bottom": entry.height - 0.5}


def size(entry: SequenceEntry, width: int) -> dict[str, Any]:
    """Width and height of a panel, px, with the aspect ratio of the image."""
    return {"width": width, "height": round(width * entry.height / entry.width)}


def along_u(shorthand: str, entry: SequenceEntry) -> alt.X:
    """Horizontal axis of a panel with an image."""
    scale = alt.Scale(domain=[-0.5, entry.width - 0.5], nice=False, zero=False)
    return alt.X(shorthand, scale=scale, title="u (px)", axis=alt.Axis(grid=False, tickCount=6))


def along_v(shorthand: str, entry: SequenceEntry) -> alt.Y:
    """Vertical axis of a panel with an image, pointing down."""
    scale = alt.Scale(domain=[entry.height - 0.5, -0.5], nice=False, zero=False)
    return alt.Y(shorthand, scale=scale, title="v (px)", axis=alt.Axis(grid=False, tickCount=5))


def background(entry: SequenceEntry, name: str = IMAGE) -> alt.Chart:
    """The image of this name. The centre of its first pixel is at 0, and its border half a pixel outside."""
    x, y = along_u("left:Q", entry), along_v("top:Q", entry)
    chart = alt.Chart(alt.NamedData(name)).mark_image(aspect=False, clip=True)
    encoded: alt.Chart = chart.encode(x=x, x2=alt.X2("right:Q"), y=y, y2=alt.Y2("bottom:Q"), url=alt.Url("url:N"))
    return encoded


_EXAMPLE_FRAME_ID, _EXAMPLE_FRAME_TITLE = "example-frames", "Example frames"
MOST_SCENES, MOST_FEATURES, TRAIL = 6, 250, 8
_LAST = 2**32 - 1
_ROUND = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]
_ERROR_COLOURS = ["#56B4E9", "#F0E442", "#D55E00"]


@dataclass(frozen=True, slots=True)
class Scene:
    """What is drawn for one sequence.

    Attributes
    ----------
    entry
        The sequence.
    png
        Its image.
    features
        One row per feature: tracker, track, age, u_px, v_px, du_px, dv_px, error_px, truth.
    trails
        The features' last positions: tracker, track, frame, u_px, v_px.
    magnification
        How many times longer than the error its line is.
    longest_px
        Errors above this are drawn as long as this one.
    """

    entry: SequenceEntry
    png: bytes
    features: pl.DataFrame
    trails: pl.DataFrame
    magnification: int
    longest_px: float


def example_frame_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per scene, for the first few scenes."""
    entries = list(data.sequences.values())
    if not entries:
        return [
            Absence(_EXAMPLE_FRAME_ID, _EXAMPLE_FRAME_TITLE, "No tracker found a feature, so there is nothing to draw.")
        ]
    if not data.keeps_observations:
        why = 'The run keeps only statistics (keep = "statistics"), not the single errors that this figure needs.'
        return [Absence(_EXAMPLE_FRAME_ID, _EXAMPLE_FRAME_TITLE, why)]
    figures: list[Figure | Absence] = [
        _figure(data, entry, place) for place, entry in enumerate(entries[:MOST_SCENES], start=1)
    ]
    if len(entries) > MOST_SCENES:
        why = f"Only the first {MOST_SCENES} of {len(entries)} scenes are drawn. The statistics below cover all scenes."
        figures.append(Absence(f"{_EXAMPLE_FRAME_ID}-others", "Other scenes", why))
    return figures


def _figure(data: ReportData, entry: SequenceEntry, place: int) -> Figure | Absence:
    name, title = f"{_EXAMPLE_FRAME_ID}-{place}", f"Scene {entry.sequence.scene}"
    png = stored_image(data, entry)
    if png is None:
        return Absence(name, title, f"The image of frame {entry.snapshot_frame} is missing in the run folder.")
    scene = _scene(data, entry, png)
    if scene.features.is_empty():
        return Absence(name, title, _nothing(data, entry))
    return Figure(
        name,
        title,
        _shows(data, scene),
        _look_for(data, scene),
        _example_frame_chart(data, scene),
        _example_frame_message(data, scene),
    )


def _example_frame_message(data: ReportData, scene: Scene) -> str:
    """Median error of the drawn features of each tracker."""
    errors = {name: scene.features.filter(tracker=name)["error_px"].median() for name in data.trackers}
    return values({name: px(error) for name, error in errors.items() if error is not None}, "Median error")  # type: ignore[arg-type]


def first_scene(data: ReportData) -> Scene | None:
    """The first scene that has an image and features with errors; None where none has."""
    if not data.keeps_observations:
        return None
    entries = list(data.sequences.values())[:MOST_SCENES]
    scenes = (_scene(data, entry, png) for entry in entries if (png := stored_image(data, entry)) is not None)
    return next((scene for scene in scenes if scene.features.height), None)


def _nothing(data: ReportData, entry: SequenceEntry) -> str:
    if entry.key_frame == entry.snapshot_frame:
        return f"The image is of frame {entry.snapshot_frame}, the key frame, where errors are zero by construction."
    place = f"At speed {data.slowest} frame {entry.snapshot_frame}"
    return f"{place} has no feature with a known error" + (
        " that is older than its first frame." if entry.key_frame is None else "."
    )


def _scene(data: ReportData, entry: SequenceEntry, png: bytes) -> Scene:
    first = max(0, entry.snapshot_frame - TRAIL * data.slowest)
    in_frames = pl.col("frame").is_between(first, entry.snapshot_frame)
    observed = of_first_camera(data.run.rows("observations", entry.key, pl.col("speed") == data.slowest, in_frames))
    error = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    fixed = pl.col("age") == 0 if entry.key_frame is None else pl.col("frame") == entry.key_frame
    snapshot = observed.filter(pl.col("frame") == entry.snapshot_frame, ~fixed).drop_nulls("du_px")
    snapshot = snapshot.with_columns(error_px=error).sort("tracker", "track")
    features = pl.concat([snapshot.clear(), *(_some_features(snapshot.filter(tracker=name)) for name in data.trackers)])
    columns = ["tracker", "track", "frame", "u_px", "v_px"]
    trails = observed.select(columns).join(features.select("tracker", "track"), on=["tracker", "track"], how="semi")
    times = magnification(features["error_px"], entry.width)
    return Scene(entry, png, features, trails.sort(columns[:3]), times, 0.1 * entry.width / times)


def _some_features(features: pl.DataFrame) -> pl.DataFrame:
    """At most `MOST_FEATURES` rows, evenly spaced in the table."""
    return features.select(pl.all().gather(_spread(features.height, MOST_FEATURES)))


def _spread(n: int, most: int) -> NDArray[np.intp]:
    """At most `most` of n places, evenly spaced, including the first and the last."""
    return np.linspace(0, n - 1, min(n, most)).round().astype(np.intp)


def magnification(errors: pl.Series, width: int) -> int:
    """Largest round number that draws three quarters of the errors no longer than a fortieth of the image's width."""
    typical = errors.quantile(0.75) if errors.len() else None
    fitting = [factor for factor in _ROUND if factor * (typical or 0.0) <= width / 40]
    return fitting[-1] if fitting and typical else 1


def _shows(data: ReportData, scene: Scene) -> str:
    times = f"magnified {scene.magnification} times" if scene.magnification > 1 else "not magnified"
    return (
        f"Frame {scene.entry.snapshot_frame} at speed {data.slowest}{data.where}. A dot marks the observed position of "
        f"a feature. The line from it points to the true position, and its length is the error, {times}. The thin "
        f"trail connects up to {TRAIL} earlier observations. At most {MOST_FEATURES} features per tracker are drawn."
    )


def _look_for(data: ReportData, scene: Scene) -> str:
    parts = []
    for tracker in data.trackers:
        errors = scene.features.filter(tracker=tracker)["error_px"]
        if errors.len():
            half = f"{px(errors.median())}"  # type: ignore[arg-type]
            parts.append(f"The median error of the {count(errors.len(), 'drawn feature')} of {tracker} is {half}.")
    capped = scene.features.filter(pl.col("error_px") > scene.longest_px).height
    cap = f" {count(capped, 'error').capitalize()} above {px(scene.longest_px)} {'is' if capped == 1 else 'are'} drawn "
    cap = cap + "at that length." if capped else ""
    return f"{' '.join(parts)}{cap} Lines that point the same way across a region show a bias, not noise."


def _example_frame_chart(data: ReportData, scene: Scene) -> Spec:
    present = [name for name in data.trackers if scene.features.filter(tracker=name).height]
    width = 425 if len(present) > 1 else 640
    panels = [_panel(data, scene, tracker, width) for tracker in present]
    return with_images(arranged(panels, columns=2), {IMAGE: (scene.entry, scene.png)})


def _panel(data: ReportData, scene: Scene, tracker: str, width: int) -> Panel:
    layers = layered(background(scene.entry), _trails(scene, tracker), *_errors(scene, tracker))
    title = alt.Title(tracker, color=data.colour[tracker])
    return Panel(layers.properties(title=title, **size(scene.entry, width)), (marks.zoom("x", "y"),))


def _trails(scene: Scene, tracker: str) -> alt.Chart:
    """One line for all tracks, interrupted by a row without a position after each. Many lines are slow to draw."""
    table = scene.trails.filter(tracker=tracker).select("track", "frame", u="u_px", v="v_px")
    breaks = table.select("track").unique().with_columns(frame=pl.lit(_LAST, dtype=pl.UInt32), u=None, v=None)
    ordered = pl.concat([table, breaks.cast(table.schema)]).sort("track", "frame").with_row_index("place")
    chart = alt.Chart(marks.rows(ordered.select("place", "u", "v")))
    line = chart.mark_line(clip=True, color="#ffffff", strokeWidth=0.9, opacity=0.6, invalid="break-paths-show-domains")
    encoded: alt.Chart = line.encode(
        x=along_u("u:Q", scene.entry), y=along_v("v:Q", scene.entry), order=alt.Order("place:Q")
    )
    return encoded


def _errors(scene: Scene, tracker: str) -> list[alt.Chart]:
    length = scene.magnification * pl.min_horizontal(1.0, scene.longest_px / pl.col("error_px"))
    table = (
        scene.features.filter(tracker=tracker)
        .select(
            "track",
            "age",
            "truth",
            u="u_px",
            v="v_px",
            du="du_px",
            dv="dv_px",
            error="error_px",
            u_tip=pl.col("u_px") - length * pl.col("du_px"),
            v_tip=pl.col("v_px") - length * pl.col("dv_px"),
        )
        .fill_nan(None)
    )
    scale = alt.Scale(domain=[0, scene.longest_px / 2, scene.longest_px], range=_ERROR_COLOURS, clamp=True)
    tips = [alt.Tooltip(f"{name}:Q", title=title) for name, title in _TIPS.items()] + [alt.Tooltip("truth:N")]
    base = alt.Chart(marks.rows(table)).encode(
        x=along_u("u:Q", scene.entry),
        y=along_v("v:Q", scene.entry),
        tooltip=tips,
        color=alt.Color("error:Q", scale=scale, title="error (px)"),
    )
    return [
        base.mark_rule(clip=True, strokeWidth=1.4).encode(x2=alt.X2("u_tip:Q"), y2=alt.Y2("v_tip:Q")),
        base.mark_point(clip=True, size=9, opacity=1),
    ]


_TIPS = {
    "error": "error (px)",
    "du": "error in u (px)",
    "dv": "error in v (px)",
    "age": "age (frames)",
    "track": "track",
}
_DROPPED_TRACK_COLOURS = {"kept": style.PALETTE[4], "dropped": style.PALETTE[1]}
_DROPPED_TRACK_WIDTH = 400


@dataclass(frozen=True, slots=True)
class TrimmedFrame:
    """The frame of a scene whose image the run has.

    Attributes
    ----------
    entry
        The sequence.
    png
        Its image.
    features
        All with a known error at the lowest speed: tracker, track, age, u, v, u_true, v_true, error, trimming.
    """

    entry: SequenceEntry
    png: bytes
    features: pl.DataFrame

    def panel(self, tracker: str) -> Panel:
        """The image with the features of a tracker: dots, and lines from the dropped ones to their true positions."""
        rows = self.features.filter(tracker=tracker).drop("tracker")
        names = ("track", "age", "error", "trimming")
        tips = [alt.Tooltip(f"{name}:{'N' if name == 'trimming' else 'Q'}") for name in names]
        base = alt.Chart(marks.rows(rows)).encode(
            x=along_u("u:Q", self.entry),
            y=along_v("v:Q", self.entry),
            color=marks.colour("trimming", _DROPPED_TRACK_COLOURS, "trimming"),
            opacity=marks.opacity("trimming"),
            tooltip=tips,
        )
        dots = base.mark_point(size=14, clip=True)
        lines = base.transform_filter("datum.trimming == 'dropped'").mark_rule(clip=True, strokeWidth=1.4)
        lines = lines.encode(x2=alt.X2("u_true:Q"), y2=alt.Y2("v_true:Q"))
        chart = layered(background(self.entry), lines, dots)
        place = f"scene {self.entry.sequence.scene}, frame {self.entry.snapshot_frame}"
        title = f"{tracker}, {place}" if rows.height else f"{tracker}, no known error in {place}"
        legend = marks.shown("trimming", _DROPPED_TRACK_COLOURS)
        return Panel(chart.properties(title=title, **size(self.entry, _DROPPED_TRACK_WIDTH)), (legend,), layer=1)

    def shown_in(self, spec: Spec) -> Spec:
        """A specification with the image of its panels."""
        return with_images(spec, {IMAGE: (self.entry, self.png)})


def trimmed_frame(data: ReportData) -> TrimmedFrame | None:
    """The frame of the first scene that has an image and features with a known error. None if nothing was trimmed."""
    if data.percentile is None or not data.keeps_observations:
        return None
    for entry in data.sequences.values():
        png = stored_image(data, entry)
        if png is not None and (features := _features(data, entry)).height:
            return TrimmedFrame(entry, png, features)
    return None


def _features(data: ReportData, entry: SequenceEntry) -> pl.DataFrame:
    in_frame = pl.col("frame") == entry.snapshot_frame
    snapshot = data.run.rows("observations", entry.key, pl.col("speed") == data.slowest, in_frame)
    error = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    positions = {"u": "u_px", "v": "v_px", "u_true": "u_true_px", "v_true": "v_true_px"}
    trimming = pl.when("kept").then(pl.lit("kept")).otherwise(pl.lit("dropped"))
    measured = snapshot.drop_nulls(["du_px", "kept"])
    return measured.select("tracker", "track", "age", **positions, error=error, trimming=trimming)


_LIGHT_STAGE_ID, _LIGHT_STAGE_TITLE = "light-stage", "Lighting"
_LIGHT_STAGE_WIDTH = 180


def light_stage_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    images = _images(data)
    if not images:
        return [Absence(_LIGHT_STAGE_ID, _LIGHT_STAGE_TITLE, "The images are missing in the run folder.")]
    entry = next(iter(images.values()))[0]
    figure = Figure(
        id=_LIGHT_STAGE_ID,
        title=_LIGHT_STAGE_TITLE,
        shows=f"Frame {entry.snapshot_frame} of scene {entry.sequence.scene}{data.elsewhere('lighting')} under "
        f"{data.view['lighting']}, and under the first, the middle and the last light of each group: "
        f"{listing(light_sweeps.sweeps(data))}.",
        look_for="Where shadows and bright spots move with the light, the images change although the scene does not.",
        spec=_light_stage_chart(images),
        message=f"Scene {entry.sequence.scene} under {len(images)} of {len(data.lightings)} lightings",
    )
    return [figure]


def _images(data: ReportData) -> dict[str, tuple[SequenceEntry, bytes]]:
    """Sequence and image of the first scene under some lightings, the reference first, by their names."""
    scene = next(iter(data.sequences.values())).sequence.scene
    chosen = [light for names in light_sweeps.sweeps(data).values() for light in _ends_and_middle(names)]
    images: dict[str, tuple[SequenceEntry, bytes]] = {}
    for lighting in (data.view["lighting"], *dict.fromkeys(chosen)):
        wanted = {**data.view, "lighting": lighting, "scene": scene}
        for entry in data.manifest.sequences.values():
            if all(getattr(entry.sequence, name) == value for name, value in wanted.items()):
                png = stored_image(data, entry)
                images |= {} if png is None else {lighting: (entry, png)}
    return images


def _ends_and_middle(names: Sequence[str]) -> Sequence[str]:
    return names[0], names[len(names) // 2], names[-1]


def _light_stage_chart(images: Mapping[str, tuple[SequenceEntry, bytes]]) -> Spec:
    """One panel per lighting, at most four in a row."""
    named = {f"image_{place}": image for place, image in enumerate(images.values())}
    panels = [
        Panel(layered(background(entry, name)).properties(title=lighting, **size(entry, _LIGHT_STAGE_WIDTH)))
        for lighting, (name, (entry, _)) in zip(images, named.items(), strict=True)
    ]
    return with_images(arranged(panels, columns=4), named)


MOST = 4
_TRAJECTORY_TITLE = "Camera path"
_POINTS, _HEADINGS = 300, 12
_SIZE = {"width": 235, "height": 190}
_STILL_DEG = 1e-5
"""Rotations smaller than this are rounding errors of quaternions."""
_AXES = ("x", "y", "z")
_TRAJECTORY_COLOURS = dict(zip(_AXES, style.colours(_AXES), strict=True))


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


def trajectory_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: one row per motion, for the first scene of each of the first motions."""
    chosen = first_of_each_motion(list(data.sequences))
    if not chosen:
        return [Absence("trajectory", _TRAJECTORY_TITLE, "No tracker found a feature, so there is no path.")]
    paths = [_path(data, key) for key in chosen[:MOST]]
    more = len(data.sequences) - len(paths)
    left_out = f" {count(more, 'other scene').capitalize()} {'is' if more == 1 else 'are'} not drawn." if more else ""
    figure = Figure(
        id="trajectory",
        title=_TRAJECTORY_TITLE,
        shows="Left: the camera path along the two world axes in which it extends farthest. The dot is its start. "
        "Strokes show the viewing direction. Middle: displacement from the first frame along each world axis. Right: "
        "rotation about each axis of the camera (x right, y down, z forward), summed from frame to frame. The legend "
        f"holds for both.{left_out}",
        look_for=" ".join(_sentence(path) for path in paths),
        spec=arranged([panel for path in paths for panel in _row(path)], columns=3),
        message=_trajectory_message(paths[0]),
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
    median: float | None = data.run.scan("tracks", key).select(pl.col("depth_m").median()).collect().item()
    return median


def _trajectory_message(path: Path) -> str:
    return f"{path.scene} moves {number(path.moved_m)}{SPACE}m and rotates {number(path.turned_deg)}°"


def _sentence(path: Path) -> str:
    moves = f"In total, {_trajectory_message(path)}"
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
    legend = (marks.shown("axis", _TRAJECTORY_COLOURS),)
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
        color=marks.colour("axis", _TRAJECTORY_COLOURS, "axis"),
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


FIGURES: Sections = {
    "example-frames": (example_frame_figures, light_stage_figures),
    "trajectory": (trajectory_figures,),
}
"""What this module draws, by the section of the report."""
