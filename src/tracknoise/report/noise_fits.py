"""The noise models of a run at its lowest speed, fitted once: a second report reads what the first one wrote.

Models are kept in ``statistics/noise``, with a hash of what they were fitted to. They are fitted again if the tables of
the run have changed since, or another version of the tool fitted them.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from tracknoise.exceptions import DataError, SettingsError, StoreError
from tracknoise.noise_models.fitting.training_tables import conditions
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.report.report_data import ReportData
from tracknoise.tables.files import remove, write_atomically

_FOLDER, _INPUTS = "noise", "inputs.sha256"


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
    trackers = _measured(data)
    found = dict(_fits(data, trackers)) if trackers else {}
    models = {tracker: model for tracker, model in found.items() if isinstance(model, NoiseModel)}
    missing = {tracker: why for tracker, why in found.items() if isinstance(why, str)}
    return NoiseFits(models, missing, {tracker: _path(data, tracker) for tracker in models})


def _path(data: ReportData, tracker: str) -> str:
    return f"statistics/{_FOLDER}/{data.slug(tracker)}@{data.slowest}.noise.json"


def _measured(data: ReportData) -> list[str]:
    """Trackers with sums at the lowest speed; none where a run has no sums."""
    try:
        known = conditions(data.run)
    except StoreError:
        return []
    return [tracker for tracker in data.trackers if (tracker, data.slowest) in known]


def _kept(data: ReportData) -> bool:
    """Whether the models that are there are of these tables. If not, they are no longer said to be."""
    path, wanted = _folder(data) / _INPUTS, _inputs(data)
    if path.is_file() and path.read_text() == wanted:
        return True
    remove(path)
    return False


def _fits(data: ReportData, trackers: Sequence[str]) -> Iterator[tuple[str, NoiseModel | str]]:
    kept = _kept(data)
    for tracker in trackers:
        yield tracker, _model(data, tracker, kept)
    if not kept:
        write_atomically(_folder(data) / _INPUTS, _inputs(data).encode())


def _model(data: ReportData, tracker: str, kept: bool) -> NoiseModel | str:
    path = data.run.path / _path(data, tracker)
    if kept:
        try:
            return NoiseModel.read(path)
        except DataError:
            pass  # missing or damaged: fitted again
    try:
        model = NoiseModel.fit(data.run.path, tracker=tracker, speed=data.slowest)
    except SettingsError as error:
        return str(error)
    model.write(path)
    return model


def _folder(data: ReportData) -> Path:
    return data.run.path / "statistics" / _FOLDER


def _inputs(data: ReportData) -> str:
    """Hash of everything that models are fitted to, and of the version that fits them."""
    entries = sorted(data.manifest.sequences.items())
    stated = [
        version("tracknoise"),
        *data.manifest.experiment_sha256,
        *(f"{key} {sorted(entry.sha256.items())} {entry.group}" for key, entry in entries),
    ]
    return hashlib.sha256("\n".join(stated).encode()).hexdigest()
