"""What to write for each estimator: all exports of the noise models of a run, for the selector of the page."""

import base64
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from tracknoise.estimators.export_render import export
from tracknoise.estimators.exports import FAMILIES, Target, estimators, refused
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.report.settings_picker import Picker
from tracknoise.text import browser_json

_OPTIONS = {
    "focal length": "--focal FOCAL_PX --allow lens",
    "rate": "--rate HZ --allow unchecked",
    "observations": "--tracks RUN",
}
"""Options of the command line for what a model does not know."""
_AS_SHIPPED = Target()


@dataclass(frozen=True, slots=True)
class Choice:
    """A group of estimators to choose from: its title, and their names with their titles."""

    title: str
    estimators: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Exports:
    """What the section shows.

    Attributes
    ----------
    trackers
        Names of those with a model.
    missing
        Why others have none, by name.
    choices
        Estimators in groups; those without an export last.
    first
        The estimator that is shown at first.
    packed
        Base64 of the zlib-compressed JSON of `files`, by tracker what `exported` returns; `paths` of models, and the
        choices of the picker.
    """

    trackers: tuple[str, ...]
    missing: Mapping[str, str]
    choices: tuple[Choice, ...]
    packed: str
    first: str


def exports(picker: Picker, *, missing: Mapping[str, str], paths: Mapping[str, str]) -> Exports:
    """Exports of all models of a run, for every estimator, and what can be picked on the first screen."""
    first, target, models = picker.first, picker.target, picker.models
    files = {tracker: exported(model, paths[tracker], {first: target}) for tracker, model in models.items()}
    content = {"files": files, "paths": dict(paths), **picker.choices()}
    return Exports(
        trackers=tuple(models), missing=missing, choices=tuple(_choices()), packed=_packed(content), first=first
    )


def _choices() -> Iterator[Choice]:
    for family, title in FAMILIES.items():
        yield Choice(title, {name: about.title for name, about in estimators().items() if about.family == family})
    yield Choice("No export", {name: about.title for name, about in refused().items()})


def exported(
    model: NoiseModel, path: str, targets: Mapping[str, Target] = MappingProxyType({})
) -> dict[str, dict[str, Any]]:
    """What is written for each estimator; `targets`: windows and features of those that are not as shipped.

    Returns by estimator: `files`, pairs of names and contents, the patch last; `text`, what they are; or, where nothing
    can be written, `why` and, if options of the command line can state what is missing, `command`.
    """
    written = {
        name: _export(model, name, path, target)
        for name in estimators()
        for target in (targets.get(name, _AS_SHIPPED),)
    }
    return written | {name: {"why": about.why} for name, about in refused().items()}


def _export(model: NoiseModel, name: str, path: str, target: Target) -> dict[str, Any]:
    try:
        output = export(model, name, target=target, source=path.rpartition("/")[2])
    except SettingsError as error:
        unknown = _unknown(model, estimators()[name].needs)
        command = " ".join([f"tracknoise export {path} --to {name}", *(_OPTIONS[need] for need in unknown)])
        return {"why": str(error), **({"command": command} if unknown else {})}
    patch = [] if output.patch is None else [(f"{name}.patch", output.patch)]
    return {"files": [*output.files.items(), *patch], "text": output.text}


def _unknown(model: NoiseModel, needs: Sequence[str]) -> list[str]:
    """What an estimator needs and the run does not know. Observations are never part of a page."""
    facts = {"focal length": model.camera.focal_px, "rate": model.camera.rate_hz}
    return [need for need in needs if facts.get(need) is None]


def _packed(content: Mapping[str, Any]) -> str:
    return base64.b64encode(zlib.compress(browser_json(content).encode(), 9)).decode()
