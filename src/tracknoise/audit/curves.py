"""Errors by age before and after corrections, on units that took no part in their fits."""

from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.samples import AuditSamples
from tracknoise.tables.audit_schema import AUDIT_CURVES

_CORES = 5.0
"""Errors longer than so many median lengths are outliers."""
_MEDIAN_TO_CORE = 1.4826


def curves(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]], dataset: str) -> pl.DataFrame:
    """Table `AUDIT_CURVES`."""
    good = _inliers(samples, errors)
    rows = [
        {"dataset": dataset, "tracker": name, "correction": correction, "age": int(age), **_moments(error[chosen])}
        for tracker, name in enumerate(samples.trackers)
        for age in np.unique(samples.age[samples.tracker == tracker]).tolist()
        for chosen in [good & (samples.tracker == tracker) & (samples.age == age)]
        for correction, error in errors.items()
        if chosen.any()
    ]
    return pl.DataFrame(rows, schema=dict(AUDIT_CURVES))


def second_moments(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]]) -> dict[str, float]:
    """Mean squared error of both coordinates together, px^2, by correction."""
    good = _inliers(samples, errors)
    return {
        name: float(np.mean(np.sum(error[good] ** 2, axis=1))) if good.any() else 0.0 for name, error in errors.items()
    }


def _inliers(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Observations that are known for every correction, and are no outliers after the last."""
    known = np.asarray(np.logical_and.reduce([np.isfinite(error).all(axis=1) for error in errors.values()]))
    last = list(errors.values())[-1]
    length = np.hypot(last[:, 0], last[:, 1])
    return np.asarray(known & (length <= _CORES * _medians(samples, length, known)))


def _medians(samples: AuditSamples, length: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Median length of the errors of the same tracker and age, (n,)."""
    found = np.zeros(len(length))
    for group in np.unique(samples.group).tolist():
        rows = samples.group == group
        chosen = length[rows & known]
        found[rows] = np.median(chosen) if len(chosen) else 0.0
    return found


def _moments(error: NDArray[np.float64]) -> dict[str, float | int]:
    mean, second = error.mean(axis=0), np.mean(error**2, axis=0)
    core = _MEDIAN_TO_CORE * np.median(np.abs(error), axis=0)
    return {
        "n": len(error),
        "mean_u_px": float(mean[0]),
        "mean_v_px": float(mean[1]),
        "second_uu": float(second[0]),
        "second_vv": float(second[1]),
        "core_u_px": float(core[0]),
        "core_v_px": float(core[1]),
    }
