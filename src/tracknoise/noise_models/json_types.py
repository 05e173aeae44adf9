"""How values of a noise model that JSON does not know are written in it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import GetPydanticSchema
from pydantic_core import CoreSchema, core_schema


def as_covariance() -> GetPydanticSchema:
    """Two rows of two numbers."""
    number = core_schema.float_schema(allow_inf_nan=False)
    row = core_schema.list_schema(number, min_length=2, max_length=2)
    rows = core_schema.list_schema(row, min_length=2, max_length=2)
    return _converted(rows, _covariance, lambda array: array.tolist())


def as_degrees() -> GetPydanticSchema:
    """A positive number, or null for infinity."""
    number = core_schema.nullable_schema(core_schema.float_schema(gt=0.0, allow_inf_nan=False))
    return _converted(number, lambda found: math.inf if found is None else found, _finite_or_none)


def _converted(schema: CoreSchema, read: Callable[[Any], Any], write: Callable[[Any], Any]) -> GetPydanticSchema:
    written = core_schema.plain_serializer_function_ser_schema(write)
    found = core_schema.no_info_after_validator_function(read, schema, serialization=written)
    return GetPydanticSchema(lambda _kind, _handler: found)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _covariance(rows: list[list[float]]) -> NDArray[np.float64]:
    covariance = np.array(rows)
    if covariance[0, 1] != covariance[1, 0] or np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.trace(covariance):
        raise ValueError("a symmetric matrix without negative eigenvalues")
    return covariance
