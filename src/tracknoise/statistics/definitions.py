"""Names, units and fixed numbers of the statistics, for all that compute, test or show them."""

from tracknoise.tables.schema import CONDITION

POOLED = ["dataset", *CONDITION]
"""Columns that identify a condition of a dataset once its scenes are pooled."""
UNITS = {"mean": "px", "absolute": "px", "second": "px^2", "central": "px^2"}
"""Role of every statistic of errors, and its unit."""
NAMES = {
    "age": {"mean": "nu", "absolute": "eta", "second": "Phi", "central": "central"},
    "frame": {"mean": "mu", "absolute": "kappa", "second": "Sigma", "central": "central"},
}
"""Name of each statistic by its role, for both axes that curves run along."""
REFERENCE_AGE = 10
"""Largest age at which the summary reports errors, frames of the nominal sequence."""
LONG_LIVED_AGES = (5, 10, 20, 50, 100)
"""Ages that define long-lived tracks, frames of the nominal sequence."""
LENGTHS: tuple[tuple[int, int | None], ...] = ((2, 2), (3, 4), (5, 9), (10, 19), (20, 49), (50, None))
"""Classes of lengths of tracks, in observations, for noise that is corrected for a fit."""
WINDOWS = (3, 5, 10, 15, 20, 30)
"""Lengths of the windows in which an estimator sees a track, in observations."""
LEAST_MOTION_PX = 0.1
"""Shortest motion of a true position between two frames that has a direction, px."""
LAGS = 5
"""Largest lag of the autocorrelation, in steps of the tracker."""
