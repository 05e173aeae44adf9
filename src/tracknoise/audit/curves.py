"""Errors by age before and after corrections, on units that took no part in their fits."""

from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.held_out import held_out_errors
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.selection import Selection
from tracknoise.tables.audit_schema import AUDIT_CURVES

MEASURED, EVERYTHING = "measured", "all"
_CORES = 5.0
_MEDIAN_TO_CORE = 1.4826


def corrected_errors(samples: AuditSamples, selection: Selection) -> dict[str, NDArray[np.float64]]:
    """Errors (n, 2), px, by correction: as measured, with each fault and those before it corrected, and with all."""
    found = {MEASURED: samples.observed - samples.stated}
    for one in selection.named:
        found[one.parameter] = held_out_errors(samples, one.assessment.fitted, one.assessment.moves)
    if selection.named:
        found[EVERYTHING] = held_out_errors(samples, selection.final.fitted, selection.final.moves)
    return found


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
    """Observations that are known for every correction, and are outliers for none or not for all of them."""
    known = np.logical_and.reduce([np.isfinite(error).all(axis=1) for error in errors.values()])
    near = np.zeros(len(known), dtype=bool)
    for error in errors.values():
        length = np.hypot(error[:, 0], error[:, 1])
        near |= length <= _CORES * _cores(samples, length, known)
    return np.asarray(known & near)


def _cores(samples: AuditSamples, length: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Median length of the errors of the same tracker and age, (n,)."""
    found = np.zeros(len(length))
    place = samples.tracker * (samples.age.max(initial=0) + 1) + samples.age
    for one in np.unique(place).tolist():
        rows = place == one
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
