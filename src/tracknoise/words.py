"""Words and numbers in text, the same in findings and in the report: ``0.410 px (0.380 to 0.450)``, ``13 times``."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import Axis, Shape, Trimming
from tracknoise.text import plural

SELF_REFERENTIAL = (
    "The true positions are fitted to the tracks themselves. What a 3-D point can absorb, such as drift along the "
    "epipolar line, is not in these errors."
)
"""What holds for errors of triangulated truth, wherever they are shown."""
DEPTH_FROM_IMAGES = (
    "depth is computed from the images of other frames and of a second camera, if any: hidden points count as "
    "visible, and a feature with little parallax or texture, or at a depth edge, has no true position"
)
"""What holds for truth whose depth is from images."""
SPACE = "\N{NO-BREAK SPACE}"
MINUS, DASH, TIMES = "\N{MINUS SIGN}", "\N{EN DASH}", "\N{MULTIPLICATION SIGN}"
_VIEW = {
    "lighting": "under lighting {}",
    "rotation": "at rotation {}°",
    "direction": "played {}",
    "camera": "of camera {}",
}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

SHAPES: Mapping[str, str] = {
    Shape.gaussian: "close to Gaussian",
    Shape.heavy_tailed: "heavy-tailed",
    Shape.contaminated: "contaminated",
    Shape.light_tailed: "light-tailed",
    Shape.skewed: "skewed",
    Shape.undecided: "of undecided shape",
}
"""What errors of each shape are called."""
STATISTICS: Mapping[str, str] = {
    "mean": "mean error",
    "absolute": "mean absolute error",
    "second": "second moment",
    "core": "core",
    "lifetime": "lifetime",
    "outlier_ratio": "outlier ratio",
}
"""Name of each statistic that a factor may affect, by its role."""

RMS_OF_SCENE = "RMS of a typical scene"
"""Geometric mean over scenes of each scene's own root mean square error."""
_RMS_OF_TRACKS = {Trimming.untrimmed: "RMS over all tracks", Trimming.trimmed: "RMS over the kept tracks"}


_RESAMPLED: Mapping[str, str] = {
    Resampled.scenes: "over {}",
    Resampled.groups: "over groups of {}",
    Resampled.within: "over {}, resampled within their groups",
    Resampled.blocks: "from blocks of tracks resampled within {}",
}


def number(value: float | None, *, digits: int = 3) -> str:
    """Write a number to `digits` significant digits, fewer by one below a thousandth.

    Whole numbers are written whole, and a dash where it is missing.
    """
    if value is None:
        return DASH
    if isinstance(value, int) or value == 0:
        return f"{round(value):,}".replace("-", MINUS)
    shown = digits - 1 if abs(value) < 1e-3 else digits
    rounded = float(f"{value:.{shown - 1}e}")  # first: what rounds up to the next power of ten is written like that
    if abs(rounded) >= 10**digits:
        return f"{round(value):,}".replace("-", MINUS)
    if abs(rounded) < 1e-3:
        mantissa, exponent = f"{rounded:.{shown - 1}e}".split("e")
        return f"{mantissa}{SPACE}{TIMES}{SPACE}10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", MINUS)
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{rounded:.{decimals}f}".replace("-", MINUS)


def pixels(value: float | None) -> str:
    """Write a length in px without its unit: to a thousandth where it is short, otherwise to three digits."""
    if value is None or value == 0 or abs(value) < 5e-4 or abs(round(value, 3)) >= 10:
        return number(value)
    return f"{value:.3f}".replace("-", MINUS)


def px(value: float | None) -> str:
    """Write a length in px."""
    return "unknown" if value is None else f"{pixels(value)}{SPACE}px"


def thousandths(value: float | None) -> str:
    """Write a number, such as a gain in nat, to a thousandth; never as minus zero."""
    return DASH if value is None else f"{value:z.3f}".replace("-", MINUS)


def percent(share: float | None) -> str:
    """Write a share in percent, to a tenth."""
    return "unknown" if share is None else f"{100 * share:z.1f}{SPACE}%".replace("-", MINUS)


def effect_text(effect: float | None) -> str:
    """Write an effect in percent, to a tenth near the margin; empty where there is none."""
    if effect is None:
        return ""
    if round(effect, 2) >= 10:
        return f">{SPACE}1000{SPACE}%"
    return percent(effect) if round(effect, 3) < 0.2 else f"{100 * effect:.0f}{SPACE}%"


_MOST_TIMES = 1000
"""Larger ratios are not written out."""


def ratio(value: float) -> str:
    """Write a ratio: to two digits, or three where it is near one; ``more than 1000`` where it is huge."""
    if value > _MOST_TIMES:
        return f"more than {_MOST_TIMES}"
    return number(value, digits=2 if round(value, 2) >= 2 else 3)


def times(value: float) -> str:
    """Write how many times as large something is: ``13 times``."""
    return f"{ratio(value)}{SPACE}times"


def chance(p: float) -> str:
    """Write a p-value: to two digits, and none below a ten thousandth."""
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def count(n: int, noun: str) -> str:
    """Write a count with its noun: ``no tracks``, ``1 track``, ``1,200 tracks``."""
    return f"{number(n) if n else 'no'} {plural(n, noun)}"


def only(n: int, noun: str) -> str:
    """Write a count that is too small: ``no scenes``, ``only 3 scenes``."""
    return f"only {count(n, noun)}" if n else count(n, noun)


def scenes_counted(column: str) -> pl.Expr:
    """A column of counts of scenes in words: ``1 scene``, ``4 scenes``; null where it is."""
    noun = pl.when(pl.col(column) == 1).then(pl.lit("scene")).otherwise(pl.lit("scenes"))
    return pl.format("{} {}", column, noun)


def these_scenes(n: int) -> str:
    """Write where sentences hold, with few scenes: ``in this scene``, ``in these 3 scenes``."""
    return "in this scene" if n == 1 else f"in these {count(n, 'scene')}"


def sentence_case(text: str) -> str:
    """Write the first letter as a capital, and the rest as it is."""
    return f"{text[:1].upper()}{text[1:]}"


def listing(items: Iterable[str], *, joint: str = "and") -> str:
    """Join items as prose does: ``a``, ``a and b``, ``a, b and c``."""
    parts: Sequence[str] = list(items)
    return f" {joint} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def rms_of_tracks(trimming: str) -> str:
    """What the root mean square error of the features of all scenes together is called: ``RMS over all tracks``.

    Parameters
    ----------
    trimming
        Whether the tracks are those that trimming keeps.
    """
    return _RMS_OF_TRACKS[Trimming(trimming)]


def place(axis: str, since: int) -> str:
    """Write a place on an axis by its distance from where errors are zero.

    ``at age 10``, or ``8 frames after the key frame``.

    Parameters
    ----------
    axis
        age or frame.
    since
        Frames of the sequence; negative before the key frame.
    """
    if axis == Axis.age:
        return f"at age {since}"
    return f"{count(abs(since), 'frame')} {'before' if since < 0 else 'after'} the key frame"


def opening_place(axis: str, since: int) -> str:
    """Write a place as `place` does, as the start of a sentence: ``At 8 frames after the key frame``."""
    return f"At {place(axis, since).removeprefix('at ')}"


def view_text(view: Mapping[str, object], names: Iterable[str]) -> str:
    """Write the lighting, rotation, direction and camera of a view, those in `names` only; starts with a blank."""
    return "".join(f" {_VIEW[name].format(view[name])}" for name in names)


def condition_name(names: Mapping[str, Any]) -> str:
    """Name a condition."""
    return f"{names['tracker']} at speed {names['speed']}{view_text(names, [name for name in _VIEW if name in names])}"


def interval_text(level: float, resampled: str, n_scenes: Sequence[int]) -> str:
    """Write how intervals were made: ``95 % intervals over 8 scenes``.

    Parameters
    ----------
    level
        Between 0 and 1.
    resampled
        A value of `tracknoise.inference.units.Resampled`.
    n_scenes
        How many scenes each rests on.
    """
    least, most = min(n_scenes), max(n_scenes)
    scenes = count(most, "scene") if least == most else f"{least} to {count(most, 'scene')}"
    return f"{intervals_at(level)} {_RESAMPLED[resampled].format(scenes)}"


def intervals_at(level: float) -> str:
    """Name intervals of a level between 0 and 1: ``95 % intervals``."""
    return f"{100 * level:.4g}{SPACE}% intervals"


def coverage_sentence(opening: str, level: float, coverage: float | None) -> str:
    """Write the coverage of untested intervals; empty where it is not known, or not below the level as it is written.

    ``For this number, a 95 % interval can cover as little as 88 % in data like yours.``

    Parameters
    ----------
    opening
        What the sentence begins with.
    level
        Probability that intervals are made for, between 0 and 1.
    coverage
        Share of intervals that contain the true value: the column of `INTERVALS`.
    """
    if coverage is None or round(100 * coverage) >= 100 * level:
        return ""
    covered = f"{100 * coverage:.0f}{SPACE}%"
    return f"{opening} a {100 * level:g}{SPACE}% interval can cover as little as {covered} in data like yours."


def spread_text(spread: float, unit: str, *, is_scale: bool) -> str:
    """Write how much scenes differ: ``varies between scenes by a factor of 1.9``, or ``by 0.120 px``.

    Shares vary by a factor ``in odds``.

    Both are one standard deviation.

    Parameters
    ----------
    spread
        Standard deviation between scenes: the column of `INTERVALS`.
    unit
        Of the number.
    is_scale
        Whether the spread is that of logarithms, or of logits: of scales, lifetimes and shares.
    """
    if is_scale:
        factor = f"varies between scenes by a factor of {number(math.exp(spread), digits=2)}"
        return f"{factor} in odds" if unit == "share" else factor
    return f"varies between scenes by {px(spread) if unit == 'px' else f'{number(spread)}{SPACE}{unit}'}"


def next_scene_text(low: float, high: float, unit: str) -> str:
    """Write where the next scene is expected: ``0.200 to 1.400 px are expected in the next scene``.

    Parameters
    ----------
    low, high
        Bounds: the columns next_low and next_high of `INTERVALS`.
    unit
        px, share, or another.
    """
    if unit == "share":
        return f"{percent(low)} to {percent(high)} are expected in the next scene"
    write = pixels if unit == "px" else number
    return f"{write(low)} to {write(high)}{SPACE}{unit} are expected in the next scene"


_WHOLE = 1e-6
"""A number this near to a whole one, relative to it, is written as such."""
Write: TypeAlias = Callable[[float | None], str]
"""Writes a number without its unit."""


def format_estimate(estimate: Estimate) -> str:
    """Write a value with its unit, and its interval in brackets where there is one."""
    unit = "" if estimate.unit in ("", "share") else f"{SPACE}{_unit(estimate)}"
    return format_as(estimate, _WRITTEN.get(estimate.unit, number), unit=unit)


def bounds_text(estimate: Estimate) -> str:
    """Write the interval of an estimate as `format_estimate` does, without brackets; empty where there is none."""
    return _bounds(estimate, _WRITTEN.get(estimate.unit, number))


def format_as(estimate: Estimate, write: Write, *, unit: str = "") -> str:
    """The same with numbers written in a given way.

    Parameters
    ----------
    estimate
        What to write.
    write
        Writes the value and either bound.
    unit
        What follows the value.
    """
    bounds = _bounds(estimate, write)
    return f"{write(estimate.value)}{unit}{f' ({bounds})' if bounds else ''}"


def _bounds(estimate: Estimate, write: Write) -> str:
    if estimate.low is None and estimate.high is None:
        return ""
    if estimate.low is None:
        return f"up to {write(estimate.high)}"
    if estimate.high is None:
        return f"{write(estimate.low)} or more"
    return f"{write(estimate.low)} to {write(estimate.high)}"


def _unit(estimate: Estimate) -> str:
    return "frame" if estimate.unit == "frames" and estimate.value == 1 else estimate.unit


def _frames(value: float | None) -> str:
    """Frames, which are mostly whole: also where one machine rounds to a whole number and another next to it."""
    if value is None or not math.isclose(value, round(value), rel_tol=_WHOLE):
        return number(value)
    return number(round(value))


def _times(value: float | None) -> str:
    """Growth: to three digits, but for huge ones."""
    return number(value) if value is None or value <= _MOST_TIMES else ratio(value)


_WRITTEN: Mapping[str, Write] = {"share": percent, "px": pixels, "frames": _frames, "times": _times}
"""How numbers of a unit are written; others to three digits."""


_LEVELS = {
    "tracker": "for {}",
    "speed": "at speed {}",
    "lighting": "under lighting {}",
    "rotation": "at rotation {}°",
    "direction": "played {}",
}
_ADJECTIVES = {"lifetime": ("longer", "long"), "outlier_ratio": ("higher", "high")}


def size_text(row: Mapping[str, Any]) -> str:
    """Write the reported difference with its interval: ``13 times (9.0 to 19)``; empty where it is unknown.

    Parameters
    ----------
    row
        Of `DEPENDENCE`.
    """
    if row["effect"] is None:
        return ""
    if row["unit"] == "px":
        return format_estimate(Estimate.of_row(row, "effect", "low", "high", "px"))
    return format_as(Estimate.of_row(row, "effect", "low", "high"), _ratio, unit=f"{SPACE}times")


def bound_text(value: float | None, unit: str) -> str:
    """Write a margin or a bound in the unit of the effect: ``1.10 times``; empty where it is unknown."""
    if value is None:
        return ""
    return times(value) if unit == "ratio" else format_estimate(Estimate(value, unit=unit))


def difference_sentences(row: Mapping[str, Any], role: str) -> list[str]:
    """Write which level is larger and by how much, which one is better if the interval shows it, and where.

    Parameters
    ----------
    row
        Of `DEPENDENCE`, with an effect.
    role
        Role of its statistic.
    """
    factor, pair = row["factor"], [row["level_a"], row["level_b"]]
    whose = f"The {subject(row, role)}"
    places = [*_where(row), *_until(row)]
    if row["larger"] is None:
        return [f"{whose} is the same {' and '.join(level_text(factor, level) for level in pair)}.", *places]
    there = level_text(factor, row["larger"])
    elsewhere = level_text(factor, pair[1 - pair.index(row["larger"])])
    more, large = ("more positive", "") if row["unit"] == "px" else _ADJECTIVES.get(role, ("larger", "large"))
    size = f"{size_text(row)} as {large}" if large else f"{size_text(row)} {more}"
    better = _better(row) if large else ""
    if factor == "tracker" or not any(sign.isdigit() for level in pair for sign in level):
        ending = f"; {better}." if better else "."
        return [f"{whose} is {size} {there} {'as' if large else 'than'} {elsewhere}{ending}", *places]
    told = [f"{whose} is {more} {there} than {elsewhere}.", f"It is {size}."]
    return [*told, *([f"{sentence_case(better)}."] if better else []), *places]


def _better(row: Mapping[str, Any]) -> str:
    """Which level is better, if the interval of a ratio shows it: ``speed 1 is better``; else empty."""
    if row["low"] is None or row["low"] <= 1:
        return ""
    named = "" if row["factor"] == "tracker" else f"{factor_name(row['factor'])}{SPACE}"
    return f"{named}{row['better']} is better"


def bounded_sentences(row: Mapping[str, Any], role: str) -> list[str]:
    """Write how large the difference of any two levels is at most, and the horizon of a lifetime."""
    change = f"changes the {subject(row, role)} by at most {bound_text(row['most'], row['unit'])}"
    return [f"The {factor_name(row['factor'])} {change}.", *_until(row)]


def level_text(factor: str, level: str) -> str:
    """Write a level of a factor: ``at speed 4``, or of an option of a tracker: ``with detector fast``."""
    return _LEVELS.get(factor, f"with {factor_name(factor)} {{}}").format(level)


def factor_name(factor: str) -> str:
    """Write a factor: of an option of nested settings, such as ``detection.detector``, the last part."""
    return factor.rpartition(".")[2]


def subject(row: Mapping[str, Any], role: str) -> str:
    """Write the statistic and its tracker: ``outlier ratio of lucas-kanade``."""
    return f"{STATISTICS[role]}{' of ' + row['tracker'] if row['tracker'] else ''}"


def _until(row: Mapping[str, Any]) -> list[str]:
    """The horizon of a lifetime, as a sentence if there is one."""
    has_horizon = row["horizon"] is not None and math.isfinite(row["horizon"])
    return [f"Lifetimes count up to {count(int(row['horizon']), 'frame')}."] if has_horizon else []


def _ratio(value: float | None) -> str:
    return "" if value is None else ratio(value)


def _where(row: Mapping[str, Any]) -> list[str]:
    """The coordinate and the place of a difference that is known at one alone, as a sentence."""
    return [] if row["at"] is None else [f"This difference is in {row['coordinate']} {place(row['axis'], row['at'])}."]
