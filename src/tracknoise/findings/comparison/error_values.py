"""Errors of two runs, paired by scene: core, second moment, bias, tails and growth of one condition."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.comparison.paired_values import NO_PLACES, PairedValues, paired
from tracknoise.findings.factors.scene_counts import LEAST_OUTLIERS
from tracknoise.findings.factors.scene_values import LEAST_FEATURES, SIGNED, AllValues, SceneValues
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.statistics.conditions import Condition, TablesByCondition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.enumerations import Axis

_LEAST_AGES = 3
"""Fewest ages of a scene through which a line is fitted."""
_Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RunErrors:
    """Errors of one run.

    Attributes
    ----------
    values
        What single scenes measured. Both runs have the same scenes in the same order.
    scales
        `SCALES` of the same errors, by condition.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    """

    values: AllValues
    scales: TablesByCondition
    key_frames: Mapping[str, int]


def error_values(
    runs: tuple[RunErrors, RunErrors], keys: tuple[Condition, Condition], scenes: Sequence[str]
) -> Iterator[tuple[str, Axis, PairedValues]]:
    """Statistics of errors of one condition.

    Parameters
    ----------
    runs
        First and second run.
    keys
        The condition in each of them; they may differ in the tracker.
    scenes
        Names of all scenes of the dataset, in the order of the arrays.

    Yields
    ------
    str, Axis, PairedValues
        Name of the statistic, what its places are, and its values.
    """
    for axis in Axis:
        first, second = (run.values.conditions.get((key, axis)) for run, key in zip(runs, keys, strict=True))
        if first is None or second is None:
            continue
        known, other = (run.values.places.get((str(keys[0][0]), axis), NO_PLACES) for run in runs)
        places, of_first, of_second = np.intersect1d(known, other, assume_unique=True, return_indices=True)
        found = _at(first, of_first), _at(second, of_second)
        measured = np.stack([first.measured, second.measured], axis=1)
        yield from ((name, axis, values) for name, values in _of_curves(found, measured, places, axis))
        yield "tails", axis, _tails(runs, keys, axis, places, scenes, measured)


def _at(values: SceneValues, places: NDArray[np.intp]) -> dict[str, _Values]:
    """Values at some places, (scenes, points), by role."""
    return {role: array[:, places].reshape(len(array), -1) for role, array in values.values.items()}


def _of_curves(
    found: tuple[dict[str, _Values], dict[str, _Values]],
    measured: NDArray[np.bool_],
    places: NDArray[np.int64],
    axis: Axis,
) -> Iterator[tuple[str, PairedValues]]:
    """Statistics that have a value at every place, and the growth with age."""
    missing = np.full((len(measured), 2 * len(places)), np.nan)

    def levels(role: str) -> tuple[_Values, _Values]:
        return found[0].get(role, missing), found[1].get(role, missing)

    yield "core", paired(levels("core"), measured, places, n_coordinates=2)
    second = paired(levels("second"), measured, places, n_coordinates=2)
    yield "second_moment", second
    signed = paired(levels(SIGNED), measured, places, n_coordinates=2, logarithms=False)
    scale_px = _scale_px(levels("core"), 1) or _scale_px(levels("second"), 2)
    yield "bias", replace(signed, total=np.add(*levels(SIGNED)), scale_px=scale_px)
    if axis == Axis.age:
        yield "growth", _growth(second)


def _scale_px(levels: tuple[_Values, _Values], power: int) -> float | None:
    """Geometric mean over runs, scenes and places, of logarithms of a power of a length; None where there is none."""
    logs = np.concatenate([array.ravel() for array in levels])
    finite = logs[np.isfinite(logs)]
    return float(np.exp(finite.mean() / power)) if len(finite) else None


def _growth(second: PairedValues) -> PairedValues:
    """Change of the logarithm of the growth of second moments, by lines through the logarithms of each scene.

    Both runs have values at the same ages, so that the difference of both slopes is the slope of the difference.
    """
    change = second.change.reshape(len(second.change), -1, 2)
    common = (~np.isnan(change)).any(axis=2).sum(axis=0) >= MIN_SCENES
    logs, change = np.log(second.places[common]), change[:, common]
    there = ~np.isnan(change)
    count = np.maximum(there.sum(axis=1), 1)
    centred = np.where(there, logs[:, None] - (there * logs[:, None]).sum(axis=1, keepdims=True) / count[:, None], 0.0)
    spread = (centred**2).sum(axis=1)
    enough = (there.sum(axis=1) >= _LEAST_AGES) & (spread > 0)
    slope = (centred * np.where(there, change, 0.0)).sum(axis=1) / np.where(enough, spread, np.nan)
    span = float(np.ptp(logs)) if len(logs) else np.nan
    return PairedValues(slope * span, second.both, np.zeros(2, dtype=np.bool_), NO_PLACES, 2)


def _tails(
    runs: tuple[RunErrors, RunErrors],
    keys: tuple[Condition, Condition],
    axis: Axis,
    places: NDArray[np.int64],
    scenes: Sequence[str],
    measured: NDArray[np.bool_],
) -> PairedValues:
    """Change of the logarithm of the share of errors beyond three cores, at ages where both runs have a core."""
    first, second = (_counts(run, key, axis, places) for run, key in zip(runs, keys, strict=True))
    both = first.join(second, on=["scene", "at"], suffix="_second").group_by("scene").agg(pl.exclude("at").sum())
    place = both["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.intp)
    counts = np.zeros((2, 3, len(scenes)))
    for side, suffix in enumerate(("", "_second")):
        for column, name in enumerate(("n", "beyond_u", "beyond_v")):
            counts[side, column, place] = both[f"{name}{suffix}"].to_numpy()
    n, beyond = counts[:, :1], counts[:, 1:]
    share = beyond.sum(axis=0) / np.maximum(n.sum(axis=0), 1.0)
    enough = share * n.min(axis=0) >= LEAST_OUTLIERS
    logs = np.where(enough, np.log((beyond + 0.5) / (n + 1.0)), np.nan)
    return paired((logs[0].T, logs[1].T), measured, n_coordinates=2)


def _counts(run: RunErrors, key: Condition, axis: Axis, places: NDArray[np.int64]) -> pl.DataFrame:
    """Columns scene, at, n, beyond_u and beyond_v of the rows that have a core."""
    table = run.scales[key].filter(pl.col("n") >= LEAST_FEATURES["core"], axis=axis)
    zero = run.key_frames.get(str(key[POOLED.index("direction")]), 0) if axis == Axis.frame else 0
    rows = table.select_seq("scene", pl.col("at").cast(pl.Int64) - zero, "n", "beyond_u", "beyond_v").drop_nulls()
    return rows.filter(pl.col("at").is_in(places.tolist()))
