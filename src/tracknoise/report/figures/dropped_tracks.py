"""The image of one scene with the features of a tracker whose tracks trimming kept, and of those that it dropped."""

from dataclasses import dataclass

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.frame_image import IMAGE, along_u, along_v, background, size, stored_image, with_images
from tracknoise.report.figures.layout import Panel, Spec, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry

_COLOURS = {"kept": style.PALETTE[4], "dropped": style.PALETTE[1]}
_WIDTH = 400


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
            color=marks.colour("trimming", _COLOURS, "trimming"),
            opacity=marks.opacity("trimming"),
            tooltip=tips,
        )
        dots = base.mark_point(size=14, clip=True)
        lines = base.transform_filter("datum.trimming == 'dropped'").mark_rule(clip=True, strokeWidth=1.4)
        lines = lines.encode(x2=alt.X2("u_true:Q"), y2=alt.Y2("v_true:Q"))
        chart = layered(background(self.entry), lines, dots)
        place = f"scene {self.entry.sequence.scene}, frame {self.entry.snapshot_frame}"
        title = f"{tracker}, {place}" if rows.height else f"{tracker}, no known error in {place}"
        legend = marks.shown("trimming", _COLOURS)
        return Panel(chart.properties(title=title, **size(self.entry, _WIDTH)), (legend,), layer=1)

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
    observed = data.run.sequence_table("observations", entry.key)
    now = observed.filter(pl.col("speed") == data.slowest, pl.col("frame") == entry.snapshot_frame)
    error = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    positions = {"u": "u_px", "v": "v_px", "u_true": "u_true_px", "v_true": "v_true_px"}
    trimming = pl.when("kept").then(pl.lit("kept")).otherwise(pl.lit("dropped"))
    known = now.drop_nulls(["du_px", "kept"])
    return known.select("tracker", "track", "age", **positions, error=error, trimming=trimming)
