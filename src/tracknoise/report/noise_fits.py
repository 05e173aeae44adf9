"""The noise models of a run at its lowest speed, fitted once: a second report reads what the first one wrote.

Models are kept in ``statistics/noise``, with a hash of what they were fitted to and of the program that fitted them.
They are fitted again if either has changed since.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tracknoise.exceptions import DataError, SettingsError, StoreError
from tracknoise.noise_models.fitting.training_tables import TrainingTables, all_training_tables, conditions
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.report.report_data import ReportData
from tracknoise.tables.files import remove, write_atomically

_FOLDER, _RECORD = "noise", "fits.json"


@dataclass(frozen=True, slots=True)
class NoiseFits:
    """The models of a run.

    Attributes
    ----------
    models
        By tracker, in their order.
    missing
        Why other trackers have none: a sentence, by tracker.
    paths
        Where the models are, relative to the run, by tracker.
    """

    models: Mapping[str, NoiseModel]
    missing: Mapping[str, str]
    paths: Mapping[str, str]


def noise_fits(data: ReportData) -> NoiseFits:
    """The model of each tracker. A run without sums for noise models has none.

    Raises
    ------
    StoreError, SchemaError
        If a table of the run is damaged, or models cannot be written.
    """
    inputs = _inputs(data)
    found = _kept(data, inputs)
    return _fitted(data, inputs) if found is None else found


def _kept(data: ReportData, inputs: str) -> NoiseFits | None:
    """What was written before; None if it is missing, damaged or of other inputs."""
    try:
        record = json.loads((_folder(data) / _RECORD).read_text())
        if record["inputs"] != inputs:
            return None
        paths = {tracker: _path(data, tracker) for tracker in record["models"]}
        models = {tracker: NoiseModel.read(data.run.path / path) for tracker, path in paths.items()}
        return NoiseFits(models, dict(record["missing"]), paths)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, DataError):
        return None


def _fitted(data: ReportData, inputs: str) -> NoiseFits:
    """Fit the models, and write them. What is written last says that the models are of these inputs."""
    record = _folder(data) / _RECORD
    remove(record)
    trackers = _measured(data)
    if not trackers:
        return NoiseFits({}, {}, {})
    tables = all_training_tables(data.run, [(tracker, data.slowest) for tracker in trackers])
    found = {tracker: _model(own) for tracker, own in zip(trackers, tables, strict=True)}
    models = {tracker: model for tracker, model in found.items() if isinstance(model, NoiseModel)}
    missing = {tracker: why for tracker, why in found.items() if isinstance(why, str)}
    paths = {tracker: _path(data, tracker) for tracker in models}
    for tracker, model in models.items():
        model.write(data.run.path / paths[tracker])
    write_atomically(record, json.dumps({"inputs": inputs, "models": list(models), "missing": missing}).encode())
    return NoiseFits(models, missing, paths)


def _measured(data: ReportData) -> Sequence[str]:
    """Trackers with sums at the lowest speed; none where a run has no sums."""
    try:
        known = conditions(data.run)
    except StoreError:
        return []
    return [tracker for tracker in data.trackers if (tracker, data.slowest) in known]


def _model(tables: TrainingTables) -> NoiseModel | str:
    """A model, or why there is none."""
    try:
        return NoiseModel.fitted_to(tables)
    except SettingsError as error:
        return str(error)


def _folder(data: ReportData) -> Path:
    return data.run.path / "statistics" / _FOLDER


def _path(data: ReportData, tracker: str) -> str:
    """Where the model of a tracker is, relative to the run."""
    return f"statistics/{_FOLDER}/{data.slug(tracker)}@{data.slowest}.noise.json"


def _inputs(data: ReportData) -> str:
    """Hash of everything that models are fitted to, and of the program that fits them."""
    entries = sorted(data.manifest.sequences.items())
    stated = [
        _program(),
        *data.manifest.experiment_sha256,
        *(f"{key} {sorted(entry.sha256.items())} {entry.group}" for key, entry in entries),
    ]
    return hashlib.sha256("\n".join(stated).encode()).hexdigest()


@cache
def _program() -> str:
    """Hash of the source files of the package: a change of how models are fitted does not need a new version."""
    folder = Path(__file__).parents[1]
    files = [(path.relative_to(folder).as_posix(), path.read_bytes()) for path in sorted(folder.rglob("*.py"))]
    digests = [f"{name} {hashlib.sha256(content).hexdigest()}" for name, content in files]
    return hashlib.sha256("\n".join(digests).encode()).hexdigest()
