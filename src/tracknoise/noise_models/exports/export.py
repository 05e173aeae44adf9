"""What an export returns, and what it is asked for."""

from dataclasses import dataclass
from enum import StrEnum

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.model import Purpose

_SHORTEST = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """The noise of a model in the syntax of an estimator.

    Parameters
    ----------
    files
        Contents by name of the file.
    text
        What it is: unit, place, what it makes right, what it cannot express, and what it was checked against.
    patch
        Change of the source code of the estimator, None if there is none.
    caveats
        One sentence each.
    """

    files: dict[str, str]
    text: str
    patch: str | None
    caveats: tuple[str, ...]


class FocalChange(StrEnum):
    """Why the focal length of the estimator is not that of the model."""

    RESAMPLED = "resampled"
    """The images are the same, made smaller or larger: px scale with the focal length."""
    LENS = "lens"
    """The lens is another one: px stay as they are, without a measurement that says so."""


class RateChange(StrEnum):
    """Why the rate of the estimator is not that of the model."""

    THINNED = "thinned"
    """Features are tracked in every frame, and the estimator uses every n-th."""
    UNCHECKED = "unchecked"
    """The model does not know the rate of its recordings. It is taken to be the stated one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """The estimator's side.

    Parameters
    ----------
    focal_px
        Focal length of its images, px. By default, that of the model.
    rate_hz
        Frames that it uses per second. By default, those that the tracker of the model saw.
    focal_change, rate_change
        Why they differ from those of the model. They must not, if None.
    window, purpose
        Length of its window, frames, and what its sigma is to make right. By default, what is usual for the estimator.

    Raises
    ------
    SettingsError
        If the window has fewer than two frames, or a reason is given for a focal length or a rate that is not.
    """

    focal_px: float | None = None
    rate_hz: float | None = None
    focal_change: FocalChange | None = None
    rate_change: RateChange | None = None
    window: int | None = None
    purpose: Purpose | None = None

    def __post_init__(self) -> None:
        """Refuse a window without a second frame, and reasons for a difference that is not stated."""
        if self.window is not None and self.window < _SHORTEST:
            raise SettingsError(f"window of {self.window}, expected at least {_SHORTEST} frames")
        if self.focal_change is not None and self.focal_px is None:
            raise SettingsError(f"found no focal length, expected one because it may differ ({self.focal_change})")
        if self.rate_change is not None and self.rate_hz is None:
            raise SettingsError(f"found no rate, expected one because it may differ ({self.rate_change})")
