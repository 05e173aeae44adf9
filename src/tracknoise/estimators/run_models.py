"""The noise models of a run at its lowest speed, which its analysis fits once."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import all_training_tables, conditions
from tracknoise.exceptions import DataError, SettingsError, StoreError
from tracknoise.tables.identity import identifiers
from tracknoise.tables.store import RunFolder

_RECORD = "noise/models.json"


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


def fitted_models(run: RunFolder, trackers: Sequence[str], speed: int) -> dict[str, str]:
    """Fit a model to each tracker.

    Parameters
    ----------
    run
        With its statistics.
    trackers, speed
        In the order of the experiment; the lowest speed.

    Returns
    -------
    dict
        Documents of the run: the models, and the record of which trackers have one. Empty for a run without sums.

    Raises
    ------
    StoreError, SchemaError
        If a table of the run is damaged.
    """
    measured = _measured(run, trackers, speed)
    if not measured:
        return {}
    tables = all_training_tables(run, [(tracker, speed) for tracker in measured])
    names = identifiers(measured)
    documents, missing = {}, {}
    for tracker, own in zip(measured, tables, strict=True):
        try:
            documents[f"noise/{names[tracker]}@{speed}.noise.json"] = NoiseModel.fitted_to(own).text
        except SettingsError as error:
            missing[tracker] = str(error)
    kept = [tracker for tracker in measured if tracker not in missing]
    record = {"speed": speed, "models": dict(zip(kept, documents, strict=True)), "missing": missing}
    return {**documents, _RECORD: json.dumps(record)}


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
        paths = {tracker: f"statistics/{name}" for tracker, name in record["models"].items()}
        models = {
            tracker: NoiseModel.parse(run.document(name) or "", run.path / paths[tracker])
            for tracker, name in record["models"].items()
        }
        return RunModels(record["speed"], models, dict(record["missing"]), paths)
    except (ValueError, KeyError, TypeError, AttributeError, DataError) as error:
        expected = "the models of the run; `tracknoise run` fits them again"
        raise StoreError(f"{run.path / 'statistics' / _RECORD}: damaged ({error}), expected {expected}") from error


def _measured(run: RunFolder, trackers: Sequence[str], speed: int) -> Sequence[str]:
    """Trackers with sums at a speed; none where a run has no sums."""
    try:
        known = conditions(run)
    except StoreError:
        return []
    return [tracker for tracker in trackers if (tracker, speed) in known]
