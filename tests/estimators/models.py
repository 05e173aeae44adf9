"""Noise models made by hand."""

import numpy as np

from tracknoise.estimators.model import (
    Bias,
    BiasKind,
    CameraOfModel,
    Component,
    Equivalent,
    Factor,
    Interval,
    Landmark,
    Purpose,
    Tails,
    Training,
)
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import TruthVerdict

TRUSTED = TruthVerdict(Trust.trusted, "No fault was found.", "")
TRAINING = Training(
    dataset="made",
    tracker="lk",
    speed=1,
    tracker_settings={"kind": "lucas-kanade", "levels": 3},
    scenes=("a", "b"),
    n_tracks=300,
    n_observations=9000,
    ages=(1, 30),
)
CAMERA = CameraOfModel(width=640, height=480, focal_px=460.0, rate_hz=20.0)
TEXTURE = Factor(
    of="min_eigenvalue", log_knots=(0.0, 2.0), log_factor=(1.0, -1.0), gain=Interval(value=0.1, low=0.05, high=0.15)
)


def component(sigma_px: float) -> Component:
    """An isotropic one."""
    return Component(covariance=sigma_px**2 * np.eye(2), sigma=Interval(value=sigma_px))


def made(first: float = 0.0, white: float = 0.0, walk: float = 0.0, drift: float = 0.0, **more: object) -> NoiseModel:
    """A model with these standard deviations, px."""
    sigma = Interval(value=0.3, low=0.2, high=0.4)
    fields = {
        "training": TRAINING,
        "truth": TRUSTED,
        "camera": CAMERA,
        "tails": Tails(nu=4.0, core_sigma=0.2, core_ratio=0.7),
        "outlier_share": 0.01,
        "outliers_beyond_px": 3.0,
        "bias": Bias(kind=BiasKind.REFUSED, why="the scenes do not agree"),
        "conditions": (TEXTURE,),
        "equivalents": tuple(
            Equivalent(
                landmark=Landmark.FREE,
                purpose=Purpose.NEWEST_POSE,
                window=window,
                sigma=sigma,
                gate_95=1.1,
                gate_99=1.3,
            )
            for window in (5, 10, 30)
        ),
    }
    parts = {"first": first, "white": white, "walk": walk, "drift": drift}
    return NoiseModel(**{name: component(sigma) for name, sigma in parts.items()}, **{**fields, **more})
