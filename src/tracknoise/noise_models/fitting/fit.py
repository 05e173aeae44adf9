"""The fit of a noise model to the scenes of a run."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.noise_models.fitting.bias import fit_bias
from tracknoise.noise_models.fitting.common import fit_common
from tracknoise.noise_models.fitting.components import FittedComponents, fit_components, sums_of_units
from tracknoise.noise_models.fitting.conditions import conditions_of
from tracknoise.noise_models.fitting.equivalents import LENGTHS, equivalents
from tracknoise.noise_models.fitting.gates import gates
from tracknoise.noise_models.fitting.recorded_camera import recorded_camera
from tracknoise.noise_models.fitting.tails import fit_tails
from tracknoise.noise_models.fitting.training_tables import TrainingTables
from tracknoise.noise_models.fitting.training_windows import Recording, windows
from tracknoise.noise_models.model import Equivalent, Training
from tracknoise.statistics.tracks.survival import kaplan_meier
from tracknoise.tables.defaults import LEVEL

_RECORDINGS = 2
"""Sequences whose motions the equivalents are for."""


def fitted_fields(read: TrainingTables, *, level: float = LEVEL) -> dict[str, Any]:
    """Fields of `tracknoise.noise_models.noise_model.NoiseModel`, fitted to a run.

    Parameters
    ----------
    read
        Tables of the tracker at the speed.
    level
        Of the intervals.

    Raises
    ------
    SettingsError
        If there are too few errors.
    StoreError, SchemaError
        If a table of a sequence is missing or damaged.
    """
    sums = read["noise_sums"]
    fitted = components_of(read, level=level)
    last_age = int(sums["age"].max())  # type: ignore[arg-type]
    outliers = read["noise_outliers"]
    return {
        "training": _training(read),
        "camera": recorded_camera({key: read.of_sequence("cameras", key) for key in read.keys}),
        **fitted.components,
        "tails": fit_tails(read["samples"], fitted.noise, last_age=last_age, groups=read.groups),
        "outlier_share": outliers["n_outliers"].to_numpy().sum() / outliers["n"].to_numpy().sum(),
        "outliers_beyond_px": _limit_px(outliers),
        "conditions": conditions_of(
            read["noise_covariates"], read["noise_pairs"], fitted, groups=read.groups, level=level
        ),
        "bias": fit_bias(sums, read["floors"], groups=read.groups, level=level, audit_curves=read.audit_curves),
        "common_share": fit_common(read["rigid"], sums, groups=read.groups, level=level),
        "truth_floor_px": _floor(read["floors"], last_age),
        "equivalents": equivalents_of(read, fitted, LENGTHS),
    }


def components_of(read: TrainingTables, *, level: float) -> FittedComponents:
    """Components of the noise, fitted to the sums of the tables.

    Raises
    ------
    SettingsError
        If there are too few errors.
    """
    return fit_components(sums_of_units(read["noise_sums"], read.groups), level=level)


def equivalents_of(read: TrainingTables, fitted: FittedComponents, lengths: Sequence[int]) -> tuple[Equivalent, ...]:
    """Standard deviations for all observations, for windows of some lengths of the sequences of the tables."""
    lifetimes, recordings = lengths_of_tracks(read["ends"], longest=max(*LENGTHS, *lengths)), _recordings(read)
    noise = fitted.noise.per_frames(read.speed)
    limit_px, found = _limit_px(read["noise_outliers"]), list[Equivalent]()
    for length in lengths:
        some = windows(recordings, speed=read.speed, length=length, lifetimes=lifetimes)
        limits = gates(read["window_noise"], length, limit_px=limit_px, window=some[0], noise=noise)
        found.extend(equivalents(fitted, some, length=length, speed=read.speed, gates=limits))
    return tuple(found)


def _limit_px(outliers: pl.DataFrame) -> float:
    """Beyond what errors are outliers, mean over sequences."""
    return float((outliers["limit_px"] * outliers["n"]).to_numpy().sum() / outliers["n"].to_numpy().sum())


def _training(read: TrainingTables) -> Training:
    errors = read["noise_sums"].filter(pl.col("product") == "error")
    return Training(
        dataset=", ".join(errors["dataset"].unique().sort()),
        tracker=read.tracker,
        speed=float(read.speed),
        tracker_settings=read.settings,
        scenes=read.scenes,
        n_tracks=int(read["noise_outliers"]["n_tracks"].to_numpy().sum()),
        n_observations=int(errors["n"].to_numpy().sum()),
        ages=(int(errors["age"].min()), int(errors["age"].max())),  # type: ignore[arg-type]
    )


def _floor(floors: pl.DataFrame, last_age: int) -> float | None:
    """Root mean square error of true positions, px, of all sources together; None if it is unknown."""
    used = floors.filter(pl.col("source") == "all", pl.col("axis") == "age", pl.col("at").is_between(1, last_age))
    n = used["n"].to_numpy().sum()
    return float(np.sqrt((used["sum_uu"].to_numpy().sum() + used["sum_vv"].to_numpy().sum()) / (2 * n))) if n else None


def _recordings(read: TrainingTables) -> list[Recording]:
    """Some sequences, spread evenly over all of them."""
    places = np.unique(np.linspace(0, len(read.keys) - 1, min(_RECORDINGS, len(read.keys))).round().astype(int))
    found = []
    for key in (read.keys[place] for place in places):
        sights = read.of_sequence("audit_samples", key).select("u_birth_px", "v_birth_px", "depth_m").drop_nulls()
        cameras, poses = (read.of_sequence(name, key) for name in ("cameras", "poses"))
        if cameras.height and cameras["fx_px"][0] is not None:
            found.append(Recording(poses, cameras, sights.to_numpy()))
    return found


def lengths_of_tracks(ends: pl.DataFrame, *, longest: int) -> NDArray[np.int64]:
    """A thousand lengths of tracks with the distribution of Kaplan and Meier, (1000,), frames of the tracker.

    Parameters
    ----------
    ends
        Columns lifetime, n_ended and n_censored.
    longest
        Length of those that outlive all known ends, at least.
    """
    by_length = ends.group_by("lifetime").agg(pl.col("n_ended", "n_censored").sum()).sort("lifetime")
    lifetime, ended, censored = (by_length[name].to_numpy() for name in by_length.columns)
    gone = 1.0 - kaplan_meier(ended, censored).beyond
    shares = (np.arange(1000) + 0.5) / 1000
    place = np.searchsorted(gone, shares)
    return np.append(lifetime, max(longest, lifetime.max(initial=0)))[place].astype(np.int64)
