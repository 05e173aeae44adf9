"""Definitions of the words on the first screen, which the page shows where a reader points at them."""

from collections.abc import Mapping

TERMS: Mapping[str, str] = {
    "sigma": "Standard deviation of each image coordinate that an estimator assumes for a tracked position, px.",
    "innovations": "What a filter sees: observed minus predicted positions, after a 3-D point was fitted to the track.",
    "track gate": "Factor on the 95 % quantile of chi-square. A whole track with larger squared residuals is rejected.",
    "observation gate": "The same factor for the residual of a single position.",
    "knee": "Size of a residual, in sigmas, from which on a robust loss gives it less weight.",
    "core": "Standard deviation of the Gaussian with the same median error: what typical errors are, without far ones.",
    "RMS": "Root mean square of all errors: a few tracks that follow the wrong point decide it.",
    "lifetime": "Frames from the first observation of a track to its last.",
    "outliers": "Features that a tracker rejects in a frame, as a share of those that it was given.",
    "rank": "A range: best and worst place that a tracker can have, by the differences that are shown.",
    "truth": "Where each feature really was: its first position, projected by known poses and depth.",
}
"""By the word, as the page writes it. `docs/glossary.md` has the same definitions."""
