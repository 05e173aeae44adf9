"""Robust losses that fit the tails of a noise model.

For errors of Student's t in two dimensions, the loss of Cauchy with its knee at sqrt(nu + 2) is the likelihood itself,
on residuals that are whitened by nu / (nu + 2) times the core (noise_model.cauchy). The knee of Huber is the one under
which least squares estimates are most certain; residuals are whitened by the core.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tracknoise.noise_models.model import Tails

_HUBER_NU = (2.2, 2.5, 3.0, 4.0, 5.0, 8.0, 15.0)
_HUBER_KNEE = (0.73, 0.81, 0.91, 1.10, 1.24, 1.56, 1.99)
"""Best knees in units of the core, for blocks of two coordinates."""


class LossKind(StrEnum):
    """Robust losses of estimators."""

    CAUCHY = "cauchy"
    HUBER = "huber"


@dataclass(frozen=True, slots=True)
class Loss:
    """A robust loss on whitened residuals.

    Parameters
    ----------
    kind
        Its name.
    knee
        In standard deviations after whitening; infinite where no robust loss is warranted.
    covariance_factor
        What to multiply covariances of the model by before whitening with them.
    expected_nees
        Normalised estimation error squared per degree of freedom that a solver reports if the model is right.
    """

    kind: LossKind
    knee: float
    covariance_factor: float
    expected_nees: float | None


def matched_loss(kind: LossKind, tails: Tails) -> Loss:
    """The loss of a kind that fits the tails."""
    if math.isinf(tails.nu):
        return Loss(kind, math.inf, 1.0, 1.0)
    core, nu = tails.core_ratio**2, tails.nu
    if kind == LossKind.CAUCHY:
        factor = core * nu / (nu + 2.0)
        return Loss(
            kind=kind, knee=math.sqrt(nu + 2.0), covariance_factor=factor, expected_nees=(nu + 4.0) / (nu + 2.0)
        )
    knee = float(np.interp(nu, _HUBER_NU, _HUBER_KNEE))
    return Loss(kind, knee, core, None)
