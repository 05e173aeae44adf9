"""One frame of each scene with the features of every tracker, their magnified errors and their trails."""

from collections.abc import Sequence
from dataclasses import dataclass

import altair as alt
import numpy as np
import polars as pl

from tracknoise.findings.wording import count, px
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.frame_image import IMAGE, along_u, along_v, background, size, stored_image, with_images
from tracknoise.report.figures.layout import Panel, Spec, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry

_ID, _TITLE = "example-frames", "Example frames"
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


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per scene, for the first few scenes."""
    entries = list(data.sequences.values())
    if not entries:
        return [Absence(_ID, _TITLE, "No tracker found a feature, so there is nothing to draw.")]
    if not data.keeps_observations:
        why = 'The run keeps only statistics (keep = "statistics"), not the single errors that this figure needs.'
        return [Absence(_ID, _TITLE, why)]
    made: list[Figure | Absence] = [
        _figure(data, entry, place) for place, entry in enumerate(entries[:MOST_SCENES], start=1)
    ]
    if len(entries) > MOST_SCENES:
        why = f"Only the first {MOST_SCENES} of {len(entries)} scenes are drawn. The statistics below cover all scenes."
        made.append(Absence(f"{_ID}-others", "Other scenes", why))
    return made


def _figure(data: ReportData, entry: SequenceEntry, place: int) -> Figure | Absence:
    name, title = f"{_ID}-{place}", f"Scene {entry.sequence.scene}"
    png = stored_image(data, entry)
    if png is None:
        return Absence(name, title, f"The image of frame {entry.snapshot_frame} is missing in the run folder.")
    scene = _scene(data, entry, png)
    if scene.features.is_empty():
        return Absence(name, title, _nothing(data, entry))
    return Figure(name, title, _shows(data, scene), _look_for(data, scene), _chart(data, scene), _message(data, scene))


def _message(data: ReportData, scene: Scene) -> str:
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
    observed = data.run.sequence_table("observations", entry.key).filter(
        (pl.col("speed") == data.slowest)
        & (pl.col("frame") <= entry.snapshot_frame)
        & (pl.col("frame").cast(pl.Int64) >= entry.snapshot_frame - TRAIL * data.slowest)
    )
    error = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    fixed = pl.col("age") == 0 if entry.key_frame is None else pl.col("frame") == entry.key_frame
    now = observed.filter(pl.col("frame") == entry.snapshot_frame, ~fixed).drop_nulls("du_px")
    now = now.with_columns(error_px=error).sort("tracker", "track")
    features = pl.concat([now.clear(), *(_spread(now.filter(tracker=name)) for name in data.trackers)])
    columns = ["tracker", "track", "frame", "u_px", "v_px"]
    trails = observed.select(columns).join(features.select("tracker", "track"), on=["tracker", "track"], how="semi")
    magnification = _magnification(features["error_px"], entry.width)
    return Scene(entry, png, features, trails.sort(columns[:3]), magnification, 0.1 * entry.width / magnification)


def _spread(features: pl.DataFrame) -> pl.DataFrame:
    """At most `MOST_FEATURES` rows, evenly spaced in the table."""
    if features.height <= MOST_FEATURES:
        return features
    chosen = np.linspace(0, features.height - 1, MOST_FEATURES).round().astype(np.int64)
    return features.select(pl.all().gather(chosen))


def _magnification(errors: pl.Series, width: int) -> int:
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


def _chart(data: ReportData, scene: Scene) -> Spec:
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
