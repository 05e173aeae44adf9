"""Whether each track has a scale of its own, and whether noise depends on reported quality, by whole tracks.

The likelihood is that of all errors of a track together (`tracknoise.estimators.track_likelihood`). Parts are added one
at a time: a scale of each track, then the covariate that makes all tracks most likely, then a second one. Each is kept
if it gains more than 0.05 nat per track on what was left out, scenes or groups of them, and the interval of the gain
does not reach 0. What remains is compared in the same way with the components that second moments give
(`tracknoise.estimators.components`).

Intervals are those of the jackknife, where leaving out unit i changes the values by one step of Newton,

    theta_i = theta + (J - J_i)^-1 (s - s_i)                                                    (track_scale.jackknife)

with sums s of the first derivatives, and J of minus the second ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import fit_noise, group_numbers, independent_noun, sums_of_units
from tracknoise.estimators.exports import invertible
from tracknoise.estimators.model import NO_COMPONENT, Component, Factor, Interval, TrackScale, factor_of
from tracknoise.estimators.run_time_conditions import TRENDS, Trend, mean_gain
from tracknoise.estimators.track_likelihood import (
    BULK,
    LEAST_NU,
    LEAST_PX,
    MOST_NU,
    MOST_PX,
    STEEPEST,
    TrackErrors,
    TrackLaw,
    fit_law,
    with_scales,
)
from tracknoise.exceptions import SettingsError
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.units import Resampled, SceneGroups, Units
from tracknoise.statistics.noise_sums import MOTION
from tracknoise.tables.schema import QUALITY_PREFIX, SEQUENCE

Array = NDArray[np.float64]

_LEAST_TRACKS, _MOST_TRACKS = 50, 4000
"""Tracks that are fitted."""
_FOLDS = 10
_MOST_FACTORS = 2
_LEAST_GAIN = 0.05
"""Nat per track."""
_RANGE = (0.01, 0.99)
"""Shares of the observations within which factors change."""
_NEGLIGIBLE = 1e-3
"""A component with a variance below this share of the largest one is 0."""
_AT_LIMIT = 1e-6
"""Logarithms this close to that of a limit are at it."""
_POWERS = {Trend.RISING: (0.0, STEEPEST), Trend.FALLING: (-STEEPEST, 0.0), Trend.ANY: (-STEEPEST, STEEPEST)}


@dataclass(frozen=True, slots=True)
class Covariate:
    """What a front end knows of an observation: natural logarithms between which factors change, and their median."""

    of: str
    low: float
    centre: float
    high: float

    @classmethod
    def of_values(cls, name: str, values: Array) -> "Covariate | None":
        """From values (n,), NaN where unknown; None where too few are known, or all are alike."""
        known = values[values > 0.0]
        if 2 * len(known) < len(values):
            return None
        low, centre, high = np.quantile(np.log(known), [_RANGE[0], 0.5, _RANGE[1]]).tolist()
        return cls(name, low, centre, high) if low < high else None

    @property
    def bounds(self) -> tuple[float, float]:
        """Of its power."""
        return _POWERS[TRENDS.get(self.of, Trend.ANY)]

    def about_median(self, values: Array) -> Array:
        """Logarithms of values about their median, within the range; 0 where NaN."""
        known = np.where(np.isnan(values), np.exp(self.centre), np.maximum(values, np.exp(self.low)))
        return np.asarray(np.clip(np.log(known), self.low, self.high) - self.centre)

    def factor(self, power: float, gain: Interval) -> Factor:
        """The factor by this covariate, with what it gains."""
        ends = (self.low, self.high)
        return Factor(
            of=self.of, log_knots=ends, log_factor=tuple(power * (end - self.centre) for end in ends), gain=gain
        )


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Tracks that a law is chosen by."""

    tracks: TrackErrors  # with all covariates
    covariates: tuple[Covariate, ...]  # in the same order
    unit: NDArray[np.intp]  # (tracks,): number of what each track is left out with, from 0
    noun: str  # what these are, in the plural

    def fitted(self, start: TrackLaw, places: Sequence[int]) -> TrackLaw:
        """The law of the form of `start` with some of the covariates, of all tracks."""
        bounds = [self.covariates[place].bounds for place in places]
        return fit_law(self.tracks.with_covariates(places), start, powers=bounds)

    def held_out(self, law: TrackLaw, places: Sequence[int]) -> Array:
        """Log likelihoods (tracks,) of tracks under the law of the same form that is fitted to all other units.

        NaN where there is a single unit.
        """
        tracks, bounds = self.tracks.with_covariates(places), [self.covariates[place].bounds for place in places]
        found, fold = np.full(len(self.unit), np.nan), self.fold
        for one in np.unique(fold) if fold.any() else ():
            left = fold == one
            others = fit_law(tracks.chosen(~left), law, powers=bounds)
            found[left] = others.log_likelihoods(tracks.chosen(left))
        return found

    @property
    def fold(self) -> NDArray[np.intp]:
        """(tracks,): what is left out at once."""
        return np.asarray(self.unit % min(_FOLDS, int(self.unit.max(initial=0)) + 1))

    def gain(self, those: Array, others: Array, level: float) -> Interval:
        """Mean of the differences of log likelihoods (tracks,), with its interval over units."""
        counts = np.bincount(self.unit).astype(np.float64)
        gain = np.bincount(self.unit, weights=those - others).astype(np.float64)
        return mean_gain(gain, counts, level)


def is_gain(gain: Interval) -> bool:
    """Whether a gain is worth a part, and its interval does not reach 0."""
    return gain.value > _LEAST_GAIN and gain.low is not None and gain.low > 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ChosenLaw:
    """The form of a law that describes best what was left out."""

    law: TrackLaw  # fitted to all tracks
    places: tuple[int, ...]  # of its covariates
    gains: tuple[Interval, ...]  # of each of these over the law before
    held_out: Array  # (tracks,): log likelihoods of tracks that were left out
    without_factors: TrackLaw  # the law before covariates were added
    scale_gain: Interval | None = None  # of a scale for each track; None where it was not tried


def choose_law(sample: Sample, *, level: float, scales: bool = True) -> ChosenLaw:
    """Add parts one at a time, while what was left out is described better; `scales`: whether one of each track is."""
    gaussian = sample.fitted(TrackLaw(), ())
    chosen = ChosenLaw(gaussian, (), (), sample.held_out(gaussian, ()), gaussian)
    if scales:
        student = sample.fitted(with_scales(gaussian), ())
        held_out = sample.held_out(student, ())
        gain = sample.gain(held_out, chosen.held_out, level)
        scaled = ChosenLaw(student, (), (), held_out, student, gain)
        chosen = scaled if is_gain(gain) else replace(chosen, scale_gain=gain)
    while len(chosen.places) < min(_MOST_FACTORS, len(sample.covariates)):
        more = _with_one_more(sample, chosen, level)
        if not is_gain(more.gains[-1]):
            break
        chosen = more
    return chosen


def _with_one_more(sample: Sample, before: ChosenLaw, level: float) -> ChosenLaw:
    """With the covariate that makes all tracks most likely: the choice looks at nothing that was left out."""
    start = replace(before.law, powers=(*before.law.powers, 0.0))
    each = [(*before.places, place) for place in range(len(sample.covariates)) if place not in before.places]
    laws = [sample.fitted(start, places) for places in each]
    likely = [
        law.log_likelihoods(sample.tracks.with_covariates(places)).sum() for law, places in zip(laws, each, strict=True)
    ]
    best = int(np.argmax(likely))
    law, places = laws[best], each[best]
    held_out = sample.held_out(law, places)
    gain = sample.gain(held_out, before.held_out, level)
    return replace(before, law=law, places=places, gains=(*before.gains, gain), held_out=held_out)


def fit_track_scale(
    errors: pl.DataFrame, sums: pl.DataFrame, conditions: Sequence[Factor], *, groups: SceneGroups, level: float
) -> TrackScale | None:
    """Noise with a scale of its own for each track; None where too few tracks are known, or they have no errors.

    `errors`: schema `TRACK_ERRORS`, of one tracker and speed. `sums`: schema `NOISE_SUMS`, of the same. `conditions`:
    factors on the components that second moments give.
    """
    rows = thinned(errors)
    first = rows.filter(age=0)
    if first.height < _LEAST_TRACKS or not rows.select("du_px", "dv_px").to_numpy().any():
        return None
    sample = sample_of_tracks(rows, groups)
    chosen = choose_law(sample, level=level)
    today = _of_second_moments(sample, rows, sums, conditions, groups, level)
    gain = sample.gain(chosen.held_out, today, level)
    intervals = law_intervals(sample, chosen.law, chosen.places, first, groups=groups, level=level)
    scale = chosen.scale_gain
    return TrackScale(
        nu=intervals["nu"] if chosen.law.has_scales else None,
        why_one_scale=None if chosen.law.has_scales else _not_better("a scale of each track", scale, sample.noun),
        **{name: _component(intervals.get(name)) for name in BULK},
        conditions=tuple(
            sample.covariates[place].factor(power, gained)
            for place, power, gained in zip(chosen.places, chosen.law.powers, chosen.gains, strict=True)
        ),
        gain=None if np.isnan(gain.value) else gain,
        why_refused=None if is_gain(gain) else _not_better("it instead of second moments", gain, sample.noun),
    )


def _not_better(part: str, gain: Interval | None, noun: str) -> str:
    if gain is None or gain.low is None:
        return f"too few {noun} can be left out to tell what is gained by {part}"
    shown = f"{gain.value:+.2g} nat per track, interval from {gain.low:+.2g}"
    return f"{noun} that were left out are not described better with {part} ({shown})"


def _component(sigma: Interval | None) -> Component:
    if sigma is None:
        why = "its variance is below a thousandth of the largest one"
        return replace(NO_COMPONENT, why_dropped=why)
    return Component(covariance=sigma.value**2 * np.eye(2), sigma=sigma)


_TRACK = [*SEQUENCE, "track"]


def thinned(errors: pl.DataFrame) -> pl.DataFrame:
    """Rows of at most `_MOST_TRACKS` tracks, in order."""
    ordered = errors.sort(*_TRACK, "age")
    count = ordered.filter(age=0).height
    every = max(1, -(-count // _MOST_TRACKS))
    return ordered.filter((pl.struct(_TRACK).rank("dense") - 1) % every == 0)


def _units(first: pl.DataFrame, groups: SceneGroups) -> Units:
    """What is resampled: tracks by scene, or by block; `first`: one row for each track."""
    counted = first.group_by("dataset", "scene", "block").agg(n=pl.len().cast(pl.Float64))
    return units_of(counted.drop("block"), counted, points=[], columns=["n"], groups=groups)


def _labels(table: pl.DataFrame, units: Units) -> pl.Series:
    """What each row is left out with: its scene, or its block of a scene."""
    name = pl.format("{} {}", "scene", "block") if units.resampled == Resampled.blocks else pl.col("scene")
    return table.select(label=name).to_series()


def sample_of_tracks(rows: pl.DataFrame, groups: SceneGroups) -> Sample:
    """From rows of the schema `TRACK_ERRORS` that are `thinned`. Scenes are left out, or blocks where they are few."""
    first = rows.filter(age=0)
    units = _units(first, groups)
    labels = _labels(first, units)
    if units.resampled == Resampled.blocks:
        unit = labels.rank("dense").to_numpy().astype(np.intp) - 1
    else:
        unit = group_numbers(first, groups)
    track = rows.select(pl.struct(_TRACK).rank("dense")).to_series().to_numpy().astype(np.intp) - 1
    qualities = [name for name in rows.columns if name.startswith(QUALITY_PREFIX)]
    values = {name.removeprefix(QUALITY_PREFIX): _floats(rows[name]) for name in (MOTION, *qualities)}
    return sample_of(
        track,
        error=rows.select("du_px", "dv_px").to_numpy().astype(np.float64),
        magnification=_floats(rows["magnification"]),
        age=_floats(rows["age"]),
        born=np.ones(len(labels), dtype=bool),
        values=values,
        unit=unit,
        noun=independent_noun(units),
    )


def sample_of(
    track: NDArray[np.intp],
    *,
    error: Array,
    magnification: Array,
    age: Array,
    born: NDArray[np.bool_],
    values: Mapping[str, Array],
    unit: NDArray[np.intp],
    noun: str,
) -> Sample:
    """From observations (rows, ...) in the order of tracks, numbered from 0, and age.

    `values`: of each covariate (rows,), NaN where unknown. `born`, `unit`: (tracks,).
    """
    later = age > 0.0
    covariates = [one for name, x in values.items() if (one := Covariate.of_values(name, x[later])) is not None]
    logs = [one.about_median(values[one.of]) for one in covariates]
    table = np.stack(logs, axis=1) if logs else np.zeros((len(track), 0))
    return Sample(TrackErrors.of_rows(track, error, magnification, age, born, table), tuple(covariates), unit, noun)


def _floats(column: pl.Series) -> Array:
    """NaN where null."""
    return column.cast(pl.Float64).to_numpy()


def _of_second_moments(
    sample: Sample,
    rows: pl.DataFrame,
    sums: pl.DataFrame,
    conditions: Sequence[Factor],
    groups: SceneGroups,
    level: float,
) -> Array:
    """Log likelihoods (tracks,) of tracks that were left out, under components fitted to the sums of all others.

    The factors of `conditions` are those of all scenes, which favours these components. No observation is exact, as in
    exports.
    """
    first = rows.filter(age=0)
    units = _units(first, groups)
    labels, own = _labels(first, units), _labels(sums, units)
    found, fold = np.zeros(len(sample.unit)), sample.fold
    at = {one.of: _floats(rows[one.of if one.of == MOTION else QUALITY_PREFIX + one.of]) for one in conditions}
    factor = _by_track(sample.tracks, factor_of(conditions, at, rows.height))
    for one in np.unique(fold):
        left = fold == one
        rest = sums.filter(~own.is_in(labels.filter(pl.Series(left)).unique().implode()))
        try:
            noise = fit_noise(sums_of_units(rest, groups), level=level)
        except SettingsError:  # too few errors
            return np.full(len(sample.unit), np.nan)
        used = replace(noise, white=invertible(noise.white))
        found[left] = sample.tracks.chosen(left).gaussian(used, factor[left])
    return found


def _by_track(tracks: TrackErrors, values: Array) -> Array:
    """Values of rows, (tracks, 1 + n); 1 where there is no observation."""
    known = np.pad(tracks.known, ((0, 0), (1, 0)), constant_values=True)
    table = np.ones(known.shape)
    table[known] = values
    return table


def law_intervals(
    sample: Sample, law: TrackLaw, places: Sequence[int], first: pl.DataFrame, *, groups: SceneGroups, level: float
) -> dict[str, Interval]:
    """Standard deviations of the components that are not negligible, and nu, with their intervals, by name.

    `law`: fitted to the sample with the covariates `places`. `first`: columns dataset, scene and block of its tracks.
    """
    names = [*BULK, *(["nu"] if law.has_scales else [])]
    variances = np.square([law.first, law.white, law.walk])
    negligible = variances < _NEGLIGIBLE * variances.max()
    active = np.array([place for place in range(len(law.values)) if place >= len(BULK) or not negligible[place]])
    cells = first.select("dataset", "scene", "block", cell=pl.struct("dataset", "scene", "block").rank("dense") - 1)
    each = cells.unique("cell").sort("cell")
    cell = cells["cell"].to_numpy().astype(np.intp)
    slopes, second = law.information(sample.tracks.with_covariates(places), cell, each.height)
    size = len(active)
    columns = np.hstack(
        [
            np.bincount(cell, minlength=each.height)[:, None],
            slopes[:, active],
            second[:, active[:, None], active].reshape(-1, size**2),
        ]
    )
    labels = [f"column_{place}" for place in range(columns.shape[1])]
    table = each.drop("cell").hstack(pl.DataFrame(columns, schema=labels))
    units = units_of(table.drop("block"), table, points=[], columns=labels, groups=groups)

    def statistics(sums: Array) -> Array:
        """(track_scale.jackknife), (values, 1, ...) from sums (columns, 1, ...)."""
        own = np.moveaxis(sums[:, 0], 0, -1)
        inverse = np.linalg.pinv(own[..., 1 + size :].reshape(*own.shape[:-1], size, size), hermitian=True)
        moved = np.einsum("...ij,...j->...i", inverse, own[..., 1 : 1 + size])
        return np.asarray(np.moveaxis(law.values[active] + moved, -1, 0)[:, None])

    found = pooled(units, np.zeros((0, len(units.sums))), statistics, Method(IntervalKind.student, level))
    bounds = zip(active.tolist(), found.low[:, 0].tolist(), found.high[:, 0].tolist(), strict=True)
    limits = [(LEAST_PX, MOST_PX)] * len(BULK) + [(LEAST_NU, MOST_NU)]
    return {
        names[place]: _exponential(float(law.values[place]), *ends, *limits[place])
        for place, *ends in bounds
        if place < len(names)
    }


def _exponential(value: float, low: float, high: float, least: float, most: float) -> Interval:
    """The exponential of an estimate, with bounds that contain it and are within limits.

    Bounds are None where they are NaN, or the estimate is a limit: its error is then unknown.
    """
    if not np.log(least) + _AT_LIMIT < value < np.log(most) - _AT_LIMIT:
        return Interval(value=float(np.exp(value)))
    beyond = np.log(most) + 1.0  # of a larger end the exponential may be infinite
    ends = [None if np.isnan(end) else float(np.exp(min(end, beyond))) for end in (min(low, value), max(high, value))]
    lower, upper = (None if end is None else min(max(end, least), most) for end in ends)
    return Interval(value=float(np.exp(value)), low=lower, high=upper)
