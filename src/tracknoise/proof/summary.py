"""What a trial says about each noise assumption, with intervals over scenes, and the decision.

Errors are compared window by window with those of one sigma that was tuned for the newest pose: the ratio is the
geometric mean over windows (proof.ratio). An assumption helps if the whole 95 % interval of its ratio is below 0.98. It
makes no difference if the interval lies within 0.98 to 1.02, and it hurts if all of it is above 1.02. Otherwise the
trial does not decide. An assumption is more consistent if |log NEES| of the newest pose is smaller, and the interval of
the change excludes 0.
"""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.units import units_of
from tracknoise.printable import significant
from tracknoise.proof.arms import ARMS, REFERENCE, SCALARS
from tracknoise.proof.trial import NEWEST

_LOW, _HIGH = 0.98, 1.02
_LEVELS = (0.5, 0.9, 0.95, 0.99)
_NEES = ("nees_newest", "nees_position", "nees_rotation", "nees_all", "innovations")
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        "position_ratio": "linear",
        "rotation_ratio": "linear",
        **dict.fromkeys(_NEES, "log"),
        **{f"coverage_{100 * level:.0f}": "logit" for level in _LEVELS},
        "converged": "logit",
        "consistency": "linear",
    }
)
"""Quantities of an arm, and the scales of their intervals. Ratios are logarithms until these are made."""
_RATIOS = ("position_ratio", "rotation_ratio")


class Verdict(StrEnum):
    """What an assumption does to the error of the newest pose."""

    HELPS = "helps"
    NO_DIFFERENCE = "no difference"
    HURTS = "hurts"
    UNDECIDED = "undecided"


def summarise(trial: pl.DataFrame) -> pl.DataFrame:
    """Quantities of every arm with their intervals over scenes.

    Parameters
    ----------
    trial
        As `tracknoise.proof.trial.try_arms` returns it, with the reference arm.

    Returns
    -------
    polars.DataFrame
        One row per arm and quantity of `QUANTITIES`: arm, title, quantity, value, low, high, windows, scenes. Bounds
        are null where there are fewer than 6 scenes.
    """
    table = _sums(trial)
    columns = [name for name in table.columns if name not in ("scene", "arm")]
    units = units_of(table, points=["arm"], columns=columns)
    names = units.points["arm"].to_list()
    found = pooled(units, np.empty((0, len(units.sums))), _quantities, Method(), scales=list(QUANTITIES.values()))
    labels = pl.DataFrame({"quantity": list(QUANTITIES)}).join(pl.DataFrame({"arm": names}), how="cross")
    windows = np.tile(units.sums[..., 0].sum(axis=0), len(QUANTITIES)).astype(np.int64)
    numbers = {"value": found.value, "low": found.low, "high": found.high, "scenes": found.n_scenes}
    flat = {name: np.broadcast_to(values, found.value.shape).ravel() for name, values in numbers.items()}
    titled = labels.with_columns(
        pl.col("arm").replace_strict(_titles()).alias("title"), windows=pl.Series(windows), **flat
    )
    numbers_of = pl.col("value", "low", "high").fill_nan(None)
    is_ratio = pl.col("quantity").is_in(_RATIOS)
    clean = titled.with_columns(pl.when(is_ratio).then(numbers_of.exp()).otherwise(numbers_of))
    return clean.select("arm", "title", "quantity", "value", "low", "high", "windows", "scenes")


def _titles() -> dict[str, str]:
    return {**{arm: title for arm, (title, _) in SCALARS.items()}, **{arm: own.title for arm, own in ARMS.items()}}


def _sums(trial: pl.DataFrame) -> pl.DataFrame:
    """Sums of each scene and arm: windows, then what `_quantities` divides by their number."""
    reference = trial.filter(arm=REFERENCE).select(
        "window", position_1="position_m", rotation_1="rotation_rad", nees_1="nees_newest"
    )
    inside = {
        f"inside_{100 * level:.0f}": pl.col("nees_newest") * NEWEST <= stats.chi2.ppf(level, NEWEST)
        for level in _LEVELS
    }
    paired = trial.join(reference, on="window").with_columns(
        log_position=(pl.col("position_m") / pl.col("position_1")).log(),
        log_rotation=(pl.col("rotation_rad") / pl.col("rotation_1")).log(),
        **inside,
    )
    summed = ("log_position", "log_rotation", *_NEES, *inside, "converged", "nees_1")
    return paired.group_by("scene", "arm").agg(pl.len().alias("n"), *(pl.col(name).sum() for name in summed))


def _quantities(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(quantities, arms, ...) from sums (columns, arms, ...)."""
    n = np.where(sums[0] > 0, sums[0], np.nan)
    means = sums[1:] / n
    reference = np.abs(np.log(means[-1]))
    consistency = np.abs(np.log(means[2])) - reference
    return np.concatenate([means[:-1], consistency[None]])


def verdict(low: float | None, high: float | None) -> Verdict:
    """The decision on a ratio with these bounds."""
    if low is None or high is None:
        return Verdict.UNDECIDED
    if high < _LOW:
        return Verdict.HELPS
    if low > _HIGH:
        return Verdict.HURTS
    return Verdict.NO_DIFFERENCE if low >= _LOW and high <= _HIGH else Verdict.UNDECIDED


def sentence(summary: pl.DataFrame, arm: str) -> str:
    """What one arm does to the newest pose, compared with one tuned sigma."""
    rows = {row["quantity"]: row for row in summary.filter(arm=arm).to_dicts()}
    if not rows:
        return f"Arm {arm} was not tried."
    nees = rows["nees_newest"]
    compared = "; ".join(_compared(name, rows[f"{name}_ratio"]) for name in ("position", "rotation"))
    consistent = f"NEES of the newest pose is {_stated(nees)}; {_consistent(rows)}."
    title = str(nees["title"])
    return f"{title[:1].upper()}{title[1:]}: {compared}. {consistent}"


def _compared(name: str, row: Mapping[str, float | None]) -> str:
    return f"{name} errors are {_stated(row)} times those of one tuned sigma ({_decision(row)})"


def _decision(row: Mapping[str, float | None]) -> Verdict:
    return verdict(row["low"], row["high"])


def _consistent(rows: Mapping[str, Mapping[str, float | None]]) -> str:
    low, high = rows["consistency"]["low"], rows["consistency"]["high"]
    if low is None or high is None or low <= 0.0 <= high:
        return "whether it is more consistent is undecided"
    return "it is more consistent" if high < 0.0 else "it is less consistent"


def _stated(row: Mapping[str, float | None]) -> str:
    numbers = (row[name] for name in ("value", "low", "high"))
    value, low, high = (None if number is None else significant(number, 3) for number in numbers)
    return f"{value or 'unknown'} ({low} to {high})" if low and high else value or "unknown"
