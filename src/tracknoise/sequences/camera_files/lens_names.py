"""How programs call the lens models, and what tracknoise calls them."""

from tracknoise.exceptions import DataError
from tracknoise.sequences.camera_files.entries import Entries

_NAMES = {
    "none": "pinhole",
    "": "radtan",
    "radtan": "radtan",
    "radial-tangential": "radtan",
    "plumb_bob": "radtan",
    "rational_polynomial": "radtan",
    "equidistant": "equidistant",
    "equi": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
}
_MOST_RADTAN = 8
"""OpenCV's further coefficients are those of thin prisms and of a tilted sensor."""


def lens_at(entries: Entries, name: str) -> str:
    """Model of the lens that a key names, as `tracknoise.geometry.lenses.COEFFICIENTS` has it.

    Raises
    ------
    DataError
        If it is a model that tracknoise does not have.
    """
    model = _NAMES.get(entries.text(name))
    if model is None:
        raise entries.error(name, f"one of {', '.join(filter(None, _NAMES))}")
    return model


def coefficients_at(entries: Entries, name: str | None, model: str) -> tuple[float, ...]:
    """Coefficients of the lens; none where there is no key, or where all of radial-tangential distortion are 0.

    Raises
    ------
    DataError
        If they are no list of numbers, or are of thin prisms or a tilted sensor.
    """
    coefficients = () if name is None else entries.numbers(name)
    if model == "equidistant":
        return coefficients
    if any(coefficients[_MOST_RADTAN:]):
        found = f"{name} with coefficients of thin prisms or a tilted sensor"
        raise DataError(entries.place, found, "the first 8 alone (k1, k2, p1, p2, k3, k4, k5, k6)")
    return coefficients[:_MOST_RADTAN] if any(coefficients) else ()
