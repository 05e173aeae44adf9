"""Factor effects as text: ``13 times (9.0 to 19)``, and sentences that name the levels and which one is better."""

import math
from collections.abc import Mapping
from typing import Any

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as, format_estimate
from tracknoise.findings.wording import SPACE, STATISTICS, count, place, ratio, times

_LEVELS = {
    "tracker": "for {}",
    "speed": "at speed {}",
    "lighting": "under lighting {}",
    "rotation": "at rotation {}°",
    "direction": "played {}",
}
_ADJECTIVES = {"lifetime": "long", "outlier_ratio": "high"}


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


def difference_sentence(row: Mapping[str, Any], role: str) -> str:
    """Write which level is larger and by how much, and which one is better if the interval shows it; no full stop.

    Parameters
    ----------
    row
        Of `DEPENDENCE`, with an effect.
    role
        Role of its statistic.
    """
    factor, pair = row["factor"], [row["level_a"], row["level_b"]]
    whose = f"the {subject(row, role)}{_until(row)}{_where(row)}"
    if row["larger"] is None:
        return f"{whose} is the same {' and '.join(level_text(factor, level) for level in pair)}"
    smaller = pair[1 - pair.index(row["larger"])]
    if row["unit"] == "px":
        more = f"{size_text(row)} more positive {level_text(factor, row['larger'])}"
        return f"{whose} is {more} than {level_text(factor, smaller)}"
    as_large = f"as {_ADJECTIVES.get(role, 'large')} {level_text(factor, row['larger'])}"
    better = row["better"] if factor == "tracker" else f"{factor_name(factor)}{SPACE}{row['better']}"
    known = f"; {better} is better" if row["low"] is not None and row["low"] > 1 else ""
    return f"{whose} is {size_text(row)} {as_large} as {level_text(factor, smaller)}{known}"


def bounded_text(row: Mapping[str, Any], role: str) -> str:
    """Write how large the difference of any two levels is at most: ``core of lk by speed, at most 1.04 times``."""
    what = f"{subject(row, role)}{_until(row)} by {factor_name(row['factor'])}"
    return f"{what}, at most {bound_text(row['most'], row['unit'])}"


def level_text(factor: str, level: str) -> str:
    """Write a level of a factor: ``at speed 4``, or of an option of a tracker: ``with detector fast``."""
    return _LEVELS.get(factor, f"with {factor_name(factor)} {{}}").format(level)


def factor_name(factor: str) -> str:
    """Write a factor: of an option of nested settings, such as ``detection.detector``, the last part."""
    return factor.rpartition(".")[2]


def subject(row: Mapping[str, Any], role: str) -> str:
    """Write the statistic and its tracker: ``outlier ratio of lucas-kanade``."""
    return f"{STATISTICS[role]}{' of ' + row['tracker'] if row['tracker'] else ''}"


def _until(row: Mapping[str, Any]) -> str:
    """The horizon of a lifetime."""
    known = row["horizon"] is not None and math.isfinite(row["horizon"])
    return f" up to {count(int(row['horizon']), 'frame')}" if known else ""


def _ratio(value: float | None) -> str:
    return "" if value is None else ratio(value)


def _where(row: Mapping[str, Any]) -> str:
    return "" if row["at"] is None else f" in {row['coordinate']} {place(row['axis'], row['at'])}"
