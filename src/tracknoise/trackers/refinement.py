"""Refinement of positions that another front end reports: Lucas-Kanade from there to the patch of an earlier image."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require_bounds, settle_members
from tracknoise.trackers.features import Features, displacement_px
from tracknoise.trackers.following import Flow, Follower
from tracknoise.trackers.key_frames import Template
from tracknoise.trackers.lucas_kanade import LARGEST_WINDOW_PX, MOST_LEVELS, LucasKanade, PatchFollower
from tracknoise.trackers.tracker import Frame

SHIFT = "refine_shift_px"
"""Name of the quality that says how far a position was moved; NaN where it stayed."""


class RefinedTo(StrEnum):
    """Which patch positions are refined to.

    none: they stay. previous: that around the refined position in the previous image, so that errors of steps add up.
    first: that of the image in which the track began, which drifts less and fits later images less well.
    """

    none = "none"
    previous = "previous"
    first = "first"


@dataclass(frozen=True, slots=True)
class Refinement:
    """Whether and how positions are refined by Lucas-Kanade, which starts at the reported ones. By default they stay.

    A position stays where Lucas-Kanade does not find the patch, or moves it farther than `max_shift_px`; no track ends.
    The quality ``refine_shift_px`` says how far each was moved. First positions stay. Covariances that a front end
    states stay too, although they are of its own positions.

    Parameters
    ----------
    template
        Which patch they are refined to.
    window_px
        Side of the patch, px.
    extra_levels
        Levels of the image pyramid above the full resolution.
    max_shift_px
        Largest correction, px.
    """

    template: RefinedTo = RefinedTo.none
    window_px: Annotated[int, Ge(3), Le(LARGEST_WINDOW_PX)] = 15
    extra_levels: Annotated[int, Ge(0), Le(MOST_LEVELS)] = 1
    max_shift_px: Positive = 3.0

    def __post_init__(self) -> None:
        settle_members(self, template=RefinedTo)
        require_bounds(self)

    def refiner(self) -> "Refiner | None":
        """What refines the positions of one tracker on one sequence; None where they stay."""
        return None if self.template is RefinedTo.none else Refiner(self)

    def refining(self, follower: Follower) -> Follower:
        """A follower whose positions are refined; itself where they stay."""
        refiner = self.refiner()
        return follower if refiner is None else _Refining(follower, refiner)


class Refiner:
    """Refines the positions of one tracker, image by image."""

    def __init__(self, settings: Refinement) -> None:
        self._most = settings.max_shift_px
        aligned = LucasKanade(
            window_px=settings.window_px, extra_levels=settings.extra_levels, template=Template(settings.template)
        )
        self._patches = PatchFollower(aligned, lambda before, after, features: self._guess)
        self._guess = np.empty((0, 2))

    def refined(
        self, before: Frame, after: Frame, features: Features, uv: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Refined positions in an image, and how far each was moved, px, NaN where it stayed.

        `before`, `after`: the images of the latest positions, and of the new ones; `features`: all n that are alive,
        with their latest positions; `uv`: (n, 2) new positions, px, finite. Returns (n, 2) float64 and
        (n,) float32.
        """
        if not len(features):
            return uv, np.empty(0, dtype=np.float32)
        self._guess = uv
        flow = self._patches.follow(before, after, features)
        shift = displacement_px(uv, flow.uv)
        good = flow.found & (shift <= self._most)
        return np.where(good[:, None], flow.uv, uv), np.where(good, shift, np.nan).astype(np.float32)


class _Refining:
    """A follower whose positions are refined before they are judged, and before it goes on from them."""

    def __init__(self, follower: Follower, refiner: Refiner) -> None:
        self._follower, self._refiner = follower, refiner

    @property
    def quality_names(self) -> tuple[str, ...]:
        """Those of the follower, and the shift."""
        return (*self._follower.quality_names, SHIFT)

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where the features are in the next image."""
        flow = self._follower.follow(before, after, features)
        reported = np.where(flow.found[:, None], flow.uv, features.uv)
        uv, shift = self._refiner.refined(before, after, features, reported)
        return Flow(uv, flow.found, {**flow.quality, SHIFT: shift})
