"""Write out every option that an experiment leaves to its defaults, so that its record does not depend on them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

from tracknoise.exceptions import SettingsError, TracknoiseError
from tracknoise.experiments.settings import Experiment, TrackerChoice
from tracknoise.options import as_toml_values
from tracknoise.sequences.registry import make_reader
from tracknoise.trackers.registry import make_tracker
from tracknoise.truth.registry import TRUTHS


def resolve(experiment: Experiment) -> Experiment:
    """Return the same experiment with all options of its trackers and its reader written out.

    Raises
    ------
    SettingsError
        If a tracker, the reader, the kind of truth or an option is unknown, or a value is wrong or has control
        characters; the message names the section.
    """
    dataset = experiment.dataset
    with _errors_of("dataset"):
        reader = as_toml_values(asdict(make_reader(dataset.reader, dataset.root, dataset.options)))  # type: ignore[call-overload]
    reader.pop("root", None)
    if experiment.truth.second is not None:
        with _errors_of("truth.second.options"):
            make_reader(dataset.reader, dataset.root, {**dataset.options, **experiment.truth.second.options})
    if experiment.truth.kind is not None:
        with _errors_of("truth.kind"):
            TRUTHS.load(experiment.truth.kind)
    resolved = experiment.model_copy(
        update={
            "dataset": dataset.model_copy(update={"options": reader}),
            "trackers": [_resolved(choice, f"trackers[{i}]") for i, choice in enumerate(experiment.trackers)],
        }
    )
    try:
        resolved.require_printable()  # folders may have been given on the command line
    except ValueError as error:
        raise SettingsError(str(error)) from error
    return resolved


def with_tracker_defaults(experiment: Experiment) -> Experiment:
    """Return the experiment of a run with the options that its trackers did not have yet when it was measured.

    The default of an option that is added later is what trackers did before. Options that cannot be read are left as
    they are.
    """
    try:
        trackers = [_resolved(choice, f"trackers[{i}]") for i, choice in enumerate(experiment.trackers)]
    except SettingsError:
        return experiment
    return experiment.model_copy(update={"trackers": trackers})


def _resolved(choice: TrackerChoice, section: str) -> TrackerChoice:
    with _errors_of(section):
        options = as_toml_values(asdict(make_tracker(choice.kind, choice.options)))  # type: ignore[call-overload]
    return choice.model_copy(update={"options": options})


@contextmanager
def _errors_of(section: str) -> Iterator[None]:
    try:
        yield
    except TracknoiseError as error:
        raise SettingsError(f"{section}: {error}") from error
