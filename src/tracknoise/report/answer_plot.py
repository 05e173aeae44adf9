"""The curves of the first screen: what to set, and what innovations suggest, by the frames in a window."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from markupsafe import Markup

from tracknoise.estimators.advice import innovations_of
from tracknoise.estimators.exports import estimator, windows_text
from tracknoise.estimators.model import Landmark
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.text import printable
from tracknoise.topics.answer_summary import NoiseToSet
from tracknoise.words import px

MOST_TRACKERS = 3
_PLOT_WIDTH, _PLOT_HEIGHT = 560, 236
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 118, 22, 38
_LABEL_GAP = 14.0
_LONGEST_NAME = 14
"""Characters of a name beside a line."""
_ALIKE = 1.1
"""Sigma and innovations that differ by less than this factor are alike."""
_PAGE = {"ink": "var(--ink)", "quiet": "var(--quiet)", "line": "var(--grid)"}


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

    def at(self, window: int) -> float | None:
        """What to set in windows of a length, px; None where it is not known."""
        return self.sigma if window == self.window else dict(zip(self.windows, self.to_set, strict=True)).get(window)


@dataclass(frozen=True, slots=True)
class AnswerPlot:
    """What the first screen shows.

    Attributes
    ----------
    title
        What innovations suggest, and what to set.
    windows
        In what innovations and sigma are compared: ``windows of 11 frames``.
    curves
        Of some trackers, that of the title first.
    why
        Why innovations differ from sigma, in a sentence; empty where they do not.
    solid
        What the solid lines are: what to set, or the most that sigma can be.
    """

    title: str
    windows: str
    curves: tuple[Curve, ...]
    why: str = ""
    solid: str = "set"

    @property
    def label(self) -> str:
        """What is drawn, in a sentence."""
        return (
            f"{self.title} Sigma to set (solid) and what innovations suggest (dashed), by frames in a window, for "
            f"{', '.join(curve.tracker for curve in self.curves)}."
        )

    def plot(self, colours: Mapping[str, str] = _PAGE) -> Markup:
        """The curves, as a part of a page. Of the dots, those of the windows of the title are seen."""
        return _plot(self, colours)

    def titled(self, setting: NoiseToSet, name: str) -> "AnswerPlot":
        """The same with a title about other windows of the estimator of this name."""
        landmark = estimator(name).landmark
        windows = windows_text(landmark, setting.window, setting.features)
        solid = "upper bound" if setting.is_bound else "set"
        return replace(
            self, title=_title(setting), why=why_innovations_differ(setting, landmark), windows=windows, solid=solid
        )

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
        """What stands under the heading: the tracker, or what the lines are where their ends have names."""
        return f"{self.subject}." if len(self.curves) < 2 else f"Solid: {self.solid}; dashed: innovations."


def answer_plot(
    models: Mapping[str, NoiseModel], name: str, settings: Sequence[NoiseToSet], leader: str | None = None
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
    leader
        Tracker that the title is about; by default the one that innovations mislead most.
    """
    shown = [setting for setting in settings if setting.tracker in models]
    if len(shown) > MOST_TRACKERS:
        shown = sorted(shown, key=lambda one: (one.tracker != leader, one.sigma.value or 0.0))[:MOST_TRACKERS]
    curves = {setting.tracker: _curve(setting, models[setting.tracker], name) for setting in shown}
    with_windows = [setting for setting in shown if curves[setting.tracker].windows]
    able = [setting for setting in with_windows if setting.sigma.value and setting.innovations.value]
    if not able:
        return None
    ratios = [((one.sigma.value or 0.0) / (one.innovations.value or 1.0), one.tracker == leader) for one in able]
    first = able[max(range(len(able)), key=lambda place: ratios[place][::-1])]
    chosen = [first, *(setting for setting in able if setting is not first)]
    return AnswerPlot("", "", tuple(_alike_long([curves[one.tracker] for one in chosen]))).titled(first, name)


def _title(setting: NoiseToSet) -> str:
    sigma, innovations = setting.sigma.value or 0.0, setting.innovations.value or 0.0
    if setting.is_bound:
        return f"Your innovations suggest {px(innovations)}. Sigma is at most {px(sigma)}."
    if _alike(sigma, innovations):
        return f"Your innovations are right: set {px(sigma)}."
    return f"Your innovations suggest {px(innovations)}. Set {px(sigma)}."


def why_innovations_differ(setting: NoiseToSet, landmark: Landmark) -> str:
    """Why innovations are smaller than what to set, a sentence; empty where they are not, or nothing is known."""
    sigma, innovations = setting.sigma.value or 0.0, setting.innovations.value or 0.0
    if sigma < _ALIKE * innovations:
        return ""
    if setting.is_bound:
        return "Innovations do not show errors that look like another depth."
    if landmark in (Landmark.EXACT, Landmark.KNOWN):
        return "Its points are not fitted to the track: the whole error since the first position counts."
    return "Errors that add up along a track look like another depth: a filter tuned to innovations is overconfident."


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
    """What to set with such windows and the features of a setting, and what innovations suggest; None if unknown."""
    try:
        advice = estimator(name).advise(model, window=window, features=setting.features)
        return advice.sigma.value, innovations_of(model, advice).value
    except SettingsError:
        return None


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
    ends = [
        (y(value), name, curve.colour)
        for curve in shown.curves
        for name, value in _ends(curve, shown.curves, shown.solid)
    ]
    dots = [_dots(window, shown, x, y) for window in windows]
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
    """Solid: what to set; dashed: what innovations suggest."""
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


def _ends(curve: Curve, curves: Sequence[Curve], solid: str) -> Iterator[tuple[str, float]]:
    """What the ends of its lines are called: of several trackers their names, of one what the lines are."""
    to_set, innovations = curve.to_set[-1], curve.innovations[-1]
    if len(curves) > 1:
        yield shortened(printable(curve.tracker), _LONGEST_NAME), to_set
    elif _alike(to_set, innovations):
        yield "both alike", to_set
    else:
        yield from ((solid, to_set), ("innovations", innovations))


def _dots(window: int, shown: AnswerPlot, x: Any, y: Any) -> Markup:
    """A dot on each curve that has such windows; seen in the windows of the estimator."""
    dot = Markup('<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="{colour}"/>')
    values = [(curve, curve.at(window)) for curve in shown.curves]
    dots = [dot.format(x=x(window), y=y(value), colour=curve.colour) for curve, value in values if value is not None]
    hidden = "" if window == shown.curves[0].window else Markup(' display="none"')
    return Markup('<g class="dots" data-window="{window}"{hidden}>{dots}</g>').format(
        window=window, hidden=hidden, dots=Markup("").join(dots)
    )


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


def shortened(text: str, most: int) -> str:
    """A text of at most so many characters; an ellipsis stands for what is cut off."""
    return text if len(text) <= most else f"{text[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
