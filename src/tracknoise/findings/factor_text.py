"""Factor effects as text: ``13 times (9.0 to 19)``, and sentences that name the levels and which one is better."""

from collections.abc import Mapping
from typing import Any

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.wording import SPACE, STATISTICS, place, ratio, times

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
    bounds = "" if row["low"] is None else f" ({ratio(row['low'])} to {ratio(row['high'])})"
    return f"{times(row['effect'])}{bounds}"


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
    name = factor_name(factor)
    whose = f"the {subject(row, role)}{_where(row)}"
    if row["larger"] is None:
        return f"{whose} is the same {' and '.join(level_text(factor, level) for level in pair)}"
    if row["unit"] == "px":
        between = " and ".join(f"{name}{SPACE}{level}" for level in pair)
        return f"{whose} differs by {size_text(row)} between {between}"
    smaller = pair[1 - pair.index(row["larger"])]
    as_large = f"as {_ADJECTIVES.get(role, 'large')} {level_text(factor, row['larger'])}"
    better = row["better"] if factor == "tracker" else f"{name}{SPACE}{row['better']}"
    known = f"; {better} is better" if row["low"] is not None and row["low"] > 1 else ""
    return f"{whose} is {size_text(row)} {as_large} as {level_text(factor, smaller)}{known}"


def bounded_text(row: Mapping[str, Any], role: str) -> str:
    """Write how large the difference of any two levels is at most: ``core of lk by speed, at most 1.04 times``."""
    return f"{subject(row, role)} by {factor_name(row['factor'])}, at most {bound_text(row['most'], row['unit'])}"


def level_text(factor: str, level: str) -> str:
    """Write a level of a factor: ``at speed 4``, or of an option of a tracker: ``with detector fast``."""
    return _LEVELS.get(factor, f"with {factor_name(factor)} {{}}").format(level)


def factor_name(factor: str) -> str:
    """Write a factor: of an option of nested settings, such as ``detection.detector``, the last part."""
    return factor.rpartition(".")[2]


def subject(row: Mapping[str, Any], role: str) -> str:
    """Write the statistic and its tracker: ``outlier ratio of lucas-kanade``."""
    return f"{STATISTICS[role]}{' of ' + row['tracker'] if row['tracker'] else ''}"


def _where(row: Mapping[str, Any]) -> str:
    return "" if row["at"] is None else f" in {row['coordinate']} {place(row['axis'], row['at'])}"
