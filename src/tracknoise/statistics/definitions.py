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


STEPS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256)
"""Ages, in steps of the tracker, at which tables have rows that would be too many at every age."""
PLACE_AGES = (1, 5, 10, 20)
"""Ages at which errors are divided by place, frames of the nominal sequence."""
MAP_COLUMNS, MAP_ROWS = 20, 14
"""Cells of the map of the image."""
EDGE_BOUNDS_PX = (0.0, 2.0, 4.0, 7.5, 15.0)
"""Bounds of the classes of distances to a depth edge, px."""
NEAR_EDGE_PX = 7.5
"""A feature nearer to a depth edge than this lies beside it, px: half the window of a Lucas-Kanade tracker."""
INCIDENCE_STEP_DEG = 15
"""Width of the classes of angles of incidence, degrees."""
