"""What is said about an export: its first line, its caveats and its text."""

import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version

from tracknoise.noise_models.exports.estimators import Estimator
from tracknoise.noise_models.exports.noise import LEAST_PX, Noise
from tracknoise.noise_models.model import BiasKind, Interval, Landmark, Purpose

PURPOSES: Mapping[Purpose, str] = {
    Purpose.INNOVATIONS: "the size of residuals and innovations",
    Purpose.ALL_POSES: "the covariance of all poses on average",
    Purpose.NEWEST_POSE: "the covariance of the newest pose",
    Purpose.DEPTH: "the covariance of the depth of points",
}
"""What a sigma makes right."""
LANDMARKS: Mapping[Landmark, str] = {
    Landmark.FREE: "the point is solved for, and the first observation has a residual",
    Landmark.EXACT: "the first observation is taken as true",
    Landmark.STATE: "the first direction is a state with a prior",
}
"""How an estimator uses the first observation of a track."""
_DIGITS_OF_HASH = 12
_TRACK = "track_covariance."
"""In templates that include the covariance of a track, with all components."""
_DIFFERENT = 1.02
"""Ratio from which on the sigmas of two purposes are stated as different."""


def header(noise: Noise, source: str, sha256: str) -> str:
    """Write the first line of a file: tool, model, tracker, and what is right. It can stand in a comment.

    Parameters
    ----------
    noise
        What is written.
    source, sha256
        Name and hash of the file of the model.
    """
    training = noise.model.training
    parts = [
        f"tracknoise {version('tracknoise')}",
        f"{source} sha256 {sha256[:_DIGITS_OF_HASH]}",
        f"{training.tracker} at speed {training.speed:g} on {training.dataset}",
        makes_right(noise),
    ]
    return in_comment("; ".join(parts))


def in_comment(line: str) -> str:
    """A line without signs that could end a comment, in any of the syntaxes."""
    return re.sub(r"--+", "-", re.sub(r"[^\w .,:;()/+=%@-]", "_", line))


def makes_right(noise: Noise) -> str:
    """Write which numbers are used, with intervals, and what they make right."""
    if noise.purpose is None:
        parts = {"first position": noise.model.first, "each frame": noise.model.white, "walk": noise.model.walk}
        return "components of the model: " + ", ".join(f"{name} {_px(one.sigma)}" for name, one in parts.items())
    used = noise.equivalent()
    return f"sigma {_px(used.sigma)}: right for {PURPOSES[noise.purpose]}, in windows of {used.window} frames"


def caveats(about: Estimator, noise: Noise) -> tuple[str, ...]:
    """Sentences on what the export does not express, and on what the model knows of that."""
    cannot = [f"Cannot be expressed: {'; '.join(about.cannot)}."] if about.cannot else []
    return (*cannot, *about.without_effect, *_of_model(noise), *_of_zeros(about, noise))


def text(about: Estimator, first_line: str, sentences: Iterable[str]) -> str:
    """Write the text of an export: what it is, with its caveats."""
    parts = {
        "Unit": about.unit,
        "Where": about.place,
        "First observation": LANDMARKS[about.landmark],
        "Checked against": ", ".join(about.checked_against),
    }
    lines = [about.title, first_line, "", *(f"{name}: {value}" for name, value in parts.items() if value), ""]
    return "\n".join([*lines, *(f"- {sentence}" for sentence in sentences)]) + "\n"


def _of_model(noise: Noise) -> Iterator[str]:
    if noise.purpose is not None and (others := ", ".join(_other_sigmas(noise))):
        yield f"One sigma does not make everything right. This model has {others}."
    if noise.model.bias.kind in (BiasKind.BY_AGE, BiasKind.ALONG_MOTION):
        yield "The model has a bias: correct the pixels before the estimator gets them."


def _of_zeros(about: Estimator, noise: Noise) -> Iterator[str]:
    """What is written for components that are zero, where the templates name them."""
    templates = " ".join((*about.files.values(), about.patch or ""))
    named = {"first": "a first position", "white": "a single frame"}
    for name, phrase in named.items():
        is_written = f"noise.{name}" in templates or _TRACK in templates
        if is_written and not getattr(noise.model, name).covariance.any():
            yield f"The model has no noise of {phrase}: {LEAST_PX:g} px are written instead of zero."


def _other_sigmas(noise: Noise) -> Iterator[str]:
    """The sigmas of other purposes, for the same window, where they differ."""
    used = noise.equivalent()
    for other in noise.model.equivalents:
        same = (other.landmark, other.window) == (used.landmark, used.window)
        ratio = other.sigma.value / used.sigma.value
        if same and not 1.0 / _DIFFERENT < ratio < _DIFFERENT:
            yield f"{other.sigma.value:.3g} px for {PURPOSES[other.purpose]}"


def _px(interval: Interval) -> str:
    bounds = "" if interval.low is None or interval.high is None else f" ({interval.low:.3g} to {interval.high:.3g})"
    return f"{interval.value:.3g} px{bounds}"
