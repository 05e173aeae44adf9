"""The noise of a model in the syntax of estimators: what templates can name, and what is said about an export.

Each estimator that noise can be exported to is a file in the folder `estimators`.
"""

import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache, partial
from importlib import resources
from importlib.metadata import version
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter

from tracknoise.checks import require_whole
from tracknoise.estimators.advice import (
    FEATURES,
    SHORTEST_WINDOW,
    Advice,
    ExportedModel,
    Gate,
    advise,
    observation_gate,
)
from tracknoise.estimators.model import BiasKind, Equivalent, Interval, Landmark, LossKind, Purpose
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.inference.track_noise import COMPONENTS, NAMES
from tracknoise.tables.enumerations import Trust
from tracknoise.text import counted, significant


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """The noise of a model in the syntax of an estimator."""

    files: dict[str, str]  # contents by name of the file
    text: str  # what it is: unit, place, what it makes right, what it cannot express, and what it was checked against
    patch: str | None  # change of the source code of the estimator, None if there is none
    caveats: tuple[str, ...]  # one sentence each
    rate_hz: float | None = None  # frames per second that its numbers are for; None where unknown


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

    Raises
    ------
    SettingsError
        If the window has fewer than two frames, a frame has no features, or a reason is given for a focal length or a
        rate that is not.
    """

    focal_px: float | None = None  # Focal length of its images, px. By default, that of the model.
    rate_hz: float | None = None  # Frames that it uses per second. By default, those that the tracker of the model saw.
    # focal_change, rate_change: Why they differ from those of the model. They must not, if None.
    focal_change: FocalChange | None = None
    rate_change: RateChange | None = None
    # window, features, purpose: Length of its window, frames, features of a frame, and what its sigma is to make right.
    # By default, what is usual for the estimator.
    window: int | None = None
    features: int | None = None
    purpose: Purpose | None = None

    def __post_init__(self) -> None:
        """Refuse a window without a second frame, and reasons for a difference that is not stated."""
        if self.window is not None:
            require_whole("window", self.window, SHORTEST_WINDOW)
        if self.features is not None:
            require_whole("features", self.features, 1)
        if self.focal_change is not None and self.focal_px is None:
            raise SettingsError(f"found no focal length, expected one because it may differ ({self.focal_change})")
        if self.rate_change is not None and self.rate_hz is None:
            raise SettingsError(f"found no rate, expected one because it may differ ({self.rate_change})")


def asked(settings: Mapping[str, Any], name: str) -> Target:
    """Window and features of an estimator, by the settings of an experiment; as shipped where it names another one."""
    stated = settings.get("estimator", {})
    return (
        Target(window=stated.get("window"), features=stated.get("features")) if stated.get("name") == name else Target()
    )


LEAST_PX = 0.01
"""What is written for a component that is zero, px: estimators divide by it."""
_GOOD_TRACKS = 0.999
"""Share of good tracks that pass a bound on their largest residual."""


@dataclass(frozen=True, slots=True)
class Noise:
    """The noise of a model, as an estimator uses it. Templates call it `noise`."""

    model: ExportedModel  # in px and frames of the estimator
    about: "Estimator"  # the estimator
    window: int  # length of its window, frames
    set_to: Advice | None  # what to set; None if it takes the components themselves

    @classmethod
    def of(cls, model: ExportedModel, about: "Estimator", target: Target) -> "Noise":
        """The noise of a model for an estimator.

        Raises
        ------
        SettingsError
            If the model has no such sigma.
        """
        wanted, window = about.purpose and (target.purpose or about.purpose), target.window
        found = None if wanted is None else about.advise(model, window=window, features=target.features, purpose=wanted)
        return cls(model, about, window or about.window, found)

    @property
    def advice(self) -> Advice:
        """What to set."""
        assert self.set_to is not None, f"{self.about.title} takes the components"
        return self.set_to

    @property
    def sigma(self) -> float:
        """Standard deviation, px; with a robust loss, the one that belongs to it."""
        return self.advice.sigma.value

    @property
    def state(self) -> Advice:
        """What to set for features in the state."""
        found = self.advice.state
        assert found is not None, f"{self.about.title} has one sigma for all features"
        return found

    @property
    def plain_sigma(self) -> float:
        """Standard deviation without a robust loss, px."""
        without = replace(self.about, kernel=None)
        features, purpose = self.advice.features, self.advice.purpose
        return without.advise(self.model, window=self.window, features=features, purpose=purpose).sigma.value

    @property
    def gate(self) -> float:
        """Factor on the chi-square gate of a track at .95, with `sigma`."""
        return self.advice.gates[Gate.TRACK]

    @property
    def observation_gate(self) -> float:
        """Factor on the chi-square gate of one observation at .95, with `sigma`."""
        return self.advice.gates[Gate.OBSERVATION]

    def observation_gate_with(self, sigma: float, level: float) -> float:
        """The same with another standard deviation, px, at another level."""
        return observation_gate(self.model, self._innovations.sigma.value, sigma, level)

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
    def components(self) -> list[tuple[str, NDArray[np.float64]]]:
        """Names and covariances, (2, 2) float64: those of `_FLOORED` are invertible, others may be zero."""
        known = zip(NAMES, self.model.components, strict=True)
        return [(name, invertible(own) if name in _FLOORED else own) for name, own in known]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(2, 2) float64, px^2, of one observation: its mean variance is that of `sigma`.

        Its shape is that of an observation in the middle of a window.
        """
        age = (self.window - 1) / 2.0
        total = sum(age**one.power * own for one, (_, own) in zip(COMPONENTS, self.components, strict=True))
        return np.asarray(self.sigma**2 * total / (np.trace(total) / 2.0))

    @property
    def stereo_covariance(self) -> NDArray[np.float64]:
        """(3, 3) float64, px^2, of u in the first camera, u in the second, and v, which both have in common."""
        both = self.model.of_both
        assert both is not None, "the model is of two cameras"
        variance = (self.plain_sigma * both.correlated_ratio) ** 2
        return variance * np.array([[1.0, both.correlation, 0.0], [both.correlation, 1.0, 0.0], [0.0, 0.0, 1.0]])

    @property
    def knee_px(self) -> float:
        """Knee of the robust loss, px."""
        knee = self.advice.knee_px
        assert knee is not None, f"{self.about.title} has no robust loss"
        return knee

    @property
    def knee(self) -> float:
        """Knee of the robust loss, in units of `sigma`."""
        return self.knee_px / self.sigma

    @property
    def largest_residual(self) -> float:
        """Bound on the lengths of all residuals of a track, px: one of 1000 good tracks exceeds it.

        For Gaussian errors, widened by what the gate shows of their tails.
        """
        longest = math.sqrt(-2.0 * math.log1p(-(_GOOD_TRACKS ** (1.0 / self.window))))
        return self._innovations.sigma.value * longest * math.sqrt(self._innovations.gate_99)

    @property
    def longer_side(self) -> int:
        """Longer side of the image, px."""
        return max(self.model.camera.width, self.model.camera.height)

    @property
    def _innovations(self) -> Equivalent:
        """The sigma that residuals have."""
        return self.model.equivalent(landmark=self.about.landmark, window=self.window, purpose=Purpose.INNOVATIONS)


def invertible(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariances (..., 2, 2) px^2, with variances not below the square of `LEAST_PX` in any direction."""
    variances, axes = np.linalg.eigh(covariances)
    return np.asarray((axes * np.maximum(variances, LEAST_PX**2)[..., None, :]) @ np.swapaxes(axes, -1, -2))


_ROOM = "tracknoise.estimators"
FAMILIES: Mapping[str, str] = {
    "kinds": "Kinds of estimators",
    "filters": "Filters",
    "smoothers": "Smoothers and visual SLAM",
    "maps": "Mapping and structure from motion",
    "libraries": "Libraries",
    "data": "Data",
}
"""Kinds of estimators and their titles, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator:
    """An estimator, and how its noise is written."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    # title, family: its name in text, and a key of `FAMILIES`
    title: str
    family: str
    # unit, place: of what is written: phrases
    unit: str
    place: str
    landmark: Landmark  # how it uses the first observation of a track
    cannot: tuple[str, ...]  # what it cannot express: phrases
    # files, patch: Templates of the files by name, and of a change of its source code. See `template_values`.
    files: Mapping[str, str]
    # purpose, window: What its sigma makes right by default, and the length of its window as shipped, frames. The
    # purpose is None where the components of the model are written themselves.
    purpose: Purpose | None = None
    window: int = 11
    # Whether it has an inertial sensor: then features count as independent, unless their number is stated.
    inertial: bool = False
    # kernel, knee: its robust loss, and the knee in sigmas where it cannot be set
    kernel: LossKind | None = None
    knee: float | None = None
    gates: tuple[Gate, ...] = ()  # its chi-square tests that can be set
    # Frames that features in its state live for, where these have a sigma and a gate of their own.
    state_window: int | None = None
    needs: tuple[str, ...] = ()  # what must be known: ``focal length``, ``rate``, ``observations``
    without_effect: tuple[str, ...] = ()  # keys that look right and do nothing, or something else: sentences
    notes: tuple[str, ...] = ()  # sentences
    # repositories and commits whose source code was read, or packages that were run
    checked_against: tuple[str, ...] = ()
    patch: str | None = None
    aliases: tuple[str, ...] = ()  # other names: of programs that are written for alike, and names that are in use

    def advise(
        self,
        model: ExportedModel,
        *,
        window: int | None = None,
        features: int | None = None,
        purpose: Purpose | None = None,
    ) -> Advice:
        """What to set; by default for its window, `FEATURES` features of a frame where they count, and its purpose.

        Raises
        ------
        SettingsError
            If it takes the components of a model, not one sigma, or the model has no such sigma.
        """
        wanted = purpose or self.purpose
        if wanted is None:
            name = next(name for name, about in estimators().items() if about.title == self.title)
            instead = f"`tracknoise export MODEL --to {name}`, which writes the components"
            raise SettingsError(f"{self.title} takes no single sigma, expected {instead}")
        of_purpose = partial(
            advise,
            model,
            landmark=self.landmark,
            purpose=wanted,
            features=features or (None if self.inertial else FEATURES),
            kernel=self.kernel,
            knee=self.knee,
        )
        found = of_purpose(window=self.window if window is None else window, gates=self.gates)
        if self.state_window is None:
            return found
        return replace(found, state=of_purpose(window=self.state_window, gates=[Gate.OBSERVATION]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """An estimator that noise of tracks cannot be exported to, and why not."""

    title: str
    why: str
    aliases: tuple[str, ...] = ()


@cache
def estimators() -> Mapping[str, Estimator]:
    """All estimators by name, in the order of their families."""
    folder = resources.files(_ROOM) / "syntaxes"
    texts = {file.name.removesuffix(".toml"): file.read_text(encoding="utf-8") for file in folder.iterdir()}
    read = TypeAdapter(Estimator)
    found = {name: read.validate_python(tomllib.loads(text)) for name, text in texts.items()}
    order = list(FAMILIES)
    return dict(sorted(found.items(), key=lambda item: (order.index(item[1].family), item[0])))


@cache
def refused() -> Mapping[str, Refused]:
    """Estimators without an export, by name."""
    text = (resources.files(_ROOM) / "refused.toml").read_text(encoding="utf-8")
    return {name: TypeAdapter(Refused).validate_python(fields) for name, fields in tomllib.loads(text).items()}


def estimator(name: object) -> Estimator:
    """Return an estimator by its name: see `estimator_name`."""
    return estimators()[estimator_name(name)]


def estimator_name(name: object) -> str:
    """Return the name under which an estimator is known. Case and the signs between words do not matter.

    Parameters
    ----------
    name
        Its name or one of its aliases: ``orbslam3``, ``ORB-SLAM3`` and ``orb-slam2`` are one.

    Raises
    ------
    SettingsError
        If its noise cannot be exported, with the reason.
    UnknownNameError
        If it is not known.
    """
    known = _names().get(_plain(name)) if isinstance(name, str) else None
    if known is None:
        listed = {one: about.aliases for one, about in estimators().items()}
        raise UnknownNameError("estimator", name, [*listed, *chain.from_iterable(listed.values())], {})
    if known in refused():
        raise SettingsError(f"{refused()[known].title}: {refused()[known].why}")
    return known


@cache
def _names() -> Mapping[str, str]:
    """The name of every estimator by its names and aliases, each without signs and capitals."""
    every: Mapping[str, Estimator | Refused] = {**refused(), **estimators()}
    return {_plain(alias): name for name, about in every.items() for alias in (name, *about.aliases)}


def _plain(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()


PURPOSES: Mapping[Purpose, str] = {
    Purpose.INNOVATIONS: "the size of innovations",
    Purpose.ALL_POSES: "the covariance of all poses on average",
    Purpose.NEWEST_POSE: "the covariance of the newest pose",
}
"""What a sigma makes right."""
LANDMARKS: Mapping[Landmark, str] = {
    Landmark.FREE: "the point is solved for, and the first observation has a residual",
    Landmark.EXACT: "the first observation is taken as true",
    Landmark.STATE: "the first direction is a state with a prior",
    Landmark.KNOWN: "the point is known, from a map or a depth image",
}
"""How an estimator uses the first observation of a track."""
_DIGITS_OF_HASH = 12
_TRACK = "track_covariance."
"""In templates that include the covariance of a track, with all components."""


def is_of(text: str, sha256: str) -> bool:
    """Whether a file that an export wrote, with its `header`, is of the model of this checksum."""
    return hash_text(sha256) in text


def hash_text(sha256: str) -> str:
    """The beginning of the checksum of a model, as exports name it."""
    return f"sha256 {sha256[:_DIGITS_OF_HASH]}"


def header(noise: Noise, source: str, sha256: str) -> tuple[str, ...]:
    """Write the first lines of a file: tool, model, tracker, and what is right. They can stand in a comment.

    The verdict on the truth is among them where its errors are in the numbers.
    """
    training, truth = noise.model.training, noise.model.truth
    rate = f", {noise.model.camera.rate_hz:.6g} frames per second" if "rate" in noise.about.needs else ""
    lines = [
        f"tracknoise {version('tracknoise')}: {source} {hash_text(sha256)}",
        f"{training.tracker} at speed {training.speed:g} on {training.dataset}{rate}",
        *makes_right(noise),
        *([] if truth.verdict is Trust.trusted else [truth.caveat]),
    ]
    return tuple(map(in_comment, lines))


def in_comment(line: str) -> str:
    """A line without signs that could end a comment, in any of the syntaxes."""
    return re.sub(r"--+", "-", re.sub(r"[^\w .,:;()/+=%@-]", "_", line))


def makes_right(noise: Noise) -> Iterator[str]:
    """Write which numbers are used, with intervals, and what they make right, in lines."""
    if noise.set_to is None:
        written = dict.fromkeys(_floored(noise.about, noise), f", written as {LEAST_PX:g} px")
        parts = [
            f"{one.phrase} {_px(getattr(noise.model, one.name).sigma)}{written.get(one.name, '')}"
            for one in COMPONENTS
            if _is_written(noise.about, one.name)
        ]
        yield f"components of the model: {', '.join(parts)}"
        return
    is_bound = not noise.model.truth.is_usable
    yield from _lines(noise.advice, is_bound=is_bound)
    if is_bound:
        yield "sigma includes errors of the truth: the tracker alone has less"


def in_words(advice: Advice, *, is_bound: bool = False) -> str:
    """Write what to set, and what it makes right, in one line. `is_bound`: whether sigma is at most this."""
    numbers, right, *state = _lines(advice, is_bound=is_bound)
    return "; ".join([f"{numbers}: {right}", *state])


def _lines(advice: Advice, *, is_bound: bool) -> Iterator[str]:
    """What to set, what it makes right, and what to set for features in the state where that is something else."""
    most = "at most " if is_bound else ""
    yield _numbers(advice, most)
    yield f"right for {right_for(advice)}, in {windows_of(advice)}"
    if advice.state is not None:
        yield f"features in the state: {_numbers(advice.state, most)}, in {windows_of(advice.state)}"


def right_for(advice: Advice) -> str:
    """Write what a sigma makes right: with a gate, only where nothing is rejected."""
    return f"{PURPOSES[advice.purpose]}{' where the gates reject nothing' if advice.every_gate else ''}"


def windows_of(advice: Advice) -> str:
    """Write in which windows a sigma is right."""
    return windows_text(advice.landmark, advice.window, advice.features, simulated=advice.simulated)


def windows_text(landmark: str, window: int, features: int | None, *, simulated: bool = False) -> str:
    """Write the same of an advice in a table."""
    of_features = "" if features is None else f" with {features} features per frame"
    if landmark == Landmark.KNOWN:
        return f"frames that see points at ages 1 to {window}{of_features}"
    return f"{'simulated ' if simulated else ''}windows of {window} frames{of_features}"


def short_tracks(lifetime: int | None, window: int) -> str:
    """A sentence where half of the tracks live less than half of a window; else empty.

    `lifetime`: their median lifetime, frames of the tracker; None where it is not known.
    """
    if lifetime is None or 2 * lifetime >= window:
        return ""
    return f"Half of its tracks live at most {counted(lifetime, 'frame')}."


def _numbers(advice: Advice, most: str) -> str:
    """Sigma, loss and gates."""
    parts = [f"sigma {most}{_px(advice.sigma)}"]
    if advice.kernel is not None and advice.knee is not None:
        untried = " (not tried)" if advice.is_without_trial else ""
        parts.append(f"{advice.kernel.title()} loss at {advice.knee:.3g} sigma{untried}")
    parts += [f"{gate} gate {factor:.3g} x chi2(.95)" for gate, factor in advice.gates.items()]
    return ", ".join(parts)


def caveats(about: Estimator, noise: Noise) -> tuple[str, ...]:
    """Sentences on what the export does not express, and on what the model knows of that."""
    cannot = [f"Cannot be expressed: {'; '.join(about.cannot)}."] if about.cannot else []
    return (*cannot, *about.without_effect, *_of_model(noise), *_of_floors(about, noise))


def text(about: Estimator, first_lines: Iterable[str], sentences: Iterable[str]) -> str:
    """Write the text of an export: what it is, with its caveats."""
    parts = {
        "Unit": about.unit,
        "Where": about.place,
        "First observation": LANDMARKS[about.landmark],
        "Checked against": ", ".join(about.checked_against),
    }
    lines = [about.title, *first_lines, "", *(f"{name}: {value}" for name, value in parts.items() if value), ""]
    return "\n".join([*lines, *(f"- {sentence}" for sentence in sentences)]) + "\n"


def _of_model(noise: Noise) -> Iterator[str]:
    if noise.set_to is not None:
        yield from _of_advice(noise)
    if noise.model.truth.verdict is not Trust.trusted:
        yield noise.model.truth.sentence
    yield from of_common(noise.model, noise.about, noise.set_to)
    if noise.model.bias.kind in (BiasKind.BY_AGE, BiasKind.ALONG_MOTION):
        yield "The model has a bias: correct the pixels before the estimator gets them."
        yield "Sigma has this bias in it, as if it differed from track to track: after the correction it is too large."


def of_common(model: ExportedModel, about: Estimator, advice: Advice | None) -> Iterator[str]:
    """Sentences on what does not average out over the features of a frame, and whether sigma counts it."""
    share = model.common_share
    if share is not None:
        known = (share.value, share.low, share.high)
        value, *bounds = (significant(100.0 * one, 2) for one in known if one is not None)
        interval = f" ({' to '.join(bounds)})" if len(bounds) == 2 else ""
        yield f"Errors in common of all features of a frame are {value} %{interval} of the variance."
    if advice is not None and advice.features is not None:
        yield f"Sigma is for {advice.features} features per frame. It grows with their number."
    elif advice is not None:
        yield f"Sigma takes features as independent: {_why_independent(model, about)}."
    elif share is not None and share.low:
        yield "With many features, claimed covariances are too small."


def _why_independent(model: ExportedModel, about: Estimator) -> str:
    if model.common_share is None:
        return "whether they have errors in common is unknown"
    if not model.common_share.low:
        return "a share above 0 is not established"
    if model.truth.verdict is not Trust.trusted:
        return "errors in common may be errors of the truth"
    if about.inertial:
        return "with an inertial sensor, errors in common did not change the NEES in trials"
    return "the effect of errors in common on sigma was not computed"


def _of_advice(noise: Noise) -> Iterator[str]:
    """What sigma, gates and loss rest on, and what they risk."""
    model, advice = noise.model, noise.advice
    yield from of_both(model)
    if advice.simulated:
        yield f"Windows are simulated: no recording has {advice.window} successive frames with motion."
    if lived := short_tracks(model.training.median_lifetime, advice.window):
        yield lived
    if advice.kernel is not None and advice.windows:
        yield (
            f"Sigma and loss belong together. In trials on {advice.windows} windows, they made "
            f"{PURPOSES[advice.purpose]} right. Without the loss, sigma is {significant(noise.plain_sigma, 3)} px."
        )
    elif advice.landmark is Landmark.KNOWN and advice.sigma.low is None:
        yield "Sigma has no interval: an interval needs six scenes with sampled tracks."
    elif advice.is_without_trial:
        yield "The loss was not tried: a trial needs enough tracks of a scene at the lowest speed of a run."
        yield "Sigma is the one without a loss. With a loss, a smaller sigma is usually right."
    if Gate.TRACK in advice.gates:
        yield "The track gate passes 80 % of good tracks at true poses. A gate for 95 % gave no better positions."
    yield from _of_gate(advice)


def of_both(model: ExportedModel) -> Iterator[str]:
    """That sigma is for positions in two cameras, and what the second one gains; nothing of a tracker of one camera."""
    both = model.of_both
    if both is None:
        return
    position, rotation = map(_bounded, (both.position_ratio, both.rotation_ratio))
    yield (
        "Sigma is for positions in both cameras, taken as independent. It counts that their errors have a correlation "
        f"of {both.correlation:.2g}."
    )
    yield (
        f"With both cameras, errors of the newest position are {position} times those with the first alone, where the "
        f"scale is known. Errors of the newest rotation are {rotation} times those with the first alone."
    )


def _of_gate(advice: Advice) -> Iterator[str]:
    """What its gate does to the covariance that an estimator claims."""
    if advice.gated is not None:
        found = advice.gated
        yield (
            f"With this track gate, the NEES of the newest pose was {_bounded(found.nees)}. The trial had "
            f"{found.windows} windows of {found.window} frames with tracks of the run. A NEES of 1 is right; below 1, "
            "poses are claimed too uncertain."
        )
    elif advice.every_gate:
        yield "Whether sigma is right with the gate was not tried: tracks that pass it have smaller errors than all."


def _bounded(interval: Interval) -> str:
    """A number without a unit, with its interval."""
    value, *bounds = (None if one is None else f"{one:.2g}" for one in (interval.value, interval.low, interval.high))
    return f"{value} ({bounds[0]} to {bounds[1]})" if None not in bounds else str(value)


def _of_floors(about: Estimator, noise: Noise) -> Iterator[str]:
    """What is written for components that are too small, where the templates name them."""
    for name in _floored(about, noise):
        component, phrase = getattr(noise.model, name), _FLOORED[name]
        if component.covariance.any():
            yield (
                f"The model has {component.sigma.value:.3g} px noise of {phrase}. In directions with less than "
                f"{LEAST_PX:g} px, {LEAST_PX:g} px are written instead."
            )
        else:
            yield f"The model has no noise of {phrase}: {LEAST_PX:g} px are written instead of zero."


_FLOORED = {"first": "a first position", "white": "a single frame"}


def _floored(about: Estimator, noise: Noise) -> list[str]:
    """Components in place of which the templates write `LEAST_PX`, at least in one direction."""

    def is_floored(name: str) -> bool:
        found = getattr(noise.model, name)
        if _TRACK in _templates(about):
            return bool(np.linalg.eigvalsh(found.covariance)[0] < LEAST_PX**2)
        return f"noise.{name}" in _templates(about) and found.sigma.value < LEAST_PX

    return [name for name in _FLOORED if is_floored(name)]


def _is_written(about: Estimator, name: str) -> bool:
    """Whether an export writes a component, or what is made of all of them."""
    return about.family == "data" or _TRACK in _templates(about) or f"noise.{name}" in _templates(about)


def _templates(about: Estimator) -> str:
    return " ".join((*about.files.values(), about.patch or ""))


def _px(interval: Interval) -> str:
    bounds = "" if interval.low is None or interval.high is None else f" ({interval.low:.3g} to {interval.high:.3g})"
    return f"{interval.value:.3g} px{bounds}"
