"""Tests of one parameter beside others: significance, what it explains, and whether trackers agree on it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.agreement import Shares, shares
from tracknoise.audit.fit import Start, fit
from tracknoise.audit.fitted import Fit
from tracknoise.audit.held_out import Gain, gain, held_out_residuals, losses
from tracknoise.audit.jackknife import Jackknife, jackknife
from tracknoise.audit.parameters import NUMBERS, Parameter
from tracknoise.audit.robust import scales
from tracknoise.audit.samples import AuditSamples

ALPHA = 0.05
"""Level of the tests, after Holm's adjustment for all parameters."""
LEVEL = 1.0 - ALPHA
POWER = 0.9
"""Probability with which a fault of the size that is called visible is found."""
MARGIN = 0.02
"""Least share that a fault must explain on held-out clusters to be named."""
_NEAR_KIND = 0.4
"""A number that is 0 or 1 in truth is 1 if it is this near to it; others stand in for another fault."""


@dataclass(frozen=True)
class Basis:
    """A fit to which a parameter is added.

    Attributes
    ----------
    fitted, moves
        The fit and its jackknife.
    start
        Its corrections, and what they predict.
    scale : (n,)
        Robust scale of its residuals, px.
    loss : (clusters,)
        See `tracknoise.audit.held_out.losses`.
    """

    fitted: Fit
    moves: Jackknife
    start: Start
    scale: NDArray[np.float64]
    loss: NDArray[np.float64]

    @classmethod
    def of(cls, samples: AuditSamples, parameters: Sequence[Parameter], start: Start, *, with_bias: bool) -> "Basis":
        """Fit what has been named so far."""
        fitted = fit(samples, parameters, start, with_bias=with_bias)
        moves = jackknife(fitted.equations)
        residual = held_out_residuals(samples, fitted, moves)
        scale = scales(samples.group, residual)
        there = Start.at(samples, fitted.theta) if parameters else start
        return cls(fitted, moves, there, scale, losses(samples, residual, scale))

    def loss_in_units_of(self, samples: AuditSamples, other: "Basis") -> NDArray[np.float64]:
        """Losses of this fit for the scales of another, (clusters,)."""
        return losses(samples, held_out_residuals(samples, self.fitted, self.moves), other.scale)


@dataclass(frozen=True)
class Assessment:
    """A parameter beside those of a basis.

    Attributes
    ----------
    parameter
        What was added.
    fitted, moves
        The fit of all of them, and its jackknife.
    loss : (clusters,)
        With the correction, see `tracknoise.audit.held_out.losses`.
    gain
        Share that the correction explains on held-out clusters beyond the basis.
    p
        Of the test that the correction is zero.
    """

    parameter: Parameter
    fitted: Fit
    moves: Jackknife
    loss: NDArray[np.float64]
    gain: Gain
    p: float

    @property
    def places(self) -> NDArray[np.intp]:
        """Columns of the parameter in the fit."""
        k = len(self.fitted.free)
        return np.arange(k - NUMBERS[self.parameter].count, k)

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Numbers of the parameter."""
        return self.fitted.estimate[self.places]

    @property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of their intervals."""
        return self.moves.half_widths(LEVEL)[self.places]

    @property
    def explains(self) -> bool:
        """Whether the correction surely explains something, and enough to be named."""
        return self.gain.value >= MARGIN and self.gain.low > 0.0

    @property
    def is_possible(self) -> bool:
        """Whether there are faults with this estimate."""
        return not NUMBERS[self.parameter].is_kind or bool(abs(self.estimate[0] - 1.0) < _NEAR_KIND)

    @cached_property
    def shares(self) -> list[Shares]:
        """What each tracker sees of the correction."""
        return shares(self.fitted, self.places, level=LEVEL)

    @property
    def is_agreed(self) -> bool:
        """Whether no tracker contradicts."""
        return not any(share.contradicts for share in self.shares)


def assess(samples: AuditSamples, basis: Basis, parameter: Parameter) -> Assessment:
    """Add a parameter to those of a basis."""
    fitted = fit(samples, (*basis.fitted.parameters, parameter), basis.start, with_bias=basis.fitted.with_bias)
    moves = jackknife(fitted.equations)
    loss = losses(samples, held_out_residuals(samples, fitted, moves), basis.scale)
    k = len(fitted.free)
    places = np.arange(k - NUMBERS[parameter].count, k)
    p = moves.p_value(fitted.estimate[places], places)
    return Assessment(parameter, fitted, moves, loss, gain(loss, basis.loss, level=LEVEL), p)
