"""Noise models as sentences and tables."""

import math

from tracknoise.estimators.advice import Advice, innovations_of
from tracknoise.estimators.exports import estimator, in_words, of_both, of_common
from tracknoise.estimators.model import BiasKind, Interval, Landmark, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.track_likelihood import BULK, LEAST_NU
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import COMPONENTS
from tracknoise.report.cells import Cells
from tracknoise.tables.enumerations import Trust
from tracknoise.text import counted, significant
from tracknoise.words import DASH, number

_LANDMARKS = {
    Landmark.FREE: "point solved for",
    Landmark.EXACT: "first observation exact",
    Landmark.STATE: "first direction a state",
}
_PURPOSES = {Purpose.INNOVATIONS: "innovations", Purpose.ALL_POSES: "all poses", Purpose.NEWEST_POSE: "newest pose"}


def model_sentences(model: NoiseModel, name: str, *, features: int | None = None) -> list[str]:
    """What a model says, the answer first: what to set in an estimator (`tracknoise.estimators.exports.estimators`).

    `features`: that it uses in a frame; None as shipped.
    """
    training = model.training
    return [
        f"Noise of {training.tracker} at speed {training.speed:g}.",
        *([] if model.truth.verdict is Trust.trusted else [model.truth.sentence]),
        *_advice(model, name, features),
        _tails(model),
        f"{_percent(model.outlier_share)} of the observations are outliers, with errors beyond about "
        f"{number(model.outliers_beyond_px)} px; the numbers do not describe them.",
        _model_bias(model),
        *_conditions(model),
        *_track_scale(model),
        *of_common(model, estimator(name), _set_to(model, name, features)),
        *_floor(model),
        f"Fitted to {counted(len(training.scenes), 'scene')}, {counted(training.n_tracks, 'track')}, "
        f"ages {training.ages[0]} to {training.ages[1]} frames.",
        *model.camera.notes,
    ]


def component_cells(model: NoiseModel) -> Cells:
    """The components, with the reason where one was dropped."""
    rows = []
    for component in COMPONENTS:
        part = getattr(model, component.name)
        rows.append([component.title, *interval_cells(part.sigma), component.unit, part.why_dropped or ""])
    described = (
        f"Components of the noise of the {_percent(1.0 - model.outlier_share)} of observations that are no outliers"
    )
    return Cells(described, ["component", "sigma", "low", "high", "unit", "dropped because"], rows, _NUMERIC)


_NUMERIC = (False, True, True, True, False, False)


def equivalent_cells(model: NoiseModel, window: int) -> Cells:
    """Standard deviations for windows of nearly this length, named by what they make right."""
    lengths = sorted(
        {equivalent.window for equivalent in model.equivalents}, key=lambda length: (abs(length - window), length)
    )
    equivalents = [equivalent for equivalent in model.equivalents if lengths and equivalent.window == lengths[0]]
    rows = [
        [
            _LANDMARKS[equivalent.landmark],
            _PURPOSES[equivalent.purpose],
            *interval_cells(equivalent.sigma),
            DASH if equivalent.gate_80 is None else number(equivalent.gate_80),
            number(equivalent.gate_95),
            number(equivalent.gate_99),
        ]
        for equivalent in equivalents
    ]
    headings = [
        "landmark",
        "makes right",
        "sigma, px",
        "low",
        "high",
        "track gate .80",
        "track gate .95",
        "track gate .99",
    ]
    simulated = "simulated " if any(equivalent.simulated for equivalent in equivalents) else ""
    caption = f"One sigma for all observations, {simulated}windows of {lengths[0] if lengths else window} frames"
    return Cells(caption, headings, rows, (False, False, *[True] * 6))


def _set_to(model: NoiseModel, name: str, features: int | None) -> Advice | None:
    """What to set in an estimator; None where this is unknown, or it takes the components."""
    try:
        return estimator(name).advise(model, features=features)
    except SettingsError:
        return None


def _advice(model: NoiseModel, name: str, features: int | None) -> list[str]:
    """What to set, and what innovations suggest."""
    about = estimator(name)
    if about.purpose is None:
        return [f"{about.title} takes the components, which `tracknoise export` writes."]
    try:
        advice = about.advise(model, features=features)
    except SettingsError as error:
        return [f"What to set in {about.title} is unknown: {error}."]
    innovations = innovations_of(model, advice)
    to_set = in_words(advice, is_bound=not model.truth.is_usable)
    suggested = f"Innovations suggest {number(innovations.value)} px."
    return [f"In {about.title}, set {to_set}.", suggested, *of_both(model)]


def _range(interval: Interval) -> str:
    if interval.low is None or interval.high is None:
        return number(interval.value)
    return f"{number(interval.value)} ({number(interval.low)} to {number(interval.high)})"


def _tails(model: NoiseModel) -> str:
    if math.isinf(model.tails.nu):
        return "Tails are no heavier than those of a Gaussian."
    return f"Tails are those of Student's t with {number(model.tails.nu)} degrees of freedom."


def _model_bias(model: NoiseModel) -> str:
    verdict = {
        BiasKind.NONE: "The mean error is not part of the model",
        BiasKind.REFUSED: "No correction of the mean error is warranted",
    }
    return f"{verdict.get(model.bias.kind, 'The mean error should be corrected')}: {model.bias.why}."


def _conditions(model: NoiseModel) -> list[str]:
    return [
        f"White noise and walk depend on {condition.of}: their variances change by a factor of "
        f"{number(math.exp(max(condition.log_factor) - min(condition.log_factor)))}. On held-out scenes, this "
        f"gains {number(condition.gain.value)} nat per change{' beyond the first factor' if place else ''}."
        for place, condition in enumerate(model.conditions)
    ]


def _track_scale(model: NoiseModel) -> list[str]:
    """What is gained by a scale of each track, and the bulk that is then left."""
    scale = model.track_scale
    if scale is None:
        return []
    if scale.why_refused is not None or scale.gain is None:
        return [f"The likelihood of whole tracks is not used: {scale.why_refused}."]
    bulk = [term for term in COMPONENTS if term.name in BULK]
    parts = ", ".join(f"{term.letter} {_range(getattr(scale, term.name).sigma)} {term.unit}" for term in bulk)
    gain = f"On held-out tracks, this model gains {_range(scale.gain)} nat per track over second moments."
    qualities = " and ".join(term.of for term in scale.conditions)
    by_quality = f"; W and Q depend on {qualities}" if qualities else ""
    if scale.nu is None:
        return [f"By the likelihood of whole tracks, tails are Gaussian: {parts}{by_quality}. {gain}"]
    return [
        f"Tails of whole tracks are those of Student's t with {_freedom(scale.nu)} degrees of freedom, as of a scale "
        f"for each track, or of heavy tails in each frame. The bulk has {parts}{by_quality}. {gain}"
    ]


def _freedom(nu: Interval) -> str:
    at_limit = nu.low is None and nu.value <= LEAST_NU * (1 + 1e-6)
    return f"at most {number(nu.value)}" if at_limit else _range(nu)


def _floor(model: NoiseModel) -> list[str]:
    if not model.truth_floor_px:
        return []
    return [f"Errors of the truth are part of these numbers: {number(model.truth_floor_px)} px root mean square."]


def interval_cells(interval: Interval) -> list[str]:
    """A value and its bounds, each in a cell of its own; empty where there is none."""
    return [number(value) if value is not None else "" for value in (interval.value, interval.low, interval.high)]


def _percent(share: float) -> str:
    return f"{significant(100.0 * share, 2)} %"
