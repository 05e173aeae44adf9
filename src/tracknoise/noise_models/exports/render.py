"""Exports of a noise model: templates of estimators filled with its numbers."""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.exports import wording
from tracknoise.noise_models.exports.conversion import converted
from tracknoise.noise_models.exports.estimators import Estimator, estimator
from tracknoise.noise_models.exports.export import Export, Target
from tracknoise.noise_models.exports.noise import Noise
from tracknoise.noise_models.model import Purpose

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel

_DIGITS, _MORE_DIGITS = 3, 6


def export(
    model: "NoiseModel",
    name: str,
    *,
    target: Target | None = None,
    source: str = "a noise model",
    observations: str | None = None,
) -> Export:
    """Write the noise of a model in the syntax of an estimator.

    Parameters
    ----------
    model
        What to write.
    name
        Of the estimator: see `estimators.estimators`.
    target
        Camera, rate, window and purpose. By default, those of the model and what is usual for the estimator.
    source
        Name of the file of the model, for the first line of each file.
    observations
        Covariances of observations, CSV: what ``csv`` writes.

    Raises
    ------
    SettingsError
        If the estimator takes no noise of tracks, the focal length or the rate cannot be converted, or the estimator
        needs what is not given.
    UnknownNameError
        If the estimator is not known.
    """
    about, wanted = estimator(name), target or Target()
    at = converted(model, wanted)
    noise = Noise(at.model, about.landmark, wanted.window or about.window, _purpose(about, wanted))
    camera = at.model.camera
    known = {"focal length": camera.focal_px, "rate": camera.rate_hz, "observations": observations}
    _require_known(about, known)
    if about.family == "data" and at.caveats:
        raise SettingsError(f"{about.title}: found another focal length or rate, expected those of the model")
    header = wording.header(noise, source, model.sha256)
    values = {"noise": noise, "camera": camera, "header": header, "model": model, "observations": observations}
    caveats = (*camera.notes, *at.caveats, *wording.caveats(about, noise))
    return Export(
        files={file: _filled(template, values) for file, template in about.files.items()},
        text=wording.text(about, header, (*caveats, *about.notes)),
        patch=None if about.patch is None else _filled(about.patch, values),
        caveats=caveats,
    )


def _purpose(about: Estimator, wanted: Target) -> Purpose | None:
    return about.purpose and (wanted.purpose or about.purpose)


def _require_known(about: Estimator, known: Mapping[str, object]) -> None:
    expected = {
        "focal length": "that of its camera, with `--focal`",
        "rate": "frames per second, with `--rate`",
        "observations": "tracks, with `--tracks`",
    }
    for need in about.needs:
        if known[need] is None:
            raise SettingsError(f"{about.title}: no {need}, expected {expected[need]}")


def _filled(template: str, values: Mapping[str, object]) -> str:
    return _environment().from_string(template).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("tracknoise.noise_models.exports", "shared"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: number(value) if isinstance(value, float) else value,
    )
    environment.filters |= {"precise": _precise, "rows": _rows, "entries": _entries}
    return environment


def number(value: float, digits: int = _DIGITS) -> str:
    """Write a number as JSON, YAML, C++ and Python all read it, with a point: ``0.100``, ``1.00e-05``."""
    text = f"{value:#.{digits}g}"
    return f"{text}0" if text.endswith(".") else text


def _precise(value: float) -> str:
    """A number that is not measured, such as a focal length."""
    return number(value, _MORE_DIGITS)


def _rows(matrix: NDArray[np.float64]) -> str:
    """A matrix as a nested list, as Python has it."""
    return "[" + ", ".join(f"[{_entries(matrix[row])}]" for row in range(len(matrix))) + "]"


def _entries(matrix: NDArray[np.float64]) -> str:
    """All numbers of a matrix, row by row, with commas between them."""
    return ", ".join(map(_precise, matrix.ravel().tolist()))
