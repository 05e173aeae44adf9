"""A fit, and how it moves when scenes, or blocks of tracks, are left out."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.fitted import Fit
from tracknoise.audit.held_out import Gain, gain, held_out_errors, held_out_residuals, losses
from tracknoise.audit.jackknife import Jackknife, jackknife
from tracknoise.audit.normal import normal_equations
from tracknoise.audit.robust import scales
from tracknoise.audit.samples import AuditSamples
from tracknoise.tables.enumerations import Resampled

LEVEL = 0.95
"""Probability with which an interval holds what it is of."""


@dataclass(frozen=True)
class ResampledFit:
    """A fit and its jackknife.

    Attributes
    ----------
    samples
        The observations, whose clusters are left out.
    fitted
        With normal equations of these clusters.
    moves
        How the fit moves.
    """

    samples: AuditSamples
    fitted: Fit
    moves: Jackknife

    @classmethod
    def of(cls, samples: AuditSamples, fitted: Fit) -> "ResampledFit":
        """Leave out the clusters of the samples of the fit."""
        return cls(samples, fitted, jackknife(fitted.equations))

    @cached_property
    def by_blocks(self) -> "ResampledFit":
        """The same fit, of which blocks of tracks are left out."""
        if self.samples.resampled == Resampled.blocks:
            return self
        samples, fitted = self.samples.by_blocks, self.fitted
        scale = scales(samples.group, fitted.residual)
        equations = normal_equations(
            samples.tracker, samples.cluster, fitted.design, fitted.residual, scale, fitted.equations.ridge
        )
        return ResampledFit(samples, replace(fitted, equations=equations), jackknife(equations))

    def like(self, other: "ResampledFit") -> "ResampledFit":
        """The same fit, of which blocks are left out if they are of another."""
        return self.by_blocks if other.samples.resampled == Resampled.blocks else self

    @cached_property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of the interval of each column."""
        return self.moves.half_widths(LEVEL)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Residuals, (n, 2), px, each about the fit without its cluster."""
        return held_out_residuals(self.samples, self.fitted, self.moves)

    @cached_property
    def error(self) -> NDArray[np.float64]:
        """Errors, (n, 2), px, about the truth corrected by the fit without the cluster of each observation."""
        return held_out_errors(self.samples, self.fitted, self.moves)

    def gain_beyond(self, base: "ResampledFit", scale: NDArray[np.float64]) -> Gain:
        """Share that this fit explains of its held-out clusters beyond another fit of the same observations."""
        return gain(self.losses(scale), base.like(self).losses(scale), level=LEVEL)

    def losses(self, scale: NDArray[np.float64]) -> NDArray[np.float64]:
        """(clusters,): see `tracknoise.audit.held_out.losses`."""
        return losses(self.samples, self.residual, scale)
