"""The noise model of one tracker at one speed: what an estimator asks it, and its file."""

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, TypeAdapter, ValidationError
from scipy import linalg

from tracknoise.checks import Share, path_of, require_bounds, require_list, require_whole
from tracknoise.estimators.advice import SHORTEST_WINDOW, Advice
from tracknoise.estimators.export_render import export
from tracknoise.estimators.exports import Export, Target
from tracknoise.estimators.exports import estimator as estimator_of
from tracknoise.estimators.fit import fitted_fields
from tracknoise.estimators.model import (
    Bias,
    CameraOfModel,
    Component,
    Equivalent,
    Factor,
    Interval,
    Kernel,
    KnownPoints,
    Landmark,
    OfBoth,
    Pixels,
    Purpose,
    Tails,
    TrackScale,
    Training,
    TriedGate,
    corrected,
    factor_of,
    numbers,
    of_one_length,
)
from tracknoise.estimators.training import training_tables
from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.foreign_files import MIB, read_text
from tracknoise.inference.track_noise import (
    NAMES,
    Reference,
    TrackNoise,
    change_covariances,
    error_covariances,
    track_covariance,
)
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

FORMAT = "tracknoise.noise/2"
_EARLIER = ("tracknoise.noise/1",)
"""Formats whose documents lack fields that may be missing."""
_GONE = "depth"
"""A purpose of equivalents in earlier formats. Depths are those of the table `window_sigmas` of a run."""
_WHERE_KNOWN = ("of_both",)
"""Fields that a document has only where they are known."""
_KEY, _EXPECTED = "format", "a noise model, as `tracknoise export --model` writes it"

_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def document_schema(kind: "type[NoiseModel]") -> str:
    """JSON Schema of the document, as text."""
    schema = _adapter(kind).json_schema()
    schema["properties"] = {_KEY: {"const": FORMAT, "title": "Format"}, **schema["properties"]}
    schema["required"] = [_KEY, *schema["required"]]
    return json.dumps(schema, indent=2) + "\n"


def _fields(path: Path, text: str) -> dict[str, object]:
    try:
        document = json.loads(text)
        json.dumps(document, ensure_ascii=False).encode()  # half of a pair of surrogates is no text
    except (ValueError, RecursionError) as error:  # thousands of brackets
        raise DataError(path, f"is not JSON ({error})", _EXPECTED) from error
    if not isinstance(document, dict) or document.get(_KEY) not in (FORMAT, *_EARLIER):
        found = document.get(_KEY) if isinstance(document, dict) else None
        raise DataError(path, f"format is {found!r}", f"{FORMAT!r}")
    if document[_KEY] in _EARLIER and isinstance(known := document.get("equivalents"), list):
        document["equivalents"] = [one for one in known if not (isinstance(one, dict) and one.get("purpose") == _GONE)]
    return {name: value for name, value in document.items() if name != _KEY}


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]}..."


_Kind = TypeVar("_Kind", bound=StrEnum)


@lru_cache(maxsize=8)
def _text_of(model: "NoiseModel") -> str:
    """The document of a model, JSON. All exports of a report name its hash."""
    fields = _adapter(NoiseModel).dump_python(model, mode="json")
    known = {name: value for name, value in fields.items() if value is not None or name not in _WHERE_KNOWN}
    return json.dumps({_KEY: FORMAT, **known}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseModel:
    """Noise of the tracks of one tracker at one speed.

    Parameters
    ----------
    training, camera
        What it was fitted to.
    first, white, walk, drift
        A, W, Q and D of (noise_model.error), by second moments: those of `covariance`, `track_covariance` and `whiten`.
    tails
        Student t of the errors, with the outliers.
    outlier_share, outliers_beyond_px
        Share of the observations that the components do not describe, because their errors exceed this.
    bias
        Mean error.
    conditions
        Factors on white noise and walk. They multiply.
    track_scale
        The same noise with a scale of its own for each track, by the likelihood of whole tracks; None where the run has
        no sample of tracks.
    common_share
        Share of the variance that all features of a frame have in common, with its interval; None if unknown.
    truth_floor_px
        Root mean square error of the true positions at the ages that were fitted; None if unknown.
    truth
        The verdict on the truth of the run. Errors of the truth are part of the noise.
    equivalents
        Standard deviations for all observations, named by what they make right.
    kernels
        Robust losses that were tried on sampled tracks of the run; none at speeds without a sample.
    gate_trial
        What the gate of a filter does, tried on the same tracks; None without a sample.
    known_points
        Sigmas for one pose from known points, from the same tracks.
    of_both
        What positions in two cameras are to an estimator, of a tracker of a second camera: then equivalents, kernels,
        gate_trial and known_points are for the positions in both. None of others.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)  # unknown keys are refused

    training: Training
    camera: CameraOfModel
    first: Component
    white: Component
    walk: Component
    drift: Component
    tails: Tails
    outlier_share: Share
    outliers_beyond_px: Pixels
    bias: Bias
    conditions: tuple[Factor, ...] = ()
    track_scale: TrackScale | None = None
    common_share: Interval | None = None
    truth_floor_px: Pixels | None = None
    truth: TruthVerdict = field(default_factory=TruthVerdict)
    equivalents: tuple[Equivalent, ...] = ()
    kernels: tuple[Kernel, ...] = ()
    gate_trial: TriedGate | None = None
    known_points: tuple[KnownPoints, ...] = ()
    of_both: OfBoth | None = None

    def __post_init__(self) -> None:
        """Refuse shares and lengths that no noise has."""
        require_bounds(self)
        if self.common_share is not None:
            self.common_share.require_within("common_share", ge=0.0, le=1.0)

    @classmethod
    def fit(
        cls, run: str | Path, *, tracker: str, speed: int = 1, scenes: Collection[str] | None = None
    ) -> "NoiseModel":
        """Fit a model to a finished run.

        Parameters
        ----------
        run
            Its folder.
        tracker, speed
            As in the run.
        scenes
            Names of the scenes; by default all. What a model is checked on should be others.

        Raises
        ------
        UnknownNameError
            If the run has no such tracker or scene.
        SettingsError
            If it has no such speed, no scene is named, an argument has a wrong type, or there are too few errors.
        StoreError, SchemaError
            If there is no finished run, or it does not hold what models are fitted to.
        """
        require_whole("speed", speed, 1)
        if scenes is not None:
            require_list("scenes", scenes, "names")
        folder = RunFolder(path_of("run", run))
        return cls(**fitted_fields(training_tables(folder, tracker=tracker, speed=speed, scenes=scenes)))

    def equivalent(self, *, landmark: Landmark, window: int, purpose: Purpose) -> Equivalent:
        """The standard deviation for a kind of estimator and a purpose, of the window that is nearest in length.

        Raises
        ------
        SettingsError
            If the model has none of this kind, or the window is no whole number of at least 2 frames.
        """
        require_whole("window", window, SHORTEST_WINDOW)
        known = [one for one in self.equivalents if (one.landmark, one.purpose) == (landmark, purpose)]
        if not known:
            found = f"the model has no sigma for landmark {landmark} and purpose {purpose}"
            raise SettingsError(f"noise of {self.training.tracker}: {found}, expected a model fitted to windows of it")
        return min(known, key=lambda one: (abs(one.window - window), one.window))

    def sigma(self, *, landmark: str = Landmark.FREE, window: int = 11, purpose: str = Purpose.NEWEST_POSE) -> Interval:
        """The standard deviation of `equivalent`, px, with its interval.

        Raises
        ------
        UnknownNameError
            If there is no such kind of landmark, or no such purpose.
        SettingsError
            As `equivalent`.
        """
        kind, use = _named(Landmark, "kind of landmark", landmark), _named(Purpose, "purpose", purpose)
        return self.equivalent(landmark=kind, window=window, purpose=use).sigma

    def covariance(self, *, age: ArrayLike, magnification: ArrayLike = 1.0, **at: ArrayLike) -> NDArray[np.float64]:
        """Covariances of errors about the first position: 0 at age 0. They are second moments.

        No estimator must take an observation of age 0 as exact because of that. `track_covariance` with the reference
        ``free`` has the covariance that it should assume.

        Parameters
        ----------
        age
            (n,) frames of the recording since birth.
        magnification
            (n,) or one number: M_k = Z_0 / Z_k.
        **at
            (n,) or one number each: what is known at run time, by the names of `conditions`. What is missing or NaN
            has the factor 1.

        Returns
        -------
        (n, 2, 2) float64, px^2

        Raises
        ------
        SettingsError
            If an age is negative, a magnification is not positive, a number is infinite, or lengths differ.
        UnknownNameError
            If the model has no such condition.
        """
        (ages, carried), factor = _spread(self.conditions, at, age=age, magnification=magnification)
        if not ((ages >= 0.0).all() and (carried > 0.0).all()):
            raise SettingsError(
                "errors: found a negative age, or M that is not above 0, expected ages from 0 on, and M > 0"
            )
        return error_covariances(self.components, ages, carried, factor)

    def change_covariance(self, *, frames: ArrayLike = 1.0, **at: ArrayLike) -> NDArray[np.float64]:
        """Covariances of what errors change by, after the first frame of a track.

        Parameters
        ----------
        frames
            (n,) or one number: frames of the recording in between.
        **at
            As in `covariance`.

        Returns
        -------
        (n, 2, 2) float64, px^2

        Raises
        ------
        SettingsError
            If a number of frames is not positive, a condition is infinite, or lengths differ.
        UnknownNameError
            If the model has no such condition.
        """
        (apart,), factor = _spread(self.conditions, at, frames=frames)
        if not (apart > 0.0).all():
            raise SettingsError(f"changes: found {apart.min():g} frames in between, expected more than 0")
        return change_covariances(self.components, apart, factor)

    def track_covariance(
        self,
        ages: ArrayLike,
        *,
        reference: str = Reference.BIRTH,
        magnification: ArrayLike = 1.0,
        **at: ArrayLike,
    ) -> NDArray[np.float64]:
        """Covariance of all observations of a track: its second moment, of good and bad tracks together.

        Parameters
        ----------
        ages
            (m,) increasing, frames of the recording since birth.
        reference
            ``birth``: errors about the first position. An observation of age 0 then has none. ``free``: the first
            observation has the error A, and the others do not contain it.
        magnification
            (m,) or one number: M_k = Z_0 / Z_k.
        **at
            As in `covariance`, (m,) or one number each.

        Returns
        -------
        (2 m, 2 m) float64, px^2
            u and v of each observation in turn.

        Raises
        ------
        SettingsError
            If ages do not increase, a magnification is not positive, a condition is infinite, or lengths differ.
        UnknownNameError
            If the model has no such condition, or there is no such reference.
        """
        return _of_track(self.components, self.conditions, ages, reference, magnification, at)

    def scale_matrix(
        self,
        ages: ArrayLike,
        *,
        reference: str = Reference.FREE,
        magnification: ArrayLike = 1.0,
        **at: ArrayLike,
    ) -> NDArray[np.float64]:
        """Scale matrix S of all observations of a track, for Student's distribution of the whole track.

        With residuals r of d numbers that are whitened by it, the cost of a track is
        (nu + d) / 2 log(1 + r r / nu), nu = `track_scale.nu`. Where the point of the track is solved for, d is 3 less,
        which is what the point absorbs. The second moment is S nu / (nu - 2). Where `nu` is None the noise is Gaussian
        and S is its covariance.

        Parameters
        ----------
        ages, reference, magnification
            As in `track_covariance`.
        **at
            As in `track_covariance`, by the names of `track_scale.conditions`.

        Returns
        -------
        (2 m, 2 m) float64, px^2

        Raises
        ------
        SettingsError
            As `track_covariance`, and if the model has no `track_scale`, or it was refused.
        UnknownNameError
            If there is no such condition of `track_scale`, or no such reference.
        """
        scale = self.track_scale
        if scale is None or scale.why_refused is not None:
            why = "the run has no sample of tracks" if scale is None else scale.why_refused
            raise SettingsError(f"noise of {self.training.tracker}: found no scale of tracks ({why}), expected one")
        return _of_track(scale.noise, scale.conditions, ages, reference, magnification, at)

    def whiten(
        self,
        residuals: ArrayLike,
        ages: ArrayLike,
        *,
        reference: str = Reference.FREE,
        magnification: ArrayLike = 1.0,
        **at: ArrayLike,
    ) -> NDArray[np.float64]:
        """Residuals of a track, or rows of their derivatives, times the inverse of the root of its covariance.

        Parameters
        ----------
        residuals
            (2 m,) or (2 m, n): u and v of each observation in turn.
        ages, reference, magnification, **at
            As in `track_covariance`.

        Raises
        ------
        SettingsError
            As `track_covariance`, and if residuals have another shape or are not finite, or the covariance is singular,
            as that of age 0 about birth.
        """
        covariance = self.track_covariance(ages, reference=reference, magnification=magnification, **at)
        found, length = numbers("residuals", residuals), len(covariance)
        if found.ndim not in (1, 2) or len(found) != length:
            expected = f"({length},) or ({length}, n): u and v of each observation in turn"
            raise SettingsError(f"residuals: found shape {found.shape}, expected {expected}")
        if not np.isfinite(found).all():
            raise SettingsError("residuals: found NaN or infinity, expected finite numbers")
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError as error:
            expected = "noise in every observation (with reference birth, leave age 0 out)"
            raise SettingsError(f"track: found a singular covariance, expected {expected}") from error
        return np.asarray(linalg.solve_triangular(root, found, lower=True))

    def correct(self, uv: ArrayLike, ages: ArrayLike, *, flow: ArrayLike | None = None) -> NDArray[np.float64]:
        """Observed positions without the mean error, (n, 2) px; unchanged where no correction is warranted.

        Parameters
        ----------
        uv
            (n, 2) px, observed.
        ages
            (n,) frames of the recording since birth.
        flow
            (n, 2) px: motion of the image since the frame of the tracker before. Only a bias along the motion needs it,
            and not at age 0.

        Raises
        ------
        SettingsError
            If the flow is needed and missing, or an array has another shape.
        """
        since, observed = numbers("ages", ages), numbers("uv", uv)
        if since.ndim != 1 or observed.shape != (len(since), 2):
            found = f"found uv of shape {observed.shape} and ages of shape {since.shape}"
            raise SettingsError(f"correction: {found}, expected (n, 2) and (n,)")
        return corrected(self.bias, observed, since, flow)

    def advise(self, estimator: str = "filter", *, window: int | None = None, features: int | None = None) -> Advice:
        """What to set in an estimator, all together: sigma, gates, robust loss and its knee.

        Parameters
        ----------
        estimator
            Its name, or a kind of estimators: see docs/estimators/exports.md.
        window, features
            Length of its window, frames, and features that it uses in a frame; by default as shipped.

        Raises
        ------
        SettingsError
            If the estimator takes the components of a model, or the model has no such sigma.
        UnknownNameError
            If the estimator is not known.
        """
        return estimator_of(estimator).advise(self, window=window, features=features)

    def export(self, estimator: str, *, target: Target | None = None) -> Export:
        """The noise in the syntax of an estimator, with what it makes right and what cannot be expressed.

        Parameters
        ----------
        estimator
            Its name: see docs/estimators/exports.md.
        target
            Its camera, rate, window and purpose. By default, those of the model and what is usual for the estimator.

        Raises
        ------
        SettingsError
            If the estimator takes no noise of tracks, or the model was not measured at its focal length or rate.
        UnknownNameError
            If the estimator is not known.
        """
        return export(self, estimator, target=target)

    @property
    def components(self) -> TrackNoise:
        """The covariances of all components."""
        return TrackNoise(**{name: getattr(self, name).covariance for name in NAMES})

    @property
    def text(self) -> str:
        """The document, JSON."""
        return _text_of(self)

    @property
    def sha256(self) -> str:
        """Hash of the document."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def write(self, path: str | Path) -> None:
        """Write the document, JSON.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        write_atomically(path_of("path", path), self.text.encode())

    @classmethod
    def read(cls, path: str | Path) -> "NoiseModel":
        """Read a document.

        Raises
        ------
        DataError
            If it cannot be read, or is not a noise model: with the place, what was found and what was expected.
        """
        return cls.parse(read_text(path_of("path", path), "a noise model", most=16 * MIB), path)

    @classmethod
    def parse(cls, text: str, path: str | Path) -> "NoiseModel":
        """A document from its text.

        Parameters
        ----------
        text
            Of the document.
        path
            Of its file, for messages.

        Raises
        ------
        DataError
            If it is not a noise model: with the place, what was found and what was expected.
        """
        file = Path(path)
        fields = _fields(file, text)
        try:
            model: NoiseModel = _adapter(cls).validate_python(fields)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"])) or "document"
            message = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
            raise DataError(file, f"{key}: found {_shown(first['input'])}", message) from error
        return model


def _of_track(
    noise: TrackNoise,
    conditions: Sequence[Factor],
    ages: ArrayLike,
    reference: str,
    magnification: ArrayLike,
    at: Mapping[str, ArrayLike],
) -> NDArray[np.float64]:
    about = _named(Reference, "reference", reference)
    (spread, carried), factor = _spread(conditions, at, ages=ages, magnification=magnification)
    increase = len(spread) > 0 and spread[0] >= 0.0 and bool((np.diff(spread) > 0.0).all())
    if not (increase and (carried > 0.0).all()):
        found = f"ages {spread.tolist()}, magnifications {carried.tolist()}"
        raise SettingsError(f"track: found {found}, expected increasing ages from 0 on, and M > 0")
    return track_covariance(noise, spread, about, carried, factor)


def _spread(
    conditions: Sequence[Factor], at: Mapping[str, ArrayLike], **values: ArrayLike
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Values as rows of one length, and the factor of the conditions there, (n,) float64."""
    rows = of_one_length(**values, **at)
    for name, row in zip((*values, *at), rows, strict=True):
        wrong = row[np.isinf(row)]
        if wrong.size:
            known = "finite numbers, or NaN where unknown" if name in at else "finite numbers"
            raise SettingsError(f"{name}: found {wrong[0]:g}, expected {known}")
    covariates = dict(zip(at, rows[len(values) :], strict=True))
    return rows[: len(values)], factor_of(conditions, covariates, len(rows[0]))


def _named(kinds: type[_Kind], what: str, name: str) -> _Kind:
    if name not in list(kinds):
        raise UnknownNameError(what, name, kinds)
    return kinds(name)
