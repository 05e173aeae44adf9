"""The picture of the first screen, and ``share.png``: what innovations say, what to set, and the worst track.

Sigma is that of the noise model, by the number of frames in a window of the estimator: what to set, and what
innovations look like. Below are frames of the track with the largest error: a cross marks
the observed position, a circle the true one.
"""

import base64
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from markupsafe import Markup
from PIL import Image

from tracknoise.estimators.advice import innovations_of
from tracknoise.estimators.exports import estimator, windows_text
from tracknoise.estimators.model import Landmark
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.report import figure_files, style
from tracknoise.text import counted, printable
from tracknoise.topics.answer_summary import NoiseToSet, Summary
from tracknoise.words import px, sentence_case

FILE = "share.png"
WIDTH, HEIGHT = 1200, 630
"""Size of the file, px, as pages that show links expect it."""
MOST_TRACKERS = 3
_MOST_TILES, _TILE = 8, 64
_PLOT_WIDTH, _PLOT_HEIGHT = 560, 236
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 118, 22, 38
_LABEL_GAP = 14.0
_LONGEST_NAME = 14
"""Characters of a name beside a line."""
_ALIKE = 1.1
"""Sigma and innovations that differ by less than this factor are alike."""
_PAGE = {"ink": "var(--ink)", "quiet": "var(--quiet)", "line": "var(--grid)"}
_PAPER = {"ink": style.INK, "quiet": style.QUIET, "line": style.FAINT}


@dataclass(frozen=True, slots=True)
class Curve:
    """Sigma of one tracker by the number of frames in a window.

    Attributes
    ----------
    tracker, colour
        Its name, and its colour in all figures.
    window, sigma
        Frames in a window of the estimator, and what to set there, px.
    windows
        Frames.
    to_set, innovations
        For each of them, px.
    """

    tracker: str
    colour: str
    window: int
    sigma: float
    windows: tuple[int, ...]
    to_set: tuple[float, ...]
    innovations: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Strip:
    """Frames of one track.

    Attributes
    ----------
    png
        Tiles side by side, grey.
    marks
        For each tile the observed and the true position in it, as shares of its side; the true one is None if unknown.
    caption
        What is seen.
    """

    png: bytes
    marks: tuple[tuple[tuple[float, float], tuple[float, float] | None], ...]
    caption: str


@dataclass(frozen=True, slots=True)
class AnswerPlot:
    """What the first screen shows.

    Attributes
    ----------
    title
        What innovations say, and what to set.
    windows
        In what innovations and sigma are compared: ``windows of 11 frames``.
    curves
        Of some trackers, that of the title first.
    strip
        Of its worst track; None where the run keeps no patches.
    """

    title: str
    windows: str
    curves: tuple[Curve, ...]
    strip: Strip | None

    @property
    def label(self) -> str:
        """What is drawn, in a sentence."""
        return (
            f"{self.title} Sigma to set (solid) and what innovations look like (dashed), by frames in a window, for "
            f"{', '.join(curve.tracker for curve in self.curves)}."
        )

    def plot(self) -> Markup:
        """The curves, as a part of a page."""
        return _plot(self, _PAGE)

    @property
    def heading(self) -> str:
        """The title on the page, with the tracker that it is about where there are several."""
        if len(self.curves) < 2:
            return self.title
        return f"With {printable(self.curves[0].tracker)}, {self.title.removeprefix('Your ')}"

    @property
    def subject(self) -> str:
        """Which tracker the title is about, and in what windows."""
        return f"{self.curves[0].tracker}; {self.windows}"

    @property
    def key(self) -> str:
        """What stands under the heading: the windows, and what the lines are where their ends have names."""
        if len(self.curves) < 2:
            return f"{self.subject}."
        return f"{sentence_case(self.windows)}. Solid: set; dashed: innovations."

    def frames(self) -> Markup:
        """The strip, as a part of a page; empty where there is none."""
        return Markup("") if self.strip is None else _tiles(self.strip)


def answer_plot(
    models: Mapping[str, NoiseModel], name: str, settings: Sequence[NoiseToSet], seen: Mapping[str, Any]
) -> AnswerPlot | None:
    """The picture of a run; None where nothing is known that could be set.

    Parameters
    ----------
    models
        Noise models, by tracker.
    name
        Of the estimator of the experiment.
    settings
        What to set in it.
    seen
        Tracks with patches, as `tracknoise.report.looks.looks` returns them.
    """
    curves = {
        setting.tracker: _curve(setting, models[setting.tracker], name)
        for setting in settings
        if setting.tracker in models
    }
    with_windows = [setting for setting in settings if setting.tracker in curves and curves[setting.tracker].windows]
    able = [setting for setting in with_windows if setting.sigma.value and setting.innovations.value]
    if not able:
        return None
    first = max(able, key=lambda setting: (setting.sigma.value or 0.0) / (setting.innovations.value or 1.0))
    chosen = [first, *(setting for setting in able if setting is not first)][:MOST_TRACKERS]
    windows = windows_text(estimator(name).landmark, first.window, first.features)
    shown = tuple(_alike_long([curves[setting.tracker] for setting in chosen]))
    return AnswerPlot(_title(first), windows, shown, _strip(seen, first.tracker, "Its worst" if shown[1:] else "Worst"))


def _title(setting: NoiseToSet) -> str:
    sigma, innovations = setting.sigma.value or 0.0, setting.innovations.value or 0.0
    if setting.is_bound:
        return f"Your innovations say {px(innovations)}. Sigma is at most {px(sigma)}."
    if _alike(sigma, innovations):
        return f"Your innovations are right: set {px(sigma)}."
    return f"Your innovations say {px(innovations)}. Set {px(sigma)}."


def _alike(first: float, second: float) -> bool:
    return first < _ALIKE * second and second < _ALIKE * first


def _alike_long(curves: Sequence[Curve]) -> Iterator[Curve]:
    """Curves up to the longest window that all have."""
    longest = min(curve.windows[-1] for curve in curves)
    for curve in curves:
        n = max(1, sum(window <= longest for window in curve.windows))
        yield replace(curve, windows=curve.windows[:n], to_set=curve.to_set[:n], innovations=curve.innovations[:n])


def _curve(setting: NoiseToSet, model: NoiseModel, name: str) -> Curve:
    """For windows that the tracks of the model can fill, and the shortest one where they fill none."""
    longest = model.training.ages[1] + 1
    windows = sorted({equivalent.window for equivalent in model.equivalents if equivalent.landmark is Landmark.FREE})
    able = [(window, sizes) for window in windows if (sizes := _sizes(model, name, window, setting)) is not None]
    chosen = [pair for pair in able if pair[0] <= longest] or able[:1]
    return Curve(
        setting.tracker,
        setting.colour,
        setting.window,
        setting.sigma.value or 0.0,
        tuple(window for window, _ in chosen),
        tuple(sizes[0] for _, sizes in chosen),
        tuple(sizes[1] for _, sizes in chosen),
    )


def _sizes(model: NoiseModel, name: str, window: int, setting: NoiseToSet) -> tuple[float, float] | None:
    """What to set with such windows and the features of a setting, and what innovations look like; None if unknown."""
    try:
        advice = estimator(name).advise(model, window=window, features=setting.features)
        return advice.sigma.value, innovations_of(model, advice).value
    except SettingsError:
        return None


def _strip(seen: Mapping[str, Any], tracker: str, worst: str) -> Strip | None:
    """Tiles of the track with the largest error of all that have pictures; `worst` opens the caption."""
    groups = [group for group in seen["groups"] if group["tracker"] == tracker and len(group["strip_at"]) > 1]
    if not groups:
        return None
    group = max(groups, key=lambda candidate: float(np.hypot(*candidate["tracks"][0]["error"])))
    track, frames, side = group["tracks"][0], group["strip_at"], seen["patch_px"]
    n = len(frames)
    with Image.open(io.BytesIO(base64.b64decode(group["strip"]))) as image:
        tiles = np.asarray(image.convert("L")).reshape(side, n, side)
    chosen = sorted({round(place) for place in np.linspace(0, n - 1, min(n, _MOST_TILES))})
    path = dict(
        zip(track["path"]["frame"], zip(track["path"]["du_px"], track["path"]["dv_px"], strict=True), strict=True)
    )
    marks = tuple(_marked(side, path.get(frames[place])) for place in chosen)
    size = float(np.hypot(*track["error"]))
    frames_on = track["frame"] - track["anchor_frame"]
    caption = f"{worst} track: {px(size)} off after {counted(frames_on, 'frame')}. Cross: track. Circle, line: truth."
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(tiles[:, chosen].reshape(side, -1))).save(buffer, "png")
    return Strip(buffer.getvalue(), marks, caption)


def _marked(side: int, error: tuple[float, float] | None) -> tuple[tuple[float, float], tuple[float, float] | None]:
    """The observed position is that of the middle pixel, to half a pixel."""
    middle = 0.5
    if error is None:
        return (middle, middle), None
    return (middle, middle), (middle - error[0] / side, middle - error[1] / side)


def _plot(shown: AnswerPlot, colours: Mapping[str, str]) -> Markup:
    values = [value for curve in shown.curves for value in (*curve.to_set, *curve.innovations, curve.sigma)]
    windows = sorted({window for curve in shown.curves for window in (*curve.windows, curve.window)})
    most = 1.08 * max(values)
    width, height = _PLOT_WIDTH - _LEFT - _RIGHT, _PLOT_HEIGHT - _TOP - _BOTTOM

    def x(window: float) -> float:
        return _LEFT + width * (window - windows[0]) / ((windows[-1] - windows[0]) or 1)

    def y(value: float) -> float:
        return _TOP + height * (1.0 - value / most)

    grid = [_rule(y(value), f"{value:g}", colours) for value in _ticks(most)]
    ticks = [_tick(x(window), str(window), colours) for window in _apart([(x(window), window) for window in windows])]
    lines = [part for curve in shown.curves for part in _lines(curve, x, y)]
    ends = [(y(value), name, curve.colour) for curve in shown.curves for name, value in _ends(curve, shown.curves)]
    dots = [_dot(x(curve.window), y(curve.sigma), curve.colour) for curve in shown.curves]
    labels = [_label(place, text, colour, colours) for place, text, colour in _spread(ends)]
    axis = Markup('<text x="{x}" y="{y}" text-anchor="middle" fill="{quiet}">window, frames</text>').format(
        x=_LEFT + width / 2, y=_PLOT_HEIGHT - 4, **colours
    )
    unit = Markup('<text x="{x}" y="{y}" fill="{quiet}">sigma, px</text>').format(x=4, y=_TOP - 10, **colours)
    return Markup(
        '<svg class="plot" role="img" aria-label="{label}" viewBox="0 0 {width} {height}" font-size="12">{parts}</svg>'
    ).format(
        label=printable(shown.label),
        width=_PLOT_WIDTH,
        height=_PLOT_HEIGHT,
        parts=Markup("").join([*grid, *ticks, axis, unit, *lines, *dots, *labels]),
    )


def _ticks(most: float) -> list[float]:
    """Zero, and one or two round numbers up to the largest value."""
    power = 10.0 ** math.floor(math.log10(most))
    step = max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= most)
    return [0.0, *(place * step for place in (1, 2) if place * step <= most)]


def _rule(y: float, text: str, colours: Mapping[str, str]) -> Markup:
    return Markup(
        '<line x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}" stroke="{line}"/>'
        '<text x="{x}" y="{base:.1f}" text-anchor="end" fill="{quiet}">{text}</text>'
    ).format(left=_LEFT, right=_PLOT_WIDTH - _RIGHT, y=y, x=_LEFT - 6, base=y + 4, text=text, **colours)


def _tick(x: float, text: str, colours: Mapping[str, str]) -> Markup:
    return Markup('<text x="{x:.1f}" y="{y}" text-anchor="middle" fill="{quiet}">{text}</text>').format(
        x=x, y=_PLOT_HEIGHT - _BOTTOM + 16, text=text, **colours
    )


def _apart(places: Sequence[tuple[float, int]]) -> list[int]:
    """Those of ticks that are far enough from the one before."""
    kept: list[tuple[float, int]] = []
    for place, window in places:
        if not kept or place - kept[-1][0] >= 8 * _LABEL_GAP:
            kept.append((place, window))
    return [window for _, window in kept]


def _lines(curve: Curve, x: Any, y: Any) -> list[Markup]:
    """Solid: what to set; dashed: what innovations look like."""
    line = Markup(
        '<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.2" stroke-linejoin="round"{dash}/>'
    )
    return [
        line.format(
            points=" ".join(f"{x(at):.1f},{y(value):.1f}" for at, value in zip(curve.windows, values, strict=True)),
            colour=curve.colour,
            dash=Markup(dash),
        )
        for values, dash in ((curve.to_set, ""), (curve.innovations, ' stroke-dasharray="5 4"'))
    ]


def _ends(curve: Curve, curves: Sequence[Curve]) -> Iterator[tuple[str, float]]:
    """What the ends of its lines are called: of several trackers their names, of one what the lines are."""
    to_set, innovations = curve.to_set[-1], curve.innovations[-1]
    if len(curves) > 1:
        yield _short(printable(curve.tracker), _LONGEST_NAME), to_set
    elif _alike(to_set, innovations):
        yield "both alike", to_set
    else:
        yield from (("set", to_set), ("innovations", innovations))


def _dot(x: float, y: float, colour: str) -> Markup:
    return Markup('<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="{colour}"/>').format(x=x, y=y, colour=colour)


def _spread(ends: Sequence[tuple[float, str, str]]) -> list[tuple[float, str, str]]:
    """Labels from top to bottom, none closer to the one above than the height of a line."""
    placed: list[tuple[float, str, str]] = []
    for place, text, colour in sorted(ends):
        lowest = placed[-1][0] + _LABEL_GAP if placed else place
        placed.append((max(place, lowest), text, colour))
    beyond = max(0.0, placed[-1][0] - (_PLOT_HEIGHT - _BOTTOM)) if placed else 0.0
    return [(place - beyond, text, colour) for place, text, colour in placed]


def _label(y: float, text: str, colour: str, colours: Mapping[str, str]) -> Markup:
    """The name of a line at its end: a mark in the colour of the tracker, the text in that of all text."""
    x = _PLOT_WIDTH - _RIGHT + 6
    return Markup(
        '<circle cx="{cx}" cy="{cy:.1f}" r="3.5" fill="{colour}"/><text x="{x}" y="{y:.1f}" fill="{ink}">{text}</text>'
    ).format(cx=x, cy=y, colour=colour, x=x + 8, y=y + 4, text=text, **colours)


def _tiles(strip: Strip) -> Markup:
    n = len(strip.marks)
    width = n * _TILE
    marks = Markup("").join(_mark(place * _TILE, *pair) for place, pair in enumerate(strip.marks))
    return Markup(
        '<svg class="tiles" role="img" aria-label="{caption}" viewBox="0 0 {width} {tile}" width="{width}">'
        '<image href="data:image/png;base64,{png}" width="{width}" height="{tile}" image-rendering="pixelated" '
        'preserveAspectRatio="none"/>{marks}</svg>'
    ).format(caption=strip.caption, width=width, tile=_TILE, png=base64.b64encode(strip.png).decode(), marks=marks)


def _mark(left: float, observed: tuple[float, float], true: tuple[float, float] | None) -> Markup:
    """A cross and a circle, white on dark so that they are seen on any image."""
    x, y = left + observed[0] * _TILE, observed[1] * _TILE
    shapes = Markup('<path d="M{a:.1f},{y:.1f}h12M{x:.1f},{b:.1f}v12"/>').format(a=x - 6, x=x, y=y, b=y - 6)
    if true is not None:
        shapes += _true_mark(left, x, y, left + true[0] * _TILE, true[1] * _TILE)
    border = Markup('<path d="M{x},0v{tile}" stroke="#000000" stroke-width="1"/>').format(x=left, tile=_TILE)
    style_of = '<g fill="none" stroke="{stroke}" stroke-width="{width}">{shapes}</g>'
    return border + Markup("").join(
        Markup(style_of).format(stroke=stroke, width=width, shapes=shapes)
        for stroke, width in (("#000000", 3.2), ("#ffffff", 1.4))
    )


def _true_mark(left: float, x: float, y: float, true_x: float, true_y: float) -> Markup:
    """A circle at the true place; where it is outside the tile, a line from the observed place to the border."""
    if left <= true_x <= left + _TILE and 0.0 <= true_y <= _TILE:
        return Markup('<circle cx="{x:.1f}" cy="{y:.1f}" r="6"/>').format(x=true_x, y=true_y)
    du, dv = true_x - x, true_y - y
    reach = _TILE / 2 / max(abs(du), abs(dv))
    return Markup('<path d="M{x:.1f},{y:.1f}l{du:.1f},{dv:.1f}"/>').format(x=x, y=y, du=reach * du, dv=reach * dv)


def png(shown: AnswerPlot, summary: Summary) -> bytes:
    """The picture as a file of `WIDTH` times `HEIGHT` px: to share, and for readmes."""
    plot = _nested(_plot(shown, _PAPER), x=24, y=150, scale=1.4)
    tiles = Markup("") if shown.strip is None else _nested(_tiles(shown.strip), x=48, y=494, scale=1.1)
    legend = [
        Markup(
            '<circle cx="868" cy="{y}" r="7" fill="{colour}"/><text x="886" y="{base}" font-size="24">{name}</text>'
        ).format(
            y=192 + 40 * place, base=200 + 40 * place, colour=curve.colour, name=_short(printable(curve.tracker), 26)
        )
        for place, curve in enumerate(shown.curves)
    ]
    texts = [
        (48, 84, 48, 700, shown.title),
        (48, 126, 24, 400, shown.subject),
        (860, 380, 20, 400, "solid: sigma to set"),
        (860, 410, 20, 400, "dashed: what innovations say"),
        *([] if shown.strip is None else [(48, 594, 18, 400, shown.strip.caption)]),
        (860, 594, 18, 400, f"tracknoise: {summary.experiment}"),
    ]
    labels = [
        Markup('<text x="{x}" y="{y}" font-size="{size}" font-weight="{weight}">{text}</text>').format(
            x=x, y=y, size=size, weight=weight, text=_short(printable(text), int(1.95 * (WIDTH - x - 20) / size))
        )
        for x, y, size, weight, text in texts
    ]
    svg = Markup(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'font-family="{font}" fill="{ink}"><rect width="{width}" height="{height}" fill="#ffffff"/>{parts}</svg>'
    ).format(
        width=WIDTH,
        height=HEIGHT,
        font=style.FONT,
        ink=style.INK,
        parts=Markup("").join([*labels, *legend, plot, tiles]),
    )
    return figure_files.png_of(str(svg), scale=1.0)


def _nested(svg: Markup, *, x: float, y: float, scale: float) -> Markup:
    """A drawing within another one, at a place."""
    return Markup('<g transform="translate({x} {y}) scale({scale})">{parts}</g>').format(
        x=x, y=y, scale=scale, parts=Markup(svg.split(">", 1)[1].removesuffix("</svg>"))
    )


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
