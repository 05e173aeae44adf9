"""Definitions of the words on the first screen, which the page shows where a reader points at them."""

from collections.abc import Mapping

_GATE = "Factor on the chi-square quantile at .95 above which a filter rejects a track, or one observation."
TERMS: Mapping[str, str] = {
    "sigma": "Standard deviation of each coordinate of a position, px, as an estimator assumes it.",
    "innovations": "A filter's observations minus its predictions.",
    "track gate": _GATE,
    "observation gate": _GATE,
    "errors in common": "Errors that all features of a frame share: they do not average out with more features.",
    "knee": "Residual above which a robust loss grows more slowly, in sigmas.",
    "core": "Sigma of the Gaussian with the same median absolute error.",
    "RMS": "Square root of the second moment about zero.",
    "lifetime": "Number of consecutive frames, of those that the tracker saw, in which a feature was found.",
    "outliers": "Features rejected as outliers in a frame, divided by the features offered to the tracker.",
    "rank": "Best and worst place of a tracker among others, by the differences that are shown.",
}
"""By the word, as the page writes it. `docs/glossary.md` has the same definitions, which a test compares."""
