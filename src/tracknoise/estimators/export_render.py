"""Exports of a noise model: converted to the px and frames of an estimator, and filled into its template.

The conversion has two rules:

- The focal length of the estimator must be that of the model, to `TOLERANCE`. Noise is measured in px of the images
  that the tracker saw. It scales with the focal length only if these images are resampled.
- The estimator must use as many frames per second as the tracker of the model saw, to `TOLERANCE`. Another rate has
  other motions between frames, and therefore other noise. The noise is known only if features are tracked in every
  frame and the estimator uses every n-th.

For an estimator that uses every n-th frame, white noise stays that of one frame, and the walks of the n frames between
two used frames add up. How much larger sigma must be is the same as in the linear benchmark, over a window of sideways
and one of forward motion.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from tracknoise.estimators import exports
from tracknoise.estimators.advice import ExportedModel
from tracknoise.estimators.exports import (
    Estimator,
    Export,
    FocalChange,
    Noise,
    RateChange,
    Target,
    estimator,
)
from tracknoise.estimators.linear_window import (
    CAMERA,
    EXACT,
    Motion,
    consistencies,
    linear_tracks,
    scalar_variances,
    simulated_tracks,
    trajectory,
    true_covariances,
)
from tracknoise.estimators.model import TOLERANCE, Component, Equivalent, Interval, KnownPoints, Landmark, Purpose
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import COMPONENTS, TrackNoise
from tracknoise.text import significant
from tracknoise.time_units import is_likely, likely_unit


def scaled_component(component: Component, scale: float) -> Component:
    """A component whose standard deviations are larger by a factor."""
    sigma = component.sigma.times(scale)
    return replace(component, covariance=component.covariance * scale**2, sigma=sigma)


def scaled_equivalent(equivalent: Equivalent, scale: float) -> Equivalent:
    """A sigma that is larger by a factor. Gates are ratios, and stay."""
    per_feature = _scaled_variance(equivalent.per_feature, scale)
    return replace(equivalent, sigma=equivalent.sigma.times(scale), per_feature=per_feature)


def _scaled_variance(variance: Interval | None, scale: float) -> Interval | None:
    return None if variance is None else variance.times(scale**2)


def _scaled_points(points: KnownPoints, scale: float) -> KnownPoints:
    knee_px = None if points.knee_px is None else scale * points.knee_px
    per_feature = _scaled_variance(points.per_feature, scale)
    return replace(points, knee_px=knee_px, sigma=points.sigma.times(scale), per_feature=per_feature)


_TRACKS = 40
"""Per window."""


def thinned(model: ExportedModel, n: int) -> tuple[Equivalent, ...]:
    """Return the sigmas of a model for windows of every n-th frame that its tracker saw.

    A first direction that is a state counts as exact where the model has no noise of the first position, and as free
    otherwise.
    """
    if not any(own.any() for one, own in zip(COMPONENTS, model.components, strict=True) if one.power):
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
        assumed = scalar_variances(window, 1.0, first=None if free else EXACT)
        found = consistencies(window, [true_covariances(window, noise) for noise in noises], assumed)
        for purpose, total in summed.items():
            total += [one[purpose] for one in found]
    return {purpose: float(total[1] / total[0]) for purpose, total in summed.items()}


def _grown(equivalent: Equivalent, growth: Mapping[Purpose, float]) -> Equivalent:
    """Sigma grows by the ratio of its purpose, and the sum of squares that a gate sees by that of innovations."""
    own = growth[equivalent.purpose]
    seen = growth[Purpose.INNOVATIONS] / own
    found = scaled_equivalent(equivalent, math.sqrt(own))
    good = None if found.gate_80 is None else found.gate_80 * seen
    return replace(found, gate_80=good, gate_95=found.gate_95 * seen, gate_99=found.gate_99 * seen)


_MOST_PX = 1e6
"""Longest side of an image."""


@dataclass(frozen=True, slots=True)
class Converted:
    """A noise model for an estimator."""

    # In px of its images. Walk and drift are those of one of its frames, and the rate of the camera is its own.
    model: ExportedModel
    caveats: tuple[str, ...]  # what was assumed, one sentence each


def converted(model: ExportedModel, target: Target) -> Converted:
    """Return the model in the px and frames of an estimator."""
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
        **{
            one.name: scaled_component(getattr(model, one.name), scale * steps ** (one.power / 2)) for one in COMPONENTS
        },
        equivalents=tuple(scaled_equivalent(one, scale) for one in _equivalents(model, thinning, caveats)),
        kernels=tuple(replace(one, knee_px=scale * one.knee_px) for one in model.kernels),
        gate_trial=model.gate_trial if thinning == 1 else None,
        known_points=tuple(_scaled_points(one, scale) for one in model.known_points if thinning == 1),
    )
    return Converted(found, tuple(caveats))


def _scale(model: ExportedModel, target: Target, caveats: list[str]) -> float:
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
            "`--allow lens` to use its px as they are"
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
            "`--allow resampled` if the images are the same in another size, "
            "`--allow lens` to use its px as they are"
        )


def _require_pixels(model: ExportedModel, ratio: float, focal: float) -> None:
    sides = [side * ratio for side in (model.camera.width, model.camera.height)]
    if not 1.0 <= min(sides) <= max(sides) <= _MOST_PX:
        shown = " x ".join(significant(side, 3) for side in sides)
        raise SettingsError(
            f"focal length is {focal:g} px, which makes images of {shown} px, expected one of real images"
        )


def _thinning(model: ExportedModel, target: Target, caveats: list[str]) -> int:
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
            f"{_unlikely_rate(model)}"
            "`--allow thinned` if features are tracked in every frame and the estimator uses every n-th; "
            "if the rate of the model is wrong, correct the times of its recordings and measure them again"
        )
    return _every(ratio, seen, target.rate_hz, caveats)


def _unlikely_rate(model: ExportedModel) -> str:
    """What is to be done about a rate of the recordings that no camera has; nothing where it is likely."""
    recorded = model.camera.rate_hz
    if recorded is None or is_likely(recorded):
        return ""
    likely = likely_unit(recorded)
    unit = "" if likely is None else f", probably {likely[0]} ({significant(likely[1], 3)} Hz)"
    return (
        f"the times of its recordings, at {significant(recorded, 3)} Hz, are probably not in seconds{unit}: "
        "measure them again with time_unit in [dataset.options]; "
    )


def _require_likely(model: ExportedModel, target: Target) -> None:
    """Refuse a rate that no camera has, unless the user states it."""
    if target.rate_hz is None and (unlikely := _unlikely_rate(model)):
        raise SettingsError(f"noise model: {unlikely}if the rate is right, --rate {_seen_rate(model):g}")


def _unchecked(target: Target, caveats: list[str]) -> int:
    if target.rate_change is not RateChange.UNCHECKED:
        raise SettingsError(
            f"rate is {target.rate_hz:g} Hz, expected none: the model does not know the rate of its recordings; "
            "`--allow unchecked` if that is the one"
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


def _equivalents(model: ExportedModel, thinning: int, caveats: list[str]) -> tuple[Equivalent, ...]:
    found = model.equivalents if thinning == 1 else thinned(model, thinning)
    if found != model.equivalents:
        caveats.append(
            f"The walk of {thinning} frames adds up between used frames. What this does to sigma is computed by the "
            "linear benchmark, for tracks that live as long as a window."
        )
    return found


def _seen_rate(model: ExportedModel) -> float | None:
    """Frames per second that the tracker of the model saw."""
    recorded = model.camera.rate_hz
    return None if recorded is None else recorded / model.training.speed


_SMALLEST, _LARGEST = 1e-6, 1e6
"""Rates, Hz, and focal lengths, px, that are none of a camera are beyond these."""


def _require_positive(name: str, value: float, unit: str) -> None:
    if not _SMALLEST <= value <= _LARGEST:
        raise SettingsError(f"{name} is {value:g} {unit}, expected a number from {_SMALLEST:g} to {_LARGEST:g}")


_DIGITS, _MORE_DIGITS = 3, 6


def export(
    model: ExportedModel,
    name: str,
    *,
    target: Target | None = None,
    source: str = "a noise model",
    observations: str | None = None,
) -> Export:
    """Write the noise of a model in the syntax of an estimator.

    Parameters
    ----------
    model
        What to write.
    name
        Of the estimator: see `tracknoise.estimators.exports.estimators`.
    target
        Camera, rate, window and purpose. By default, those of the model and what is usual for the estimator.
    source
        Name of the file of the model, for the first line of each file.
    observations
        Covariances of observations, CSV: what ``csv`` writes.

    Raises
    ------
    SettingsError
        If the estimator takes no noise of tracks, the focal length or the rate cannot be converted, or the estimator
        needs what is not given.
    UnknownNameError
        If the estimator is not known.
    """
    about, wanted = estimator(name), target or Target()
    at = converted(model, wanted)
    noise = Noise.of(at.model, about, wanted)
    camera = at.model.camera
    known = {"focal length": camera.focal_px, "rate": camera.rate_hz, "observations": observations}
    _require_known(about, known)
    if "rate" in about.needs:
        _require_likely(model, wanted)
    if about.family == "data" and at.caveats:
        raise SettingsError(f"{about.title}: found another focal length or rate, expected those of the model")
    header = exports.header(noise, source, model.sha256)
    values = {"noise": noise, "camera": camera, "model": model, "observations": observations}
    caveats = (*camera.notes, *at.caveats, *exports.caveats(about, noise))
    return Export(
        files={file: _filled(_headed(template, header), values) for file, template in about.files.items()},
        rate_hz=camera.rate_hz,
        text=exports.text(about, header, (*caveats, *about.notes)),
        patch=None if about.patch is None else _filled(_headed(about.patch, header), values),
        caveats=caveats,
    )


def _require_known(about: Estimator, known: Mapping[str, object]) -> None:
    expected = {
        "focal length": "that of its camera, with `--focal`",
        "rate": "frames per second, with `--rate`",
        "observations": "tracks, with `--tracks`",
    }
    for need in about.needs:
        if known[need] is None:
            raise SettingsError(f"{about.title}: no {need}, expected {expected[need]}")


_HEADER = re.compile(r"(?m)^(.*)\{\{ header \}\}(.*)$")
"""The line of a template that names the header, with the signs of a comment on both sides."""


def _headed(template: str, header: Sequence[str]) -> str:
    """A template with a comment for each line of the header, or one for all where the comment has to end."""

    def lines(found: re.Match[str]) -> str:
        before, after = found.groups()
        parts = ["; ".join(header)] if after else header
        return "\n".join(f"{before}{one}{after}" for one in parts)

    return _HEADER.sub(lines, template)


def _filled(template: str, values: Mapping[str, object]) -> str:
    return _environment().from_string(template).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("tracknoise.estimators", "shared"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: number(value) if isinstance(value, float) else value,
    )
    environment.globals |= {"code": {one.name: one.code for one in COMPONENTS}}
    environment.filters |= {"precise": _precise, "rows": _rows, "entries": _entries}
    return environment


def number(value: float, digits: int = _DIGITS) -> str:
    """Write a number as JSON, YAML, C++ and Python all read it, with a point: ``0.100``, ``1.00e-05``."""
    text = f"{value:#.{digits}g}"
    return f"{text}0" if text.endswith(".") else text


def _precise(value: float) -> str:
    """A number that is not measured, such as a focal length."""
    return number(value, _MORE_DIGITS)


def _rows(matrix: NDArray[np.float64]) -> str:
    """A matrix as a nested list, as Python has it."""
    return "[" + ", ".join(f"[{_entries(matrix[row])}]" for row in range(len(matrix))) + "]"


def _entries(matrix: NDArray[np.float64]) -> str:
    """All numbers of a matrix, row by row, with commas between them."""
    return ", ".join(map(_precise, matrix.ravel().tolist()))
