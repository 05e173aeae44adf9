"""Sigmas for an estimator that uses every n-th frame of a tracker.

Between two used frames the walks of n frames add up, while white noise is that of one frame. How much larger sigma must
be is the same as in the linear benchmark, over a window of sideways and one of forward motion.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tracknoise.noise_models.exports.scaling import scaled_equivalent
from tracknoise.noise_models.linear_benchmark import EXACT, consistencies, scalar_covariances, true_covariances
from tracknoise.noise_models.linear_window import CAMERA, Motion, linear_tracks, simulated_tracks, trajectory
from tracknoise.noise_models.model import Equivalent, Landmark, Purpose
from tracknoise.noise_models.track_noise import TrackNoise

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

_TRACKS = 40
"""Per window."""


def thinned(model: "NoiseModel", n: int) -> tuple[Equivalent, ...]:
    """Return the sigmas of a model for windows of every n-th frame that its tracker saw.

    A first direction that is a state counts as exact where the model has no noise of the first position, and as free
    otherwise.

    Parameters
    ----------
    model
        If it has no walk and no drift, its sigmas do not change.
    n
        Frames of the tracker per used frame.
    """
    if not (model.walk.covariance.any() or model.drift.covariance.any()):
        return model.equivalents
    noises = [model.components.per_frames(model.training.speed * steps) for steps in (1, n)]
    is_free = {Landmark.FREE: True, Landmark.EXACT: False, Landmark.STATE: bool(model.first.covariance.any())}
    kinds = {(one.window, is_free[one.landmark]) for one in model.equivalents}
    growth = {(window, free): _growth(noises, window, free=free) for window, free in kinds}
    return tuple(_grown(one, growth[one.window, is_free[one.landmark]]) for one in model.equivalents)


def _growth(noises: Sequence[TrackNoise], length: int, *, free: bool) -> Mapping[Purpose, float]:
    """How much larger the squared sigma of each purpose is for the second noise than for the first."""
    summed = {purpose: np.zeros(len(noises)) for purpose in Purpose}
    for motion in Motion:
        poses = trajectory(motion, length)
        window = [linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses, n_tracks=_TRACKS)]
        assumed = scalar_covariances(window, 1.0, first=None if free else EXACT)
        found = consistencies(window, [true_covariances(window, noise) for noise in noises], assumed)
        for purpose, total in summed.items():
            total += [one[purpose] for one in found]
    return {purpose: float(total[1] / total[0]) for purpose, total in summed.items()}


def _grown(equivalent: Equivalent, growth: Mapping[Purpose, float]) -> Equivalent:
    """Sigma grows by the ratio of its purpose, and the sum of squares that a gate sees by that of innovations."""
    own = growth[equivalent.purpose]
    seen = growth[Purpose.INNOVATIONS] / own
    found = scaled_equivalent(equivalent, math.sqrt(own))
    return replace(found, gate_95=found.gate_95 * seen, gate_99=found.gate_99 * seen)
