"""A noise model in the px and frames of an estimator.

Rules:

- The focal length of the estimator must be that of the model, to `TOLERANCE`. Noise is measured in px of the images
  that the tracker saw. It scales with the focal length only if these images are resampled.
- The estimator must use as many frames per second as the tracker of the model saw, to `TOLERANCE`. Another rate has
  other motions between frames, and therefore other noise. The noise is known only if features are tracked in every
  frame and the estimator uses every n-th: white noise stays, and the walk of n frames adds up.
"""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.exports.export import FocalChange, RateChange, Target
from tracknoise.noise_models.exports.scaling import scaled_component, scaled_equivalent
from tracknoise.noise_models.exports.thinning import thinned
from tracknoise.noise_models.model import TOLERANCE, Equivalent
from tracknoise.printable import significant

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

_MOST_PX = 1e6
"""Longest side of an image."""


@dataclass(frozen=True, slots=True)
class Converted:
    """A noise model for an estimator.

    Parameters
    ----------
    model
        In px of its images. Walk and drift are those of one of its frames, and the rate of the camera is its own.
    caveats
        What was assumed, one sentence each.
    """

    model: "NoiseModel"
    caveats: tuple[str, ...]


def converted(model: "NoiseModel", target: Target) -> Converted:
    """Return the model in the px and frames of an estimator.

    Raises
    ------
    SettingsError
        If the focal length or the rate is not a positive number, or is not that of the model and cannot be converted.
    """
    caveats: list[str] = []
    scale = _scale(model, target, caveats)
    thinning = _thinning(model, target, caveats)
    steps = float(model.training.speed) * thinning
    camera = replace(
        model.camera,
        width=round(model.camera.width * scale),
        height=round(model.camera.height * scale),
        focal_px=target.focal_px or model.camera.focal_px,
        rate_hz=target.rate_hz or _seen_rate(model),
    )
    found = replace(
        model,
        camera=camera,
        first=scaled_component(model.first, scale),
        white=scaled_component(model.white, scale),
        walk=scaled_component(model.walk, scale * math.sqrt(steps)),
        drift=scaled_component(model.drift, scale * steps),
        equivalents=tuple(scaled_equivalent(one, scale) for one in _equivalents(model, thinning, caveats)),
    )
    return Converted(found, tuple(caveats))


def _scale(model: "NoiseModel", target: Target, caveats: list[str]) -> float:
    """How much larger the images of the estimator are."""
    known = model.camera.focal_px
    if target.focal_px is None:
        return 1.0
    _require_positive("focal length", target.focal_px, "px")
    if target.focal_change is FocalChange.LENS:
        measured = "an unknown focal length" if known is None else f"a focal length of {known:g} px"
        caveats.append(f"The model was measured at {measured}. Its px are kept for another lens.")
        return 1.0
    if known is None:
        raise SettingsError(
            f"focal length is {target.focal_px:g} px, expected none: the model does not know that of its recordings; "
            "`--allow-focal lens` to use its px as they are"
        )
    ratio = target.focal_px / known
    if target.focal_change is None:
        _require_same_focal(ratio, target.focal_px, known)
        return 1.0
    _require_pixels(model, ratio, target.focal_px)
    caveats.append(
        f"The images are those of the model, resampled by {ratio:.3g}: px scale with them. A tracker that runs on "
        "resampled images has other noise. Measure it on them."
    )
    return ratio


def _require_same_focal(ratio: float, focal: float, known: float) -> None:
    if abs(ratio - 1.0) > TOLERANCE:
        raise SettingsError(
            f"focal length is {focal:g} px, expected that of the model, {known:g} px, to {100 * TOLERANCE:g} %; "
            "`--allow-focal resampled` if the images are the same in another size, "
            "`--allow-focal lens` to use its px as they are"
        )


def _require_pixels(model: "NoiseModel", ratio: float, focal: float) -> None:
    sides = [side * ratio for side in (model.camera.width, model.camera.height)]
    if not 1.0 <= min(sides) <= max(sides) <= _MOST_PX:
        shown = " x ".join(significant(side, 3) for side in sides)
        raise SettingsError(
            f"focal length is {focal:g} px, which makes images of {shown} px, expected one of real images"
        )


def _thinning(model: "NoiseModel", target: Target, caveats: list[str]) -> int:
    """How many frames of the tracker there are for one of the estimator."""
    if target.rate_hz is None:
        return 1
    _require_positive("rate", target.rate_hz, "Hz")
    seen = _seen_rate(model)
    if seen is None:
        return _unchecked(target, caveats)
    ratio = seen / target.rate_hz
    if abs(ratio - 1.0) <= TOLERANCE:
        return 1
    if target.rate_change is not RateChange.THINNED:
        raise SettingsError(
            f"rate is {target.rate_hz:g} Hz, expected that of the model, {seen:g} Hz, to {100 * TOLERANCE:g} %; "
            "`--allow-rate thinned` if features are tracked in every frame and the estimator uses every n-th"
        )
    return _every(ratio, seen, target.rate_hz, caveats)


def _unchecked(target: Target, caveats: list[str]) -> int:
    if target.rate_change is not RateChange.UNCHECKED:
        raise SettingsError(
            f"rate is {target.rate_hz:g} Hz, expected none: the model does not know the rate of its recordings; "
            "`--allow-rate unchecked` if that is the one"
        )
    caveats.append(f"The model does not know the rate of its recordings. It is taken to be {target.rate_hz:g} Hz.")
    return 1


def _every(ratio: float, seen: float, used: float, caveats: list[str]) -> int:
    """The whole number n of frames, if noise of every n-th frame is known."""
    n = round(ratio)
    if n < 1 or abs(ratio / n - 1.0) > TOLERANCE:
        raise SettingsError(f"rate is {used:g} Hz, expected {seen:g} Hz of the model over a whole number")
    caveats.append(f"Features are tracked in every frame, and one frame of {n} is used.")
    return n


def _equivalents(model: "NoiseModel", thinning: int, caveats: list[str]) -> tuple[Equivalent, ...]:
    found = model.equivalents if thinning == 1 else thinned(model, thinning)
    if found != model.equivalents:
        caveats.append(
            f"The walk of {thinning} frames adds up between used frames. What this does to sigma is computed by the "
            "linear benchmark, for tracks that live as long as a window."
        )
    return found


def _seen_rate(model: "NoiseModel") -> float | None:
    """Frames per second that the tracker of the model saw."""
    recorded = model.camera.rate_hz
    return None if recorded is None else recorded / model.training.speed


def _require_positive(name: str, value: float, unit: str) -> None:
    if not 0.0 < value < math.inf:
        raise SettingsError(f"{name} is {value:g} {unit}, expected a number above 0")
