"""What a filter may assume of a tracker: sets of arms, each compared with its first."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from benchmarks.filter_tracks import CLONES
from benchmarks.msckf import MOST_FEATURES, Assumed, GateRule
from tracknoise.estimators.advice import GOOD, LEVEL, Gate, chi_square, observation_gate
from tracknoise.estimators.exports import estimator
from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.estimators.noise_model import NoiseModel

Arms = Mapping[str, Assumed]

SHIPPED = Assumed(tracks=1.0, features=1.0, most_features=MOST_FEATURES)
"""What OpenVINS ships."""
SET = "what is set in a filter"
EARLIER_SHARE = 1.0 / 3.0
"""Share of the claimed variance of innovations that gates once allowed for errors of predicted poses."""
_FREEDOM = 2 * CLONES - 3


def sigma_arms(model: NoiseModel) -> Arms:
    """Sigmas, gates and whole tracks, without features in the state."""

    def of(purpose: Purpose) -> tuple[float, float]:
        found = model.equivalent(landmark=Landmark.FREE, window=CLONES, purpose=purpose)
        return found.sigma.value, found.gate_95

    advised = model.advise("filter", window=CLONES)
    (sigma, gate), (innovations, gate_of_innovations) = of(Purpose.NEWEST_POSE), of(Purpose.INNOVATIONS)
    pairs = {
        "1 px, gate 1": (1.0, 1.0),
        "1 px, gate .05": (1.0, 0.05),
        "newest pose, gate 1": (sigma, 1.0),
        "newest pose, gate of the model": (sigma, gate),
        "newest pose, gate of .8 of good tracks": (sigma, tracks_rule(model, GOOD).factor),
        SET: (advised.sigma.value, advised.gates[Gate.TRACK]),
        **{f"newest pose, gate {value:g}": (sigma, value) for value in (0.25, 0.1, 0.05)},
        **{
            f"newest pose x {factor:g}, same gate in px": (factor * sigma, gate / factor**2)
            for factor in (1.5, 2.0, 3.0)
        },
        "innovations, gate 1": (innovations, 1.0),
        "innovations, gate of the model": (innovations, gate_of_innovations),
        "all poses, gate of the model": of(Purpose.ALL_POSES),
        "whole tracks, gate 1": (model.components, 1.0),
        "whole tracks, gate .25": (model.components, 0.25),
    }
    return {name: Assumed(tracks=noise, gate=GateRule(factor)) for name, (noise, factor) in pairs.items()}


def export_arms(model: NoiseModel) -> Arms:
    """What is exported to OpenVINS, and what else may be set there."""
    exported = _printed(model)
    third = _gated(model, (GOOD, EARLIER_SHARE), (LEVEL, EARLIER_SHARE))
    sigma = estimator("openvins").advise(model, window=CLONES).sigma.value
    return {
        "shipped: 1 px, gate 1": SHIPPED,
        "export": exported,
        "export, features of windows of 30 frames": _printed(model, state_window=30),
        "a third for predicted poses": third,
        "the same, gate of features .1": replace(third, features_gate=GateRule(0.1)),
        **{
            f"export, both gates {value:g}": replace(exported, gate=GateRule(value), features_gate=GateRule(value))
            for value in (0.05, 0.1, 0.2)
        },
        "a third, sigmas twice as large": replace(third, tracks=2.0 * sigma, features=2.0 * third.features),
        "export, no features": replace(exported, most_features=0),
        "a third, no features": replace(third, most_features=0),
        **{f"{sigma:g} px, gate 1": replace(SHIPPED, tracks=sigma, features=sigma) for sigma in (0.15, 0.3, 0.6)},
    }


def feature_arms(model: NoiseModel) -> Arms:
    """The export to OpenVINS for several numbers of features of a frame, and with independent errors of features."""
    independent = _printed(replace(model, common_share=None))
    return {
        "shipped: 1 px, gate 1": SHIPPED,
        "export, independent features": independent,
        **{f"export, {features} features per frame": _printed(model, features) for features in (50, 200, 400)},
        "export, independent, no features in state": replace(independent, most_features=0),
        "export, 200, no features in state": replace(_printed(model, 200), most_features=0),
    }


def gate_arms(model: NoiseModel) -> Arms:
    """Rules for the gates of an export: share of good ones that pass, and share of predicted poses, one at a time."""
    kept = (GOOD, 0.0), (LEVEL, 0.0)
    of_tracks = [(GOOD, EARLIER_SHARE), (GOOD, None), (LEVEL, 0.0), (0.99, 0.0)]
    of_features = [(LEVEL, EARLIER_SHARE), (LEVEL, None), (GOOD, 0.0), (0.99, 0.0)]
    pairs = [kept, *((own, kept[1]) for own in of_tracks), *((kept[0], own) for own in of_features)]
    pairs.append(((GOOD, None), (LEVEL, None)))
    rules = {f"tracks {_said(*own)}; features {_said(*state)}": _gated(model, own, state) for own, state in pairs}
    return {"shipped: 1 px, gate 1": SHIPPED, **rules}


ARMS: Mapping[str, Callable[[NoiseModel], Arms]] = {
    "sigmas": sigma_arms,
    "exports": export_arms,
    "gates": gate_arms,
    "features": feature_arms,
}


def _said(level: float, predicted: float | None) -> str:
    return f"{level:g}, p {'as claimed' if predicted is None else f'{predicted:.2g}'}"


def _printed(model: NoiseModel, features: int | None = None, state_window: int | None = None) -> Assumed:
    """The export to OpenVINS; by default for as many features of a frame, and windows for its state, as it ships."""
    about = estimator("openvins")
    shipped = replace(about, state_window=state_window or about.state_window)
    advised = shipped.advise(model, window=CLONES, features=features)
    state = advised.state
    assert state is not None
    return Assumed(
        tracks=advised.sigma.value,
        gate=GateRule(advised.gates[Gate.TRACK]),
        features=state.sigma.value,
        features_gate=GateRule(state.gates[Gate.OBSERVATION]),
        most_features=MOST_FEATURES,
    )


def _gated(model: NoiseModel, tracks: tuple[float, float | None], features: tuple[float, float | None]) -> Assumed:
    """The export with gates by other levels and shares of predicted poses."""
    return replace(_printed(model), gate=tracks_rule(model, *tracks), features_gate=_features_rule(model, *features))


def tracks_rule(model: NoiseModel, level: float, predicted: float | None = 0.0) -> GateRule:
    """The gate that a share of good tracks passes at true poses, for the sigma of the newest pose."""
    found = model.equivalent(landmark=Landmark.FREE, window=CLONES, purpose=Purpose.NEWEST_POSE)
    gates = {GOOD: found.gate_80 or found.gate_95, LEVEL: found.gate_95, 0.99: found.gate_99}
    return GateRule(gates[level], predicted, chi_square(level, _FREEDOM) / chi_square(LEVEL, _FREEDOM))


def _features_rule(model: NoiseModel, level: float, predicted: float | None) -> GateRule:
    """The gate that a share of good observations of features passes at true poses; at most 1, as exported."""
    state = estimator("openvins").advise(model, window=CLONES).state
    assert state is not None
    residuals = model.equivalent(landmark=Landmark.FREE, window=state.window, purpose=Purpose.INNOVATIONS).sigma.value
    measured = observation_gate(model, residuals, state.sigma.value, level)
    return GateRule(min(measured, 1.0), predicted, chi_square(level, 2) / chi_square(LEVEL, 2))
