"""The noise models of a run at its lowest speed, which its analysis fits once."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import polars as pl

from tracknoise.estimators.advice import innovations_of
from tracknoise.estimators.exports import estimator
from tracknoise.estimators.fit import fitted_fields
from tracknoise.estimators.model import Interval
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import RunTruth, TrainingTables, all_training_tables, conditions
from tracknoise.exceptions import DataError, SettingsError, StoreError
from tracknoise.inference.conventions import LEVEL
from tracknoise.processes import ONE_THREAD, process_pool
from tracknoise.tables.identity import identifiers
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import OF_CONDITION, Constants, Rows, RunTable, by_quantity, same
from tracknoise.tables.schema import POOLED
from tracknoise.tables.store import RunFolder


def _advice() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        "sigma": ("sigma_to_set", {}),
        "state_sigma": ("state_sigma_to_set", {}),
        "features": ("features_of_sigma", {}),
        "knee": ("knee_to_set", {}),
        "track_gate": ("gate_to_set", {"against": "track"}),
        "observation_gate": ("gate_to_set", {"against": "observation"}),
        "innovations": ("sigma_of_innovations", {}),
        "gated_nees": ("nees_with_gate", {}),
        "correlation_of_both": ("correlation_of_both", {}),
        "position_of_both": ("position_of_both", {}),
        "rotation_of_both": ("rotation_of_both", {}),
    }
    values = by_quantity(names, same("low", "high", "level", "n_scenes", "why"), axis="window", against=None)
    packed = {"part": ("estimator", "landmark", "purpose", "kernel")}
    keys = {**OF_CONDITION, "at": "window"}
    return Rows("advice", keys, values, packed=packed)


ADVICE = RunTable(
    "advice",
    {
        **POOLED,
        **dict.fromkeys(("estimator", "landmark", "purpose", "kernel"), pl.String),
        "window": pl.UInt32,
        "quantity": pl.String,
        "value": pl.Float64,
        "low": pl.Float64,
        "high": pl.Float64,
        "why": pl.String,
        "level": pl.Float64,
        "n_scenes": pl.Int32,
    },
    _advice(),
    title="what to set in the estimator",
    quantities={
        "sigma_to_set": Quantity("px", "Noise to set in the estimator of the experiment."),
        "state_sigma_to_set": Quantity("px", "The same for features in its state."),
        "features_of_sigma": Quantity("1", "Features of a frame whose errors in common the noise to set counts."),
        "nees_with_gate": Quantity("1", "NEES of the newest pose with sigma and the track gate, in trials."),
        "knee_to_set": Quantity("sigmas", "Knee of its robust loss."),
        "gate_to_set": Quantity("1", "Factor on its chi-square gate at .95."),
        "sigma_of_innovations": Quantity("px", "Noise with which its innovations look right."),
        "correlation_of_both": Quantity("1", "Correlation of errors in both cameras, whose positions sigma is for."),
        "position_of_both": Quantity("1", "Error of the newest position with both cameras over that with the first."),
        "rotation_of_both": Quantity("1", "Error of the newest rotation with both cameras over that with the first."),
    },
)
"""What to set in the estimator of the experiment: see `tracknoise.estimators.advice`.

estimator is its name in docs/estimators/exports.md, kernel its robust loss, null if it has none. sigma, state_sigma (of
features in its state, which observation_gate then belongs to) and innovations are in px, knee is in sigmas, gates
are factors on chi-square quantiles at .95. features is how many of a frame have their errors in common in sigma; there
is none where sigma takes them as independent. gated_nees is the NEES of the newest pose with sigma and the gate of
tracks, where it was tried. Of a tracker of a second camera, sigma is for the positions in both: then there are the
correlation of their errors, and by how much the second camera changes the errors of the newest pose. why says why
windows are simulated; it is null where they are not. level is that of the interval; it is null without one. n_scenes is
how many scenes the model was fitted to.
"""

_RECORD, _FOLDER = "noise/models.json", "statistics/"


@dataclass(frozen=True, slots=True)
class RunModels:
    """The models of a run.

    Attributes
    ----------
    speed
        At which the models hold; None where there are none.
    models
        By tracker, in their order.
    missing
        Why other trackers have none: a sentence, by tracker.
    paths
        Where the models are, relative to the run, by tracker.
    """

    speed: int | None = None
    models: Mapping[str, NoiseModel] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)
    paths: Mapping[str, str] = field(default_factory=dict)

    @property
    def documents(self) -> dict[str, str]:
        """What a run stores: the models, and the record of which trackers have one; nothing without a speed."""
        if self.speed is None:
            return {}
        names = {tracker: path.removeprefix(_FOLDER) for tracker, path in self.paths.items()}
        record = {"speed": self.speed, "models": names, "missing": self.missing}
        return {**{names[tracker]: model.text for tracker, model in self.models.items()}, _RECORD: json.dumps(record)}


def fitted_models(
    run: RunFolder,
    trackers: Sequence[str],
    speed: int,
    truth: RunTruth,
    *,
    workers: int = 1,
    begin: Callable[..., Callable[[], Any]] = partial,
) -> RunModels:
    """Fit a model to each tracker.

    Parameters
    ----------
    run
        With its statistics.
    trackers, speed
        In the order of the experiment; the lowest speed.
    truth
        What is known of the truth of the run.
    workers
        Processes that fit, where there are more trackers. To start them takes as long as a fit.
    begin
        Where there are fewer, begins a call that fits half of them, and returns what waits for its result.

    Returns
    -------
    RunModels
        Without a speed for a run without sums.

    Raises
    ------
    StoreError, SchemaError
        If a table of the run is damaged.
    """
    measured = _measured(run, trackers, speed)
    if not measured:
        return RunModels()
    tables = all_training_tables(run, [(tracker, speed) for tracker in measured], truth=truth)
    names = identifiers(measured)
    if 1 < workers < len(tables):
        with process_pool(workers, ONE_THREAD) as pool:
            fits = [one for own in pool.map(_fits, [[own] for own in tables]) for one in own]
    else:
        others = begin(_fits, tables[: len(tables) // 2])
        last = _fits(tables[len(tables) // 2 :])
        fits = [*others(), *last]
    found = dict(zip(measured, fits, strict=True))
    models = {tracker: one for tracker, one in found.items() if isinstance(one, NoiseModel)}
    missing = {tracker: one for tracker, one in found.items() if isinstance(one, str)}
    paths = {tracker: f"{_FOLDER}noise/{names[tracker]}@{speed}.noise.json" for tracker in models}
    return RunModels(speed, models, missing, paths)


def _fits(tables: Sequence[TrainingTables]) -> list[NoiseModel | str]:
    """Models, or why there is none."""
    found: list[NoiseModel | str] = []
    for own in tables:
        try:
            found.append(NoiseModel(**fitted_fields(own)))
        except SettingsError as error:
            found.append(str(error))
    return found


def advice_table(
    models: RunModels, name: str, *, window: int | None, features: int | None, condition: Mapping[str, Any]
) -> pl.DataFrame:
    """What to set in an estimator for each tracker with a model: table `ADVICE`.

    Parameters
    ----------
    models
        Of a run.
    name, window, features
        Of the estimator (`tracknoise.estimators.exports.estimators`), the length of its window, and how many features
        of a frame it uses; None as shipped.
    condition
        View and speed of the models.
    """
    rows = []
    for tracker, model in models.models.items():
        try:
            found = estimator(name).advise(model, window=window, features=features)
        except SettingsError:  # no error in any direction that the estimator can see
            continue
        innovations = innovations_of(model, found)
        numbers = {"sigma": found.sigma, "innovations": innovations}
        numbers |= {} if found.state is None else {"state_sigma": found.state.sigma}
        numbers |= {} if found.features is None else {"features": Interval(value=float(found.features))}
        numbers |= {f"{gate}_gate": Interval(value=factor) for gate, factor in found.every_gate.items()}
        numbers |= {} if found.gated is None else {"gated_nees": found.gated.nees}
        numbers |= {} if found.knee is None else {"knee": Interval(value=found.knee)}
        if (both := model.of_both) is not None:
            numbers |= {"correlation_of_both": Interval(value=both.correlation)}
            numbers |= {"position_of_both": both.position_ratio, "rotation_of_both": both.rotation_ratio}
        about = {
            "dataset": model.training.dataset,
            "tracker": tracker,
            **condition,
            "estimator": name,
            "landmark": found.landmark,
            "purpose": found.purpose,
            "kernel": found.kernel,
            "window": found.window,
            "why": _SIMULATED if found.simulated else None,
        }
        rows += [
            {
                **about,
                "quantity": quantity,
                "value": one.value,
                "low": one.low,
                "high": one.high,
                "level": None if one.low is None and one.high is None else LEVEL,
                "n_scenes": len(model.training.scenes),
            }
            for quantity, one in numbers.items()
        ]
    return pl.DataFrame(rows, schema=dict(ADVICE))


_SIMULATED = "no recording has so many frames that move"


def run_models(run: RunFolder) -> RunModels:
    """The models that the analysis of a run fitted; none for a run without sums, or of an earlier version.

    Raises
    ------
    StoreError
        If one of its files is missing or damaged.
    """
    text = run.document(_RECORD)
    if text is None:
        return RunModels()
    try:
        record = json.loads(text)
        paths = {tracker: f"{_FOLDER}{name}" for tracker, name in record["models"].items()}
        models = {
            tracker: NoiseModel.parse(run.document(name) or "", run.path / paths[tracker])
            for tracker, name in record["models"].items()
        }
        return RunModels(record["speed"], models, dict(record["missing"]), paths)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, DataError) as error:
        expected = "the models of the run; `tracknoise run` fits them again"
        raise StoreError(f"{run.path / 'statistics' / _RECORD}: damaged ({error}), expected {expected}") from error


def _measured(run: RunFolder, trackers: Sequence[str], speed: int) -> Sequence[str]:
    """Trackers with sums at a speed; none where a run has no sums."""
    try:
        known = conditions(run)
    except StoreError:
        return []
    return [tracker for tracker in trackers if (tracker, speed) in known]
