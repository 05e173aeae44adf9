"""What the templates of estimators can name: numbers of a noise model, for one estimator."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.model import Equivalent, Landmark, Purpose

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

LEAST_PX = 0.01
"""What is written for a component that is zero, px: estimators divide by it."""
_GOOD_TRACKS = 0.999
"""Share of good tracks that pass a bound on their largest residual."""
_GAUSSIAN_KNEES: Mapping[str, float] = {"huber": 2.45, "cauchy": 2.385}
"""Knees for Gaussian errors, in standard deviations of residuals.

95 % of 2-D residuals are below that of Huber, which leaves the covariance right. That of Cauchy keeps 95 % of the
efficiency of least squares.
"""


@dataclass(frozen=True, slots=True)
class Noise:
    """The noise of a model, as an estimator uses it. Templates call it `noise`.

    Factors on gates are not below 1. Those of a model are for true poses, and are smaller where sigma is larger than
    the residuals. The innovations that a filter gates contain the errors of its predicted poses, too.

    Parameters
    ----------
    model
        In px and frames of the estimator.
    landmark, window
        How it uses the first observation of a track, and the length of its window, frames.
    purpose
        What its sigma makes right; None if it takes the components themselves.
    """

    model: "NoiseModel"
    landmark: Landmark
    window: int
    purpose: Purpose | None

    def equivalent(self, *, window: int | None = None, purpose: Purpose | None = None) -> Equivalent:
        """The sigma for a window and a purpose, by default its own. Without a purpose, the one of residuals.

        Raises
        ------
        SettingsError
            If the model has none, or one that is not a positive number.
        """
        found = self.model.equivalent(
            landmark=self.landmark,
            window=self.window if window is None else window,
            purpose=purpose or self.purpose or Purpose.INNOVATIONS,
        )
        if not 0.0 < found.sigma.value < math.inf:
            raise SettingsError(
                f"sigma for {found.purpose}, windows of {found.window} frames, is {found.sigma.value:g} px, "
                "expected a number above 0"
            )
        return found

    @property
    def sigma(self) -> float:
        """Standard deviation, px."""
        return self.equivalent().sigma.value

    def sigma_at(self, window: int) -> float:
        """The same for another window."""
        return self.equivalent(window=window).sigma.value

    @property
    def gate_95(self) -> float:
        """Factor on a chi-square gate at .95, with `sigma`."""
        return max(self.equivalent().gate_95, 1.0)

    @property
    def residual_gate_95(self) -> float:
        """Factor on a chi-square gate at .95, with a sigma of the size of residuals."""
        return max(self._residual.gate_95, 1.0)

    @property
    def gate_99(self) -> float:
        """Factor on a chi-square gate at .99, with `sigma`."""
        return max(self.equivalent().gate_99, 1.0)

    def gate_at(self, window: int) -> float:
        """Factor on a chi-square gate at .95, with `sigma_at`."""
        return max(self.equivalent(window=window).gate_95, 1.0)

    @property
    def first(self) -> float:
        """Standard deviation of the first position, px, not below `LEAST_PX`."""
        return max(self.model.first.sigma.value, LEAST_PX)

    @property
    def white(self) -> float:
        """Standard deviation that is independent in each frame, px, not below `LEAST_PX`."""
        return max(self.model.white.sigma.value, LEAST_PX)

    @property
    def walk(self) -> float:
        """Standard deviation of the walk in one frame, px; may be zero."""
        return self.model.walk.sigma.value

    @property
    def first_covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2, invertible."""
        return invertible(self.model.first.covariance)

    @property
    def white_covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2, invertible."""
        return invertible(self.model.white.covariance)

    @property
    def walk_covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2 per frame; may be zero."""
        return self.model.walk.covariance

    @property
    def drift_covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2 per frame^2; may be zero."""
        return self.model.drift.covariance

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2, of one observation: its mean variance is that of `sigma`.

        Its shape is that of an observation in the middle of a window.
        """
        age = (self.window - 1) / 2.0
        total = self.first_covariance + self.white_covariance + age * self.walk_covariance
        total = total + age**2 * self.drift_covariance
        return np.asarray(self.sigma**2 * total / (np.trace(total) / 2.0))

    @property
    def huber_px(self) -> float:
        """Knee of a Huber loss, px."""
        return self._knee("huber")

    @property
    def cauchy_px(self) -> float:
        """Scale of a Cauchy loss, px."""
        return self._knee("cauchy")

    @property
    def huber(self) -> float:
        """Knee of a Huber loss, in units of `sigma`."""
        return self.huber_px / self.sigma

    @property
    def cauchy(self) -> float:
        """Scale of a Cauchy loss, in units of `sigma`."""
        return self.cauchy_px / self.sigma

    @property
    def largest_residual(self) -> float:
        """Bound on the lengths of all residuals of a track, px: one of 1000 good tracks exceeds it.

        For Gaussian errors, widened by what the gate shows of their tails.
        """
        longest = math.sqrt(-2.0 * math.log1p(-(_GOOD_TRACKS ** (1.0 / self.window))))
        return self._residual.sigma.value * longest * math.sqrt(self._residual.gate_99)

    @property
    def longer_side(self) -> int:
        """Longer side of the image, px."""
        return max(self.model.camera.width, self.model.camera.height)

    def _knee(self, kind: str) -> float:
        """Knee of a robust loss on residuals that are not whitened, px. It depends on their size, not on `sigma`."""
        loss = self.model.loss(kind)
        robust = math.isfinite(loss.knee)
        knee = loss.knee * math.sqrt(loss.covariance_factor) if robust else _GAUSSIAN_KNEES[kind]
        return knee * self._residual.sigma.value

    @property
    def _residual(self) -> Equivalent:
        """The sigma that residuals have."""
        return self.equivalent(purpose=Purpose.INNOVATIONS)


def invertible(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariances (..., 2, 2) px^2, with variances not below the square of `LEAST_PX` in any direction."""
    variances, axes = np.linalg.eigh(covariances)
    return np.asarray((axes * np.maximum(variances, LEAST_PX**2)[..., None, :]) @ np.swapaxes(axes, -1, -2))
