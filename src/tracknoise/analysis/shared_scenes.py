"""What single scenes measured of a tracker, as plain numbers, and the ranks of trackers that were measured apart.

Numbers of a scene are its core and second moment at each age up to `LAST_AGE` (geometric means of both coordinates),
its tracks by lifetime, and its outliers. Two trackers are compared by the same scenes at the same ages, and ranked as
in `tracknoise.analysis.factors`, so that neither has to be measured again when a third one is added.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.factors import RANKED, compared_pairs, ranking
from tracknoise.analysis.scene_values import (
    NUMBERS,
    RunValues,
    lifetime_differences,
    number_differences,
    outlier_differences,
)
from tracknoise.inference.paired_differences import NO_PLACES, Differences, average, half_widths_alone
from tracknoise.inference.survival import follow_up, restricted_mean
from tracknoise.inference.units import scheme
from tracknoise.statistics.grouping import Condition
from tracknoise.tables.enumerations import Axis

LAST_AGE, SHOWN_AGE = 10, 5
"""Ages up to which errors are compared, and the one at which they are shown: that most trackers reach."""
_ERRORS = ("core", "second")
_MOST_DIGITS = 6


@dataclass(frozen=True, slots=True)
class SceneNumbers:
    """What one scene measured of a tracker.

    Attributes
    ----------
    core, second
        At ages 1, 2, ... `LAST_AGE`: core in px, second moment about zero in px^2; null where it is unknown.
    ended, censored
        Tracks that ended, and that were censored, at lifetimes of 1, 2, ... frames.
    offered, outliers
        Features that were offered, and those that were rejected; null where a tracker reports none.
    """

    core: tuple[float | None, ...]
    second: tuple[float | None, ...]
    ended: tuple[int, ...]
    censored: tuple[int, ...]
    offered: int | None
    outliers: int | None


def scene_numbers(values: RunValues, condition: Condition) -> dict[str, SceneNumbers]:
    """Numbers of every scene of a run in one condition, by the name of the scene."""
    scenes = values.scenes[str(condition[0])]
    errors = {role: _by_age(values, condition, role, len(scenes)) for role in _ERRORS}
    counts = {str(row["scene"]): row for row in _counts(values.frames.get(condition)).iter_rows(named=True)}
    ends = values.ends.get(condition)
    numbers = {}
    for place, scene in enumerate(scenes):
        ended, censored = _lifetimes(ends, scene)
        of_frames = counts.get(scene, {})
        numbers[scene] = SceneNumbers(
            core=_known(errors["core"][place]),
            second=_known(errors["second"][place]),
            ended=ended,
            censored=censored,
            offered=of_frames.get("offered"),
            outliers=of_frames.get("outliers"),
        )
    return numbers


def _by_age(values: RunValues, condition: Condition, role: str, n_scenes: int) -> NDArray[np.float64]:
    """(scenes, `LAST_AGE`); NaN where a scene has no value in both coordinates."""
    found = np.full((n_scenes, LAST_AGE), np.nan)
    of_scenes = values.errors.conditions.get((condition, str(Axis.age)))
    if of_scenes is None or role not in of_scenes.values:
        return found
    ages = values.errors.places.get((str(condition[0]), str(Axis.age)), NO_PLACES)
    near = (ages >= 1) & (ages <= LAST_AGE)
    found[:, ages[near] - 1] = np.exp(of_scenes.values[role][:, near].mean(axis=2))
    return found


def _known(values: NDArray[np.float64]) -> tuple[float | None, ...]:
    return tuple(float(f"{value:.{_MOST_DIGITS}g}") if np.isfinite(value) else None for value in values)


def _counts(frames: pl.DataFrame | None) -> pl.DataFrame:
    if frames is None:
        return pl.DataFrame(schema={"scene": pl.String, "offered": pl.Int64, "outliers": pl.Int64})
    names = ("offered", "outliers")
    known = pl.all_horizontal(pl.col(*names).null_count() == 0)
    sums = [pl.when(known).then(pl.col(name).cast(pl.Int64).sum()).alias(name) for name in names]
    return frames.group_by("scene").agg(sums)


def _lifetimes(ends: pl.DataFrame | None, scene: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    rows = None if ends is None else ends.filter(scene=scene)
    if rows is None or rows.is_empty():
        return (), ()
    last = int(rows["lifetime"].to_numpy().max())
    of_each = [
        np.bincount(rows["lifetime"].to_numpy(), weights=rows[name].to_numpy(), minlength=last + 1)[1:]
        for name in ("n_ended", "n_censored")
    ]
    ended, censored = (tuple(int(count) for count in counts) for counts in of_each)
    return ended, censored


@dataclass(frozen=True, slots=True)
class Typical:
    """A geometric mean over scenes with its 95 % interval; the ends are NaN where scenes are too few."""

    value: float
    low: float
    high: float


def typical(trackers: Mapping[str, SceneNumbers], group: NDArray[np.intp], level: float) -> dict[str, Typical]:
    """What a typical scene measured of a tracker, by the roles that trackers are ranked by.

    The core and the RMS are at `SHOWN_AGE`, px; lifetimes are restricted to `LAST_AGE` frames.

    Parameters
    ----------
    trackers
        Numbers by scene, in the order of `group`.
    group : (scenes,)
        Number of the group of each scene.
    level
        Of intervals.
    """
    every = trackers.values()
    core, second = (_at_shown_age([getattr(one, role) for one in every]) for role in _ERRORS)
    values = {
        "core": core,
        "second": np.sqrt(second),
        "lifetime": np.array([_mean_lifetime(one) for one in every]),
        "outlier_ratio": np.array([_outlier_ratio(one) for one in every]),
    }
    return {role: found for role, numbers in values.items() if (found := _typical(numbers, group, level)) is not None}


def _at_shown_age(of_scenes: Sequence[Sequence[float | None]]) -> NDArray[np.float64]:
    found = [ages[SHOWN_AGE - 1] if len(ages) >= SHOWN_AGE else None for ages in of_scenes]
    return np.array([np.nan if value is None else value for value in found])


def _mean_lifetime(scene: SceneNumbers) -> float:
    ended, censored = (np.array(counts, dtype=np.float64) for counts in (scene.ended, scene.censored))
    if not ended.sum() + censored.sum():
        return np.nan
    horizon = min(float(LAST_AGE), float(follow_up(ended, censored)))
    return float(restricted_mean(ended, censored, horizon))


def _outlier_ratio(scene: SceneNumbers) -> float:
    if scene.offered is None or scene.outliers is None:
        return np.nan
    return (scene.outliers + 0.5) / (scene.offered + 1.0)


def _typical(values: NDArray[np.float64], group: NDArray[np.intp], level: float) -> Typical | None:
    known = np.isfinite(values) & (values > 0)
    if not known.any():
        return None
    logs = np.log(np.where(known, values, np.nan))
    resampled = scheme(group[known])
    if resampled is None:
        return Typical(float(np.exp(logs[known].mean())), np.nan, np.nan)
    averages = average(logs[:, None], group, resampled)
    mean, width = float(averages.mean[0]), float(half_widths_alone(averages, 1.0 - level)[0])
    return Typical(*(float(np.exp(mean + step)) for step in (0.0, -width, width)))


def ranks(
    trackers: Mapping[str, Mapping[str, SceneNumbers]], group: NDArray[np.intp], *, margin: float, level: float
) -> dict[tuple[str, str], tuple[int, int]]:
    """Best and worst rank of each tracker, by its name and the role of a statistic.

    Parameters
    ----------
    trackers
        At least two; numbers of every scene, in the order of `group`. A scene that a tracker lacks takes no part.
    group : (scenes,)
        Number of the group of each scene.
    margin, level
        As of `tracknoise.analysis.factors.dependence`.
    """
    scenes = list(next(iter(trackers.values())))

    def differences(role: str, pair: tuple[str, str]) -> Differences:
        both = [trackers[name] for name in pair]
        if role == "lifetime":
            return lifetime_differences([_ends(one) for one in both], scenes)
        if role == "outlier_ratio":
            return outlier_differences([_frames(one) for one in both], scenes)
        return number_differences([_errors(one, role) for one in both], scenes, logarithms=True)

    found = ranking(compared_pairs([*trackers], differences, group, margin=margin, level=level))
    return {
        (row["tracker"], row["statistic"]): (row["best"], row["worst"])
        for row in found.iter_rows(named=True)
        if row["statistic"] in RANKED
    }


def _ends(tracker: Mapping[str, SceneNumbers]) -> pl.DataFrame:
    rows = [
        (scene, lifetime, *counts)
        for scene, one in tracker.items()
        for lifetime, counts in enumerate(zip(one.ended, one.censored, strict=True), 1)
    ]
    kinds = {"scene": pl.String, "lifetime": pl.Int64, "n_ended": pl.Int64, "n_censored": pl.Int64}
    return pl.DataFrame(rows, schema=kinds, orient="row")


def _frames(tracker: Mapping[str, SceneNumbers]) -> pl.DataFrame:
    rows = [(scene, one.offered, one.outliers) for scene, one in tracker.items()]
    return pl.DataFrame(rows, schema={"scene": pl.String, "offered": pl.Int64, "outliers": pl.Int64}, orient="row")


def _errors(tracker: Mapping[str, SceneNumbers], role: str) -> pl.DataFrame:
    rows = [
        (scene, age, value)
        for scene, one in tracker.items()
        for age, value in enumerate(getattr(one, role), 1)
        if value is not None
    ]
    return pl.DataFrame(rows, schema=dict(NUMBERS), orient="row")
