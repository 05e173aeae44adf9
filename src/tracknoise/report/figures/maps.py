"""Errors by where features are: cells of the image, speed in the image, and surroundings.

- Mean error in each cell of the image: one map per age.
- Mean error along and across the image motion, by how fast the image moves.
- Errors by depth, by the nearest depth edge, by the angle of incidence, by parallax, and by occlusion.
"""

from collections.abc import Sequence

import altair as alt
import numpy as np
import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import surroundings_message, values
from tracknoise.report.figures.panels import Panel, arranged, curves, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import MAP_COLUMNS, MAP_ROWS
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding
from tracknoise.topics.bands import describe_bounds, describe_intervals
from tracknoise.words import MINUS, SPACE, TIMES, count, format_estimate, number, percent, px, sentence_case

_WIDTH = 420
_FEWEST = 5
"""Cells with fewer errors than this are left out."""
_LONGEST = 1.6
"""Arrows are drawn no longer than this, cells."""
_ROUND = (1.0, 2.0, 5.0, 10.0)
_IMAGE_MAP_GUIDE = (
    "Arrows that point towards the centre or away from it, and grow with the distance from it, suggest a wrong focal "
    "length or lens under motion along the optical axis. Arrows whose component along the motion changes from the top "
    "of the image to its bottom suggest a rolling shutter. Arrows along the motion everywhere suggest a clock offset, "
    "or a wrong focal length under rotation. Scattered arrows at objects suggest the tracker itself, at depth edges "
    "for example. If all trackers have the same arrows, suspect the truth."
)


def image_map_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_image_map_figure(data, tracker) for tracker in data.trackers]


def _image_map_figure(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"image-map-{data.slug(tracker)}", f"{tracker}, by place in the image"
    all_cells = data.nominal(data["image_cells"]).filter(pl.col("tracker") == tracker)
    enough = pl.col("n").sum().over("at") >= data.min_features
    cells = all_cells.filter(enough).filter(pl.col("n") >= _FEWEST)
    if cells.is_empty():
        return Absence(name, title, f"No age has {data.min_features} features with a known error.")
    ages = cells["at"].unique().sort().to_list()
    bounded = cells.filter(pl.col("differs").is_not_null())
    shows = (
        f"Untrimmed errors of visible features at speed {data.slowest}{data.where}, in {MAP_COLUMNS}{SPACE}{TIMES}"
        f"{SPACE}{MAP_ROWS} cells of the image. An arrow shows the direction and size of the mean error; the length of "
        f"one cell is stated above each map. Arrows are cut at {_LONGEST} cells. The larger a disc is, the larger the "
        f"spread of the errors. The darker a cell is drawn, the more features it has; cells with fewer than {_FEWEST} "
        "are left out. An outlined cell has a mean that differs from zero. "
        f"{describe_intervals(bounded, of='the means', marks='Outlines by', n_scenes='n_scenes')}"
    )
    panels = [_image_map_panel(data, cells.filter(at=at), tracker, at) for at in ages]
    look_for = f"{_outlined(data, bounded, ages)} {_IMAGE_MAP_GUIDE}"
    spec = arranged(panels, columns=2, independent=["opacity", "size"])
    return Figure(name, title, shows, look_for, spec, _image_map_message(tracker, bounded.filter(at=ages[0])))


def _image_map_message(tracker: str, cells: pl.DataFrame) -> str:
    """In how many cells the mean differs from zero, where these are more than by chance."""
    differing = int(cells["differs"].sum())
    by_chance = (1 - cells["level"][0]) * cells.height if cells.height else 0.0
    if differing <= by_chance + max(by_chance, 3 * np.sqrt(by_chance)):
        return ""
    return f"The mean error of {tracker} differs from zero in {differing} of {cells.height} cells of the image"


def _outlined(data: ReportData, bounded: pl.DataFrame, ages: Sequence[int]) -> str:
    parts = []
    for at in ages:
        differs = bounded.filter(at=at)["differs"]
        if differs.len():
            place = data.axis.opening_place(data.since_zero(at))
            parts.append(f"{place}, {count(int(differs.sum()), 'cell')} of {differs.len()} differ from zero.")
    by_chance = f"By chance, about {100 * (1 - bounded['level'][0]):g}{SPACE}% of the cells would." if parts else ""
    return " ".join([*parts, by_chance]) or "No cell has an interval, because too little can be resampled."


def _image_map_panel(data: ReportData, cells: pl.DataFrame, tracker: str, at: int) -> Panel:
    unit_px = _cell_px(cells)
    table = _drawn(cells, unit_px)
    base = alt.Chart(marks.rows(table))
    colour = data.colour[tracker]
    opacity = alt.Opacity("n:Q", scale=alt.Scale(type="sqrt", range=[0.25, 1.0]), legend=None)
    x = alt.X("x:Q", scale=alt.Scale(domain=[0, MAP_COLUMNS], nice=False), axis=None)
    y = alt.Y("y:Q", scale=alt.Scale(domain=[MAP_ROWS, 0], nice=False), axis=None)
    tips = [alt.Tooltip(f"{name}:Q") for name in ("n", "mean_u_px", "mean_v_px", "spread_px")]
    size = alt.Size("radius:Q", scale=alt.Scale(type="pow", exponent=2, range=[0, 330], domain=[0, 1]), legend=None)
    disc = base.mark_point(filled=True, shape="circle", color=style.QUIET, strokeWidth=0, clip=True)
    disc = disc.encode(x=x, y=y, size=size, opacity=alt.Opacity("faint:Q", scale=None, legend=None), tooltip=tips)
    shaft = base.mark_rule(color=colour, strokeWidth=1.6, clip=True)
    shaft = shaft.encode(x=x, y=y, x2=alt.X2("to_x:Q"), y2=alt.Y2("to_y:Q"), opacity=opacity)
    turned = alt.Angle("angle:Q", scale=alt.Scale(domain=[-180, 180], range=[-180, 180]))
    head = base.mark_point(filled=True, shape="triangle-up", color=colour, size=28, clip=True)
    head = head.encode(x=marks.on(x, "to_x"), y=marks.on(y, "to_y"), angle=turned, opacity=opacity)
    entries = list(data.sequences.values())
    height = round(_WIDTH * entries[0].height / entries[0].width) if entries else _WIDTH
    title = sentence_case(f"{data.axis.place(data.since_zero(at))}: one cell is {number(unit_px)}{SPACE}px")
    chart = layered(disc, *_outlines(table, colour, x, y), shaft, head)
    frame = alt.ViewBackground(stroke=style.QUIET)
    return Panel(chart.properties(width=_WIDTH, height=height, title=alt.Title(title, color=style.INK), view=frame))


def _outlines(table: pl.DataFrame, colour: str, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """Rectangles around the cells whose mean differs from zero."""
    differing = table.filter(pl.col("differs").fill_null(value=False))
    if differing.is_empty():
        return []
    box = alt.Chart(marks.rows(differing.select("left", "right", "top", "bottom")))
    outlined: alt.Chart = box.mark_rect(filled=False, stroke=colour, strokeWidth=1.1).encode(
        x=marks.on(x, "left"), x2=alt.X2("right:Q"), y=marks.on(y, "top"), y2=alt.Y2("bottom:Q")
    )
    return [outlined]


def _cell_px(cells: pl.DataFrame) -> float:
    """Round length of the mean error that is drawn as one cell: nine of ten arrows are not longer."""
    length = (pl.col("mean_u_px").pow(2) + pl.col("mean_v_px").pow(2)).sqrt()
    most = cells.select(length.quantile(0.9)).item()
    if not most:
        return 1.0
    power = 10.0 ** np.floor(np.log10(most))
    return float(next(step * power for step in _ROUND if step * power >= most * (1 - 1e-9)))


def _drawn(cells: pl.DataFrame, unit_px: float) -> pl.DataFrame:
    """Positions, in cells, of what is drawn; discs of the largest tenth of the spreads are of one size."""
    u, v = pl.col("mean_u_px"), pl.col("mean_v_px")
    length = (u.pow(2) + v.pow(2)).sqrt() / unit_px
    factor = (_LONGEST / length.clip(lower_bound=1e-12)).clip(upper_bound=1.0) / unit_px
    widest = float(cells["spread_px"].quantile(0.9) or 1.0)
    share = (pl.col("n") / pl.col("n").max()).sqrt()
    return cells.select(
        "n", "mean_u_px", "mean_v_px", "spread_px", "differs",
        left=pl.col("column") + 0.04, right=pl.col("column") + 0.96,
        top=pl.col("row") + 0.04, bottom=pl.col("row") + 0.96,
        x=pl.col("column") + 0.5, y=pl.col("row") + 0.5,
        to_x=pl.col("column") + 0.5 + u * factor, to_y=pl.col("row") + 0.5 + v * factor,
        angle=pl.arctan2(u, -v).degrees(),
        radius=(pl.col("spread_px") / widest).clip(upper_bound=1.0), faint=0.06 + 0.2 * share,
    )  # fmt: skip


_NAME, _TITLE = "error-by-image-speed", "Error along the image motion, by its speed"
_DECADES = [step * 10.0**power for power in range(-4, 4) for step in (1, 2, 5)]
_IMAGE_SPEED_GUIDE = (
    "An error along the motion that grows in proportion to the speed has several possible causes. A wrong focal "
    "length, or a wrong scale of depths or poses, makes the true motion too long or too short; the error then grows "
    "with age too. A clock offset gives an error of the same size at every age. If all trackers have the same curve, "
    "suspect the truth. Otherwise the tracker lags. Errors across the motion are the comparison: none of these causes "
    "affects them."
)
_DIRECTIONS = {"along": "along the motion", "across": "across it, to the right"}


def image_speed_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    points = data.nominal(data["speed_errors"]).filter(pl.col("n") >= data.min_features)
    if points.is_empty():
        why = f"No speed of the image has {data.min_features} features with a known error."
        return [Absence(_NAME, _TITLE, why)]
    ages = points["at"].unique().sort().to_list()
    panels = [_image_speed_panel(data, points, at, coordinate) for at in ages for coordinate in _DIRECTIONS]
    shows = (
        f"Mean untrimmed error of visible features at speed {data.slowest}{data.where}, by the speed of the true "
        "position in the image. Left: along its motion, negative if the feature lags behind. Right: across it. "
        f"Classes with fewer than {count(data.min_features, 'feature')} are left out. "
        f"{describe_bounds(points, of='the curves')}"
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_NAME, _TITLE, shows, _look_for_image_speed(data, points), spec, _image_speed_message(data, points))]


def _image_speed_message(data: ReportData, points: pl.DataFrame) -> str:
    """Trackers that lag behind the fastest motion at the first age, where the interval does not contain zero."""
    first = points.filter(pl.col("at") == pl.col("at").min(), coordinate="along")
    fastest = first.filter(pl.col("class_low") == pl.col("class_low").max().over("tracker"))
    lagging = dict(fastest.filter(pl.col("high") < 0).select("tracker", "mean_px").iter_rows())
    texts = {name: px(-lagging[name]) for name in data.trackers if name in lagging}
    return values(texts, "Lag behind the fastest motion")


def _look_for_image_speed(data: ReportData, points: pl.DataFrame) -> str:
    """The mean error along the motion of each tracker at the first age, at its highest speed, and what causes it."""
    first = points.filter(pl.col("at") == pl.col("at").min(), pl.col("coordinate") == "along").sort("class_low")
    parts = []
    for tracker in data.trackers:
        for row in first.filter(tracker=tracker).tail(1).to_dicts():
            estimate = format_estimate(Estimate.of_row(row, "mean_px", "low", "high", "px"))
            speeds = f"{number(row['class_low'])} to {number(row['class_high'])}{SPACE}px per frame"
            place = data.axis.opening_place(data.since_zero(row["at"]))
            parts.append(f"{place}, the mean error of {tracker} along the motion is {estimate} at {speeds}.")
    return " ".join([*parts, _IMAGE_SPEED_GUIDE])


def _image_speed_panel(data: ReportData, points: pl.DataFrame, at: int, coordinate: str) -> Panel:
    table = points.filter(at=at, coordinate=coordinate).select(
        "tracker", "n", at=(pl.col("class_low") * pl.col("class_high")).sqrt(), u="mean_px", u_low="low", u_high="high"
    )
    title = f"{_DIRECTIONS[coordinate]}, {data.axis.place(data.since_zero(at))}"
    speeds = alt.Scale(type="log", domain=_range(points), nice=False)
    ticks = alt.Axis(values=_DECADES, format="~g")
    x = alt.X("at:Q", title="speed of the image (px per frame)", scale=speeds, axis=ticks)
    at_age = points.filter(at=at)
    domain = marks.holding(at_age["mean_px"], pl.concat([at_age["low"], at_age["high"]]))
    y = alt.Y(
        "u:Q",
        title="mean error (px)" if coordinate == "along" else None,
        scale=alt.Scale(domain=domain, nice=False),
        axis=alt.Axis(tickCount=5),
    )
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q", title="px per frame"), alt.Tooltip("n:Q"), alt.Tooltip("u:Q")]
    above = [marks.zero_line()]
    return curves(
        table, "tracker", "u", x, y, data.colour, tips, title=title, width=400, height=130, point=16, above=above
    )


def _range(points: pl.DataFrame) -> list[float]:
    return [float(bound) for bound in points.select(pl.col("class_low").min(), pl.col("class_high").max()).row(0)]


_PROPERTIES = {
    Surrounding.depth: "depth (m)",
    Surrounding.edge: "distance to a depth edge (px)",
    Surrounding.incidence: "angle of incidence (°)",
    Surrounding.parallax: "parallax (px)",
    Surrounding.occlusion: "occluded",
}
_ROWS = {"mean": "mean error (px)", "second": "RMS error (px)"}
_COORDINATES = {"u": "u", "v": "v", "along": "along the motion"}
_SIDES = {EdgeSide.far: "On the far side", EdgeSide.near: "On the near side", EdgeSide.none: "Elsewhere"}
_SURROUNDING_FEWEST = 20
"""Classes with fewer errors than this are left out."""
_WIDTHS = {Surrounding.edge: 210, Surrounding.occlusion: 70, Surrounding.incidence: 130}


def surrounding_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_surrounding_figure(data, tracker) for tracker in data.trackers]


def _surrounding_figure(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"surroundings-{data.slug(tracker)}", f"{tracker}, by surroundings of the feature"
    errors = data.nominal(data["surrounding_errors"]).filter(pl.col("tracker") == tracker)
    at = _last_age(errors, data.min_features)
    if at is None:
        why = f"No age has {data.min_features} features with a known error and a known depth."
        return Absence(name, title, why)
    table = errors.filter(pl.col("at") == at, pl.col("n") >= _SURROUNDING_FEWEST)
    points = _points(table)
    present = [surrounding for surrounding in _PROPERTIES if surrounding in points["surrounding"].unique()]
    where = f"{data.axis.place(data.since_zero(at))} at speed {data.slowest}{data.where}"
    shows = (
        f"Untrimmed errors of {tracker} {where}, by what surrounds a feature in its first frame. Distances to a depth "
        "edge are negative on its far side, which is the surface behind. The class none has no edge within 15 px. "
        "Parallax is how far the true position moved since its error was zero, relative to the median of all features. "
        "Occlusion is that of the point: never while it is tracked, later, or now. All but the last class are of "
        f"visible features. Classes with fewer than {_SURROUNDING_FEWEST} features are left out. "
        f"{describe_bounds(points, of='the values', marks='Bars around')}"
    )
    colours = dict(zip(_COORDINATES.values(), style.shades(data.colour[tracker], len(_COORDINATES)), strict=True))
    panels = [_surrounding_panel(points, surrounding, row, colours) for row in _ROWS for surrounding in present]
    spec = arranged(panels, columns=len(present))
    return Figure(name, title, shows, _look_for_surroundings(table), spec, surroundings_message(tracker, table))


def _last_age(errors: pl.DataFrame, least: int) -> int | None:
    """The last age at which enough features have a known depth."""
    counted = errors.filter(surrounding=Surrounding.depth, coordinate="u", statistic="mean")
    ages = counted.group_by("at").agg(pl.col("n").sum()).filter(pl.col("n") >= least)["at"].sort()
    return int(ages[-1]) if ages.len() else None


def _points(table: pl.DataFrame) -> pl.DataFrame:
    """Means and root second moments, px, with the names of coordinates as the legend has them."""
    shown = table.filter(pl.col("statistic").is_in(list(_ROWS)), pl.col("surrounding") != Surrounding.side)
    root = pl.col("statistic") == "second"
    values = pl.col("value", "low", "high")
    return shown.with_columns(
        pl.when(root).then(values.clip(lower_bound=0.0).sqrt()).otherwise(values),
        pl.col("coordinate").replace_strict(_COORDINATES),
        pl.col("class").str.replace_all("-", MINUS, literal=True).str.replace_all(".0", "", literal=True),
    )


def _surrounding_panel(points: pl.DataFrame, surrounding: Surrounding, row: str, colours: dict[str, str]) -> Panel:
    table = points.filter(surrounding=surrounding, statistic=row)
    x = alt.X(
        "class:N",
        sort=_order(table, surrounding),
        title=_PROPERTIES[surrounding] if row == "second" else None,
        axis=alt.Axis(labelAngle=-50, labels=row == "second", labelOverlap=True, labelSeparation=2),
        scale=alt.Scale(paddingInner=0.3),
    )
    first = surrounding == Surrounding.depth
    axis = alt.Axis(labels=first) if row == "mean" else alt.Axis(labels=first, values=_DECADES, format="~g")
    y = alt.Y(
        "value:Q", title=_ROWS[row] if first else None, scale=_scale(points.filter(statistic=row), row), axis=axis
    )
    shift = alt.XOffset("coordinate:N", sort=list(colours), scale=alt.Scale(paddingOuter=0.2))
    hue, opacity = marks.colour("coordinate", colours, "error"), marks.opacity("coordinate")
    drawn = (table if row == "mean" else _positive(table)).select("class", "coordinate", "n", "value", "low", "high")
    base = alt.Chart(marks.rows(drawn)).encode(x=x, xOffset=shift, color=hue, opacity=opacity)
    tips = [
        alt.Tooltip(f"{name}:{kind}")
        for name, kind in (("class", "N"), ("coordinate", "N"), ("n", "Q"), ("value", "Q"))
    ]
    dot = base.mark_point(size=26, filled=True, clip=True).encode(y=y, tooltip=tips)
    bar = base.mark_rule(strokeWidth=1.4, clip=True).encode(y=marks.on(y, "low"), y2=alt.Y2("high:Q"))
    chart = layered(dot, bar, *([marks.zero_line()] if row == "mean" else []))
    width = _WIDTHS.get(surrounding, 165)
    return Panel(chart.properties(width=width, height=170), (marks.shown("coordinate", colours),))


def _positive(table: pl.DataFrame) -> pl.DataFrame:
    """Rows that a logarithmic axis can show; bounds of zero begin below all values."""
    shown = table.filter(pl.col("value") > 0)
    least = shown["value"].min()
    return shown if least is None else shown.with_columns(pl.col("low", "high").clip(lower_bound=float(least) / 10.0))  # type: ignore[arg-type]


def _scale(points: pl.DataFrame, row: str) -> alt.Scale:
    """Linear for means. Logarithmic for root second moments, over a few decades at most."""
    values, ends = points["value"], pl.concat([points["low"], points["high"]])
    if row == "mean":
        return alt.Scale(domain=marks.holding(values, ends), nice=False)
    positive = values.filter(values > 0)
    low, high = (float(positive.min()), float(positive.max())) if positive.len() else (0.1, 1.0)  # type: ignore[arg-type]
    highest = float(points["high"].max() or high)  # type: ignore[arg-type]
    return alt.Scale(type="log", domain=[low / 1.6, min(max(2.0 * high, 1.1 * highest), 20.0 * high)], nice=False)


def _order(table: pl.DataFrame, surrounding: Surrounding) -> list[str]:
    if surrounding == Surrounding.occlusion:
        return [*Occlusion]
    return table.sort("class_low", nulls_last=True)["class"].unique(maintain_order=True).to_list()


def _look_for_surroundings(table: pl.DataFrame) -> str:
    """Numbers of the sides of depth edges in u, and what they mean."""
    rows = {(row["class"], row["statistic"]): row["value"] for row in _in_u(table, Surrounding.side).to_dicts()}
    parts = [
        f"Features {name[0].lower()}{name[1:]} of depth edges are {percent(rows[side, 'share'])} of all, with a mean "
        f"error in u of {px(rows[side, 'mean'])}."
        for side, name in list(_SIDES.items())[:2]
        if (side, "mean") in rows
    ]
    if parts and (EdgeSide.none, "mean") in rows:
        parts.append(f"Elsewhere the mean error in u is {px(rows[EdgeSide.none, 'mean'])}.")
    hidden = {
        row["statistic"]: row
        for row in _in_u(table, Surrounding.occlusion).filter(pl.col("class") == Occlusion.now).to_dicts()
    }
    if "second_removed" in hidden:
        share, removed = (percent(hidden[name]["value"]) for name in ("share", "second_removed"))
        parts.append(
            f"Occluded features are {share} of all. Excluding them removes {removed} of the second moment in u."
        )
    return " ".join(
        [
            *parts,
            "A feature beside a depth edge has two surfaces in its window, and the other surface draws it along. "
            "Errors that grow towards near or far depths suggest a wrong depth scale or offset, or wrong translations.",
        ]
    )


def _in_u(table: pl.DataFrame, surrounding: Surrounding) -> pl.DataFrame:
    return table.filter(surrounding=surrounding, coordinate="u")


FIGURES: Sections = {"error-by-place": (image_map_figures, image_speed_figures, surrounding_figures)}
"""What this module draws, by the section of the report."""
