"""What to set in an estimator, from the noise models of a run."""

from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.estimators.advice import Advice, Gate, innovations_of
from tracknoise.estimators.exports import Estimator, Target, asked, estimator, estimator_name, right_for, windows_of
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.run_models import run_models
from tracknoise.exceptions import SettingsError
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.store import RunFolder
from tracknoise.text import html_card
from tracknoise.words import number, pixels, px


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaToSet:
    """What to set in an estimator for one tracker.

    Attributes
    ----------
    tracker, estimator
        Their names.
    sigma_px, low_px, high_px
        Standard deviation of each coordinate, and its interval, px; the bounds are None where unknown.
    window, simulated, makes_right
        Length of the windows that sigma is for, frames; whether they are simulated, because no recording has so many
        frames that move; and what sigma makes right.
    features
        Features of a frame whose errors in common sigma counts; None where it takes them as independent.
    innovations_px
        What innovations suggest: their standard deviation, px.
    state_sigma_px
        Standard deviation for features in the state, px; None where they have none of their own.
    track_gate, observation_gate
        Factors on chi-square quantiles at .95, for tracks and for single observations; None where there is none. The
        second belongs to `state_sigma_px` where there is one.
    kernel, knee
        The robust loss, and its knee in units of sigma; None where the estimator has none.
    caveat
        The verdict on the truth, where it is not trusted; else empty. If it is not usable, sigma is an upper bound.
    """

    tracker: str
    estimator: str
    sigma_px: float
    low_px: float | None
    high_px: float | None
    window: int
    simulated: bool
    features: int | None
    makes_right: str
    innovations_px: float
    state_sigma_px: float | None
    track_gate: float | None
    observation_gate: float | None
    kernel: str | None
    knee: float | None
    caveat: str

    def _repr_html_(self) -> str:
        bounds = "" if self.low_px is None else f" ({pixels(self.low_px)} to {pixels(self.high_px)})"
        facts = {
            "sigma": f"{px(self.sigma_px)}{bounds}",
            "innovations suggest": px(self.innovations_px),
            "sigma of features in the state": self.state_sigma_px and px(self.state_sigma_px),
            "track gate": self.track_gate and f"times {number(self.track_gate)}",
            "observation gate": self.observation_gate and f"times {number(self.observation_gate)}",
            "robust loss": self.kernel and f"{self.kernel}, knee at {number(self.knee)} sigma",
            "makes right": self.makes_right,
            "features of a frame": "taken as independent" if self.features is None else f"{self.features}",
            "truth": self.caveat,
        }
        return html_card(f"{self.tracker} in {self.estimator}", {name: fact for name, fact in facts.items() if fact})


def sigmas_to_set(
    run: RunFolder, name: str, *, window: int | None = None, features: int | None = None
) -> dict[str, SigmaToSet]:
    """What to set in an estimator for each tracker that has a noise model, by the name of the tracker.

    Parameters
    ----------
    run
        A finished run.
    name
        Of the estimator, or one of its aliases.
    window, features
        Length of its window, frames, and features that it uses in a frame; by default those of the experiment if it
        names this estimator, else as shipped.

    Raises
    ------
    UnknownNameError, SettingsError
        If the estimator is not known, takes no single sigma, or no tracker has a model.
    """
    about, noise_models = estimator(name), run_models(run)
    if not noise_models.models:
        why = "; ".join(f"{tracker}: {reason}" for tracker, reason in noise_models.missing.items())
        raise SettingsError(f"{run.path}: no tracker has a noise model, expected one{f' ({why})' if why else ''}")
    of_experiment = asked(run.settings(), estimator_name(name))
    target = Target(window=window or of_experiment.window, features=features or of_experiment.features)
    advised: dict[str, SigmaToSet] = {}
    reasons = []
    for tracker, model in noise_models.models.items():
        try:
            advised[tracker] = _to_set(model, tracker, about, target)
        except SettingsError as error:  # no error in any direction that the estimator can see
            reasons.append(str(error))
    if not advised:
        raise SettingsError(reasons[0])
    return advised


def _to_set(model: NoiseModel, tracker: str, about: Estimator, target: Target) -> SigmaToSet:
    advice = about.advise(model, window=target.window, features=target.features)
    innovations = innovations_of(model, advice)
    return SigmaToSet(
        tracker=tracker,
        estimator=about.title,
        sigma_px=advice.sigma.value,
        low_px=advice.sigma.low,
        high_px=advice.sigma.high,
        window=advice.window,
        simulated=advice.simulated,
        features=advice.features,
        makes_right=f"{right_for(advice)}, in {windows_of(advice)}",
        innovations_px=innovations.value,
        state_sigma_px=None if advice.state is None else advice.state.sigma.value,
        **_gates(advice),
        kernel=None if advice.kernel is None else str(advice.kernel),
        knee=advice.knee,
        caveat="" if model.truth.verdict is Trust.trusted else model.truth.caveat,
    )


def _gates(advice: Advice) -> Mapping[str, float | None]:
    return {f"{gate}_gate": advice.every_gate.get(gate) for gate in Gate}
