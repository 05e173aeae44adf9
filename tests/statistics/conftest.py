from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.tables.schema import FRAME_COUNTS, OBSERVATIONS, TRACKS, Schema

Build = Callable[..., pl.DataFrame]

ORIGIN = {
    "dataset": "d",
    "scene": "a",
    "lighting": "nominal",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
    "speed": 1,
}
POSITIONS = {"u_px": 0.0, "v_px": 0.0, "u_true_px": 0.0, "v_true_px": 0.0}
OBSERVATION = ORIGIN | POSITIONS | {
    "track": 0, "frame": 0, "age": 0, "truth": "valid", "du_px": 0.0, "dv_px": 0.0, "kept": True,
}  # fmt: skip
TRACK = ORIGIN | {
    "track": 0, "first_frame": 0, "lifetime": 1, "end": "lost",
    "response": None, "depth_m": None, "gradient_rad": None,
    "edge_px": None, "edge_side": None, "incidence_deg": None, "max_error_px": None, "kept": True,
}  # fmt: skip
FRAME = ORIGIN | {"frame": 0, "offered": 0, "matched": 0, "outliers": 0, "new": 0, "alive": 0}


def _builder(schema: Schema, defaults: dict[str, object]) -> Build:
    def build(**columns: object) -> pl.DataFrame:
        """A table of the schema: lists give the rows, single values and defaults fill every row."""
        height = next(len(value) for value in columns.values() if isinstance(value, list))
        values = defaults | columns
        filled = {name: value if isinstance(value, list) else [value] * height for name, value in values.items()}
        return pl.DataFrame({name: filled[name] for name in schema}, schema=dict(schema))

    return build


@pytest.fixture(scope="session")
def observations() -> Build:
    return _builder(OBSERVATIONS, OBSERVATION)


@pytest.fixture(scope="session")
def tracks() -> Build:
    return _builder(TRACKS, TRACK)


@pytest.fixture(scope="session")
def frames() -> Build:
    return _builder(FRAME_COUNTS, FRAME)
