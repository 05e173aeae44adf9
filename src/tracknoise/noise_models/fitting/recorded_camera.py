"""The camera of the recordings that a model is fitted to, and where they do not have one in common."""

from collections.abc import Iterable, Mapping, Sequence

import polars as pl

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.model import TOLERANCE, CameraOfModel
from tracknoise.tables.identity import readable


def recorded_camera(cameras: Mapping[str, pl.DataFrame]) -> CameraOfModel:
    """The camera of recordings. What differs by more than `TOLERANCE` is not known of the model, and noted.

    Parameters
    ----------
    cameras
        Schema `CAMERAS`, at least one row each, by the key of the sequence.

    Returns
    -------
    CameraOfModel
        With the image size of the first sequence, and the rate from the median time between two frames.

    Raises
    ------
    SettingsError
        If no sequence has a known focal length.
    """
    focal = [value for table in cameras.values() for value in table["fx_px"].unique().to_list()]
    if not any(focal):
        key = next(iter(cameras))
        raise SettingsError(
            f"noise model: found no focal length of {readable(key)}, expected a camera with a known lens"
        )
    rates = [_rate_hz(table) for table in cameras.values()]
    sizes = {size for table in cameras.values() for size in table.select("width", "height").unique().iter_rows()}
    width, height = next(iter(cameras.values())).select("width", "height").row(0)
    return CameraOfModel(
        width=width,
        height=height,
        focal_px=_common(focal),
        rate_hz=_common(rates),
        notes=(*_differing("focal lengths", focal, "px"), *_differing("rates", rates, "Hz"), *_size_note(sizes)),
    )


def _rate_hz(table: pl.DataFrame) -> float | None:
    step = table["time_s"].diff().median()
    return 1.0 / step if isinstance(step, float) and step > 0.0 else None


def _common(values: Sequence[float | None]) -> float | None:
    """The first of values that are equal to `TOLERANCE`; None where they differ or one is unknown."""
    known = [value for value in values if value is not None]
    same = len(known) == len(values) and max(known) <= (1.0 + TOLERANCE) * min(known)
    return known[0] if same else None


def _differing(what: str, values: Sequence[float | None], unit: str) -> Iterable[str]:
    """A sentence where values differ, or only some are known."""
    known = [value for value in values if value is not None]
    if known and _common(values) is None:
        unknown = "" if len(known) == len(values) else ", and unknown ones"
        shown = f"{min(known):.4g} to {max(known):.4g} {unit}" if min(known) < max(known) else f"{known[0]:.4g} {unit}"
        yield f"It was fitted to recordings with different {what}, {shown}{unknown}: it has none of its own."


def _size_note(sizes: set[tuple[int, int]]) -> Iterable[str]:
    if len(sizes) > 1:
        shown = ", ".join(f"{width} x {height}" for width, height in sorted(sizes))
        yield f"It was fitted to images of different sizes: {shown} px."
