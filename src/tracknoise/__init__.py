"""Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.

`open_sequence` opens images of known geometry. `measure` runs trackers over them and returns tables of errors, and
`analyse` computes findings from several measurements. `open_run` reads what `tracknoise run` has measured, and
`compare` compares such runs. Names are loaded when first used, so that importing the package is quick.
"""

from importlib import import_module

__version__ = "0.2.0"

_HOMES = {
    "AccuracyRule": "truth.accuracies",
    "AlignedPatches": "trackers.aligned_patches",
    "Corrections": "geometry.corrections",
    "Correspondence": "trackers.correspondence",
    "DenseFlow": "trackers.dense_flow",
    "Detection": "trackers.detection",
    "Function": "trackers.function",
    "Imported": "trackers.imported",
    "LucasKanade": "trackers.lucas_kanade",
    "Measurement": "experiments.measure",
    "NoiseModel": "estimators.noise_model",
    "Oracle": "trackers.oracle",
    "Preprocessing": "trackers.preprocessing",
    "Rejection": "trackers.rejection",
    "Run": "api.finished_run",
    "Sequence": "sequences.arrays",
    "TracknoiseError": "exceptions",
    "TruthAccuracy": "geometry.accuracy",
    "analyse": "api.analyse",
    "compare": "experiments.compare_runs",
    "curves": "statistics.curves",
    "lifetimes": "statistics.lifetimes",
    "measure": "experiments.measure",
    "open_run": "api.finished_run",
    "open_sequence": "sequences.reader_registry",
    "open_sequences": "sequences.reader_registry",
    "outlier_ratios": "statistics.track_counts",
    "summarise_sequence": "statistics.summarise",
    "summary": "statistics.summary",
    "tap_metrics": "experiments.measure",
}
"""Module of each public name, which `__init__.pyi` shows to editors and type checkers."""
__all__ = [*_HOMES]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
