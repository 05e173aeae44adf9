"""Noise models as front ends have them, with sigmas for every landmark, purpose and window."""

from itertools import product

import numpy as np

from tracknoise.estimators.model import (
    Bias,
    BiasKind,
    CameraOfModel,
    Component,
    Equivalent,
    Interval,
    Kernel,
    Landmark,
    LossKind,
    Purpose,
    Tails,
    Training,
)
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import TruthVerdict

TRUSTED = TruthVerdict(Trust.trusted, "No fault was found.", "")
WINDOWS = (5, 10, 11, 20, 30)
_LANDMARKS = {Landmark.FREE: 1.0, Landmark.EXACT: 1.5, Landmark.STATE: 0.9}
_PURPOSES = {Purpose.INNOVATIONS: 0.5, Purpose.ALL_POSES: 0.6, Purpose.NEWEST_POSE: 1.0}


def interval(value: float) -> Interval:
    return Interval(value=value, low=0.9 * value, high=1.1 * value)


def component(sigma: float, ratio: float = 1.0) -> Component:
    """A covariance whose axes have standard deviations of this ratio."""
    across = sigma * np.sqrt(2.0 / (1.0 + ratio**2))
    why = None if sigma else "its interval reaches zero"
    return Component(covariance=np.diag([(ratio * across) ** 2, across**2]), sigma=interval(sigma), why_dropped=why)


def equivalents(sigma: float, per_window: float) -> tuple[Equivalent, ...]:
    """Sigmas that differ from each other. A gate is 1 for the sigma of innovations, and smaller for larger sigmas."""
    found = []
    for landmark, purpose, window in product(_LANDMARKS, _PURPOSES, WINDOWS):
        grown = 1.0 if purpose is Purpose.INNOVATIONS else (window / 11.0) ** per_window
        value = sigma * _LANDMARKS[landmark] * (_PURPOSES[purpose] if per_window else 1.0) * grown
        gate = (_PURPOSES[Purpose.INNOVATIONS] / _PURPOSES[purpose]) ** 2 if per_window else 1.0
        found.append(
            Equivalent(
                landmark=landmark,
                purpose=purpose,
                window=window,
                sigma=interval(value),
                gate_80=1.1 * gate,
                gate_95=1.2 * gate,
                gate_99=1.4 * gate,
            )
        )
    return tuple(found)


def kernels(innovations: float) -> tuple[Kernel, ...]:
    """Losses with knees of .3 to 3 innovations; those of 1 are as good as those of .3."""
    errors = {3.0: 0.9, 1.0: 0.705, 0.3: 0.7}
    return tuple(
        Kernel(
            kind=kind,
            knee_px=knee * innovations,
            sigma_ratio=interval(0.5 * knee**0.25),
            all_poses_ratio=interval(0.6 * knee**0.25),
            error_ratio=interval(ratio),
            windows=24,
        )
        for kind in LossKind
        for knee, ratio in errors.items()
    )


def lucas_kanade(**changes: object) -> NoiseModel:
    """White noise .1 px, wider along u, and a walk of .08 px per frame; heavy tails."""
    fields: dict[str, object] = {
        "training": _training("lucas-kanade"),
        "truth": TRUSTED,
        "camera": CameraOfModel(width=752, height=480, focal_px=458.6, rate_hz=20.0),
        "first": component(0.0),
        "white": component(0.1, 2.0),
        "walk": component(0.08),
        "drift": component(0.0),
        "tails": Tails(nu=4.0, core_sigma=0.2, core_ratio=0.7),
        "outlier_share": 0.01,
        "outliers_beyond_px": 3.0,
        "bias": Bias(kind=BiasKind.REFUSED, why="the scenes do not agree"),
        "equivalents": equivalents(0.3, 0.5),
        "kernels": kernels(0.15),
    }
    return NoiseModel(**{**fields, **changes})  # type: ignore[arg-type]


def detections(**changes: object) -> NoiseModel:
    """Noise of .4 px in every frame, the first included; Gaussian."""
    fields: dict[str, object] = {
        "training": _training("correspondence"),
        "truth": TRUSTED,
        "first": component(0.4),
        "white": component(0.4),
        "walk": component(0.0),
        "tails": Tails(nu=np.inf, core_sigma=0.4),
        "equivalents": equivalents(0.4, 0.0),
        "kernels": (),
    }
    return lucas_kanade(**{**fields, **changes})


def _training(tracker: str) -> Training:
    return Training(
        dataset="made",
        tracker=tracker,
        speed=1.0,
        tracker_settings={},
        scenes=("a", "b", "c"),
        n_tracks=3000,
        n_observations=30000,
        ages=(1, 30),
    )
