"""Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.

`open_sequence` opens images of known geometry. `measure` runs trackers over them and returns tables of errors, and
`analyse` computes findings from several measurements. `open_run` reads what `tracknoise run` has measured, and
`compare` compares such runs. Names are loaded when first used, so that importing the package is quick.
"""

from importlib import import_module

TYPE_CHECKING = False  # as that of `typing`, which takes a while to load
if TYPE_CHECKING:
    from tracknoise.api.analyse import analyse
    from tracknoise.api.finished_run import Run, open_run
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import TracknoiseError
    from tracknoise.experiments.compare_runs import compare
    from tracknoise.experiments.measure import Measurement, measure, tap_metrics
    from tracknoise.geometry.accuracy import TruthAccuracy
    from tracknoise.geometry.corrections import Corrections
    from tracknoise.sequences.arrays import Sequence
    from tracknoise.sequences.reader_registry import open_sequence, open_sequences
    from tracknoise.statistics.curves import curves
    from tracknoise.statistics.lifetimes import lifetimes
    from tracknoise.statistics.summarise import summarise_sequence
    from tracknoise.statistics.summary import summary
    from tracknoise.statistics.track_counts import outlier_ratios
    from tracknoise.trackers.aligned_patches import AlignedPatches
    from tracknoise.trackers.correspondence import Correspondence
    from tracknoise.trackers.dense_flow import DenseFlow
    from tracknoise.trackers.detection import Detection
    from tracknoise.trackers.function import Function
    from tracknoise.trackers.imported import Imported
    from tracknoise.trackers.lucas_kanade import LucasKanade
    from tracknoise.trackers.oracle import Oracle
    from tracknoise.trackers.preprocessing import Preprocessing
    from tracknoise.trackers.rejection import Rejection
    from tracknoise.truth.accuracies import AccuracyRule

__version__ = "0.2.0"

__all__ = [
    "AccuracyRule",
    "AlignedPatches",
    "Corrections",
    "Correspondence",
    "DenseFlow",
    "Detection",
    "Function",
    "Imported",
    "LucasKanade",
    "Measurement",
    "NoiseModel",
    "Oracle",
    "Preprocessing",
    "Rejection",
    "Run",
    "Sequence",
    "TracknoiseError",
    "TruthAccuracy",
    "analyse",
    "compare",
    "curves",
    "lifetimes",
    "measure",
    "open_run",
    "open_sequence",
    "open_sequences",
    "outlier_ratios",
    "summarise_sequence",
    "summary",
    "tap_metrics",
]

_HOMES = {
    "Corrections": "geometry.corrections",
    "AccuracyRule": "truth.accuracies",
    "AlignedPatches": "trackers.aligned_patches",
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


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
