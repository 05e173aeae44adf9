"""Words and numbers in text, the same in findings and in the report."""

import math
from collections.abc import Iterable, Mapping, Sequence

import polars as pl

from tracknoise.printable import plural
from tracknoise.tables.enumerations import Axis, Resampled, Shape

SELF_REFERENTIAL = (
    "The true positions are fitted to the tracks themselves: what a 3-D point can absorb, such as drift along the "
    "epipolar line, is not in these errors."
)
"""What holds for errors of triangulated truth, wherever they are shown."""
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
    Shape.contaminated: "contaminated (as if some came from a wider Gaussian)",
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

_RESAMPLED: Mapping[str, str] = {
    Resampled.scenes: "over {}",
    Resampled.groups: "over groups of {}",
    Resampled.within: "over {} within their groups",
    Resampled.blocks: "from blocks of tracks resampled within {}",
}


def number(value: float | None, *, digits: int = 3) -> str:
    """Write a number to `digits` significant digits; whole numbers whole, a dash where it is missing."""
    if value is None:
        return DASH
    if isinstance(value, int) or abs(value) >= 10**digits:
        return f"{round(value):,}".replace("-", MINUS)
    if value != 0 and abs(value) < 1e-3:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}{SPACE}{TIMES}{SPACE}10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", MINUS)
    if value == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}".replace("-", MINUS)


def pixels(value: float | None) -> str:
    """Write a length in px without its unit: to a thousandth where it is short, otherwise to three digits."""
    if value is None or value == 0 or abs(value) < 5e-4 or abs(value) >= 10:
        return number(value)
    return f"{value:.3f}".replace("-", MINUS)


def px(value: float | None) -> str:
    """Write a length in px."""
    return "unknown" if value is None else f"{pixels(value)}{SPACE}px"


def percent(share: float | None) -> str:
    """Write a share in percent, to a tenth."""
    return "unknown" if share is None else f"{100 * share:z.1f}{SPACE}%".replace("-", MINUS)


def effect_text(effect: float | None) -> str:
    """Write an effect in percent, to a tenth near the margin; empty where there is none."""
    if effect is None:
        return ""
    if effect >= 10:
        return f">{SPACE}1000{SPACE}%"
    return percent(effect) if effect < 0.2 else f"{100 * effect:.0f}{SPACE}%"


def ratio(value: float) -> str:
    """Write a ratio: to two digits, or three where it is near one."""
    return number(value, digits=2 if value >= 2 else 3)


def times(value: float) -> str:
    """Write how many times as large something is: ``13 times``."""
    return f"{ratio(value)}{SPACE}times"


def chance(p: float) -> str:
    """Write a p-value: to two digits, and none below a ten thousandth."""
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def count(n: int, noun: str) -> str:
    """Write a count with its noun: ``no tracks``, ``1 track``, ``1,200 tracks``."""
    return f"{number(n) if n else 'no'} {plural(n, noun)}"


def scenes_counted(column: str) -> pl.Expr:
    """A column of counts of scenes in words: ``1 scene``, ``4 scenes``; null where it is."""
    noun = pl.when(pl.col(column) == 1).then(pl.lit("scene")).otherwise(pl.lit("scenes"))
    return pl.format("{} {}", column, noun)


def sentence_case(text: str) -> str:
    """Write the first letter as a capital, and the rest as it is."""
    return f"{text[:1].upper()}{text[1:]}"


def listing(items: Iterable[str], *, joint: str = "and") -> str:
    """Join items as prose does: ``a``, ``a and b``, ``a, b and c``."""
    parts: Sequence[str] = list(items)
    return f" {joint} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


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


def interval_text(level: float, resampled: str, n_scenes: Sequence[int]) -> str:
    """Write how intervals were made: ``95 % intervals over 8 scenes``.

    Parameters
    ----------
    level
        Between 0 and 1.
    resampled
        A value of `tracknoise.tables.enumerations.Resampled`.
    n_scenes
        How many scenes each rests on.
    """
    least, most = min(n_scenes), max(n_scenes)
    scenes = count(most, "scene") if least == most else f"{least} to {count(most, 'scene')}"
    return f"{100 * level:g}{SPACE}% intervals {_RESAMPLED[resampled].format(scenes)}"


def coverage_text(level: float, coverage: float) -> str:
    """Write the coverage of untested intervals: ``a 95 % interval covers about 88 % in data like yours``.

    Parameters
    ----------
    level
        Probability that intervals are made for, between 0 and 1.
    coverage
        Share of intervals that contain the true value: the column of `INTERVALS`.
    """
    return f"a {100 * level:g}{SPACE}% interval covers about {100 * coverage:.0f}{SPACE}% in data like yours"


def spread_text(spread: float, unit: str, *, is_scale: bool) -> str:
    """Write how much scenes differ: ``scenes differ by a factor of 1.9``, or ``scenes differ by 0.120 px``.

    Shares differ by a factor ``in odds``.

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
        factor = f"scenes differ by a factor of {number(math.exp(spread), digits=2)}"
        return f"{factor} in odds" if unit == "share" else factor
    return f"scenes differ by {px(spread) if unit == 'px' else f'{number(spread)}{SPACE}{unit}'}"


def next_scene_text(low: float, high: float, unit: str) -> str:
    """Write where the next scene is expected: ``the next scene: 0.200 to 1.400 px``.

    Parameters
    ----------
    low, high
        Bounds: the columns next_low and next_high of `INTERVALS`.
    unit
        px, share, or another.
    """
    if unit == "share":
        return f"the next scene: {percent(low)} to {percent(high)}"
    write = pixels if unit == "px" else number
    return f"the next scene: {write(low)} to {write(high)}{SPACE}{unit}"
