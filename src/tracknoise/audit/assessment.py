"""Tests of one parameter beside others: significance, what it explains, and whether trackers agree on it.

Tests leave out scenes where at least `LEAST_EFFECTIVE` of them determine the parameter by (audit.effective). Otherwise
they leave out blocks of tracks within scenes: a clock offset, for example, shows only where the camera changes its
speed, and a test over scenes finds nothing if two of eight do. Intervals are from scenes in any case, with the few
degrees of freedom that there are. A parameter is significant only if they exclude zero, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.agreement import Shares, shares
from tracknoise.audit.fit import Start, fit
from tracknoise.audit.fitted import Fit
from tracknoise.audit.held_out import Gain
from tracknoise.audit.parameters import NUMBERS, Parameter
from tracknoise.audit.resampled_fit import LEVEL, ResampledFit
from tracknoise.audit.robust import scales
from tracknoise.audit.samples import AuditSamples

ALPHA = 1.0 - LEVEL
"""Level of the tests, after Holm's adjustment for all parameters."""
MARGIN = 0.02
"""Least share that a fault must explain on held-out clusters to be named."""
LEAST_EFFECTIVE = 5.0
"""Fewest effective scenes that tests leave out as such."""
_NEAR_KIND = 0.4
"""A number that is 0 or 1 in truth is 1 if it is this near to it; others stand in for another fault."""


@dataclass(frozen=True)
class Basis:
    """A fit to which a parameter is added.

    Attributes
    ----------
    resampled
        The fit and its jackknife.
    start
        Its corrections, and what they predict.
    scale : (n,)
        Robust scale of its residuals, px.
    """

    resampled: ResampledFit
    start: Start
    scale: NDArray[np.float64]

    @classmethod
    def of(cls, samples: AuditSamples, parameters: Sequence[Parameter], start: Start, *, with_bias: bool) -> "Basis":
        """Fit what has been named so far."""
        fitted = fit(samples, parameters, start, with_bias=with_bias)
        resampled = ResampledFit.of(samples, fitted)
        there = Start.at(samples, fitted.theta) if parameters else start
        return cls(resampled, there, scales(samples.group, resampled.residual))

    @property
    def fitted(self) -> Fit:
        """The fit."""
        return self.resampled.fitted

    def gain_of(self, other: ResampledFit) -> Gain:
        """Share that another fit explains of held-out clusters, those of the other fit, beyond this one."""
        return other.gain_beyond(self.resampled, self.scale)


@dataclass(frozen=True)
class Assessment:
    """A parameter beside those of a basis.

    Attributes
    ----------
    parameter
        What was added.
    resampled, tested
        The fit of all of them, and its jackknife: for intervals, and for tests.
    basis
        What it was added to.
    gain
        Share that the correction explains on held-out clusters beyond the basis.
    p
        Of the test that the correction is zero; 1 where an interval does not exclude zero.
    """

    parameter: Parameter
    resampled: ResampledFit
    tested: ResampledFit
    basis: Basis
    gain: Gain
    p: float

    @property
    def fitted(self) -> Fit:
        """The fit."""
        return self.resampled.fitted

    @property
    def places(self) -> NDArray[np.intp]:
        """Columns of the parameter in the fit."""
        return self.fitted.places_of(self.parameter)

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Numbers of the parameter."""
        return self.fitted.estimate[self.places]

    @property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of their intervals."""
        return self.resampled.half_widths[self.places]

    def gain_beyond(self, other: "Assessment") -> Gain:
        """Share that this correction explains of its held-out clusters beyond another one."""
        return self.tested.gain_beyond(other.resampled, self.basis.scale)

    @property
    def explains(self) -> bool:
        """Whether the correction explains enough to be named."""
        return is_enough(self.gain)

    @property
    def is_small(self) -> bool:
        """Whether the correction explains too little to be named."""
        return self.gain.value < MARGIN

    @property
    def is_possible(self) -> bool:
        """Whether there are faults with this estimate."""
        return not NUMBERS[self.parameter].is_kind or bool(abs(self.estimate[0] - 1.0) < _NEAR_KIND)

    @cached_property
    def shares(self) -> list[Shares]:
        """What each tracker sees of the correction."""
        return shares(self.tested.fitted, self.places, level=LEVEL)

    @property
    def is_agreed(self) -> bool:
        """Whether no tracker contradicts."""
        return not any(share.contradicts for share in self.shares)


def is_enough(found: Gain) -> bool:
    """Whether something is surely explained, and enough to name what explains it."""
    return found.value >= MARGIN and found.low > 0.0


def assess(samples: AuditSamples, basis: Basis, parameter: Parameter) -> Assessment:
    """Add a parameter to those of a basis."""
    fitted = fit(samples, (*basis.fitted.parameters, parameter), basis.start, with_bias=basis.fitted.with_bias)
    places = fitted.places_of(parameter)
    resampled = ResampledFit.of(samples, fitted)
    is_by_scenes = resampled.moves.effective(places) >= LEAST_EFFECTIVE
    tested = resampled if is_by_scenes else resampled.by_blocks
    p = tested.moves.p_value(fitted.estimate[places], places)
    if not is_by_scenes and not _excludes_zero(resampled, places):
        p = 1.0
    return Assessment(parameter, resampled, tested, basis, basis.gain_of(tested), p)


def _excludes_zero(resampled: ResampledFit, places: NDArray[np.intp]) -> bool:
    """Whether the interval of one of the numbers does."""
    return bool(np.any(np.abs(resampled.fitted.estimate[places]) > resampled.half_widths[places]))
