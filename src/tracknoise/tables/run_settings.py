"""The settings of a run as its ``experiment.toml`` has them, as far as those need them who read a run."""

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from tracknoise.problems import in_one_line
from tracknoise.tables.enumerations import Population, Trimming
from tracknoise.toml_text import parse_toml

if TYPE_CHECKING:
    from pydantic import TypeAdapter


@dataclass(frozen=True, slots=True)
class _Dataset:
    lightings: list[str] | None = None
    frames: tuple[int, int] | tuple[int, int, int] | None = None
    groups: dict[str, list[str]] | None = None


@dataclass(frozen=True, slots=True)
class _Tracker:
    kind: str
    name: str | None = None
    options: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class _Truth:
    population: Population
    corrections: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class _Statistics:
    min_features: int


@dataclass(frozen=True, slots=True)
class _Findings:
    trimming: Trimming


@dataclass(frozen=True, slots=True)
class _Settings:
    """Settings without a default are those that every experiment has. There may be others."""

    name: str
    keep: str
    dataset: _Dataset
    trackers: list[_Tracker]
    truth: _Truth
    statistics: _Statistics
    findings: _Findings
    paper: str | None = None


def parse_run_settings(text: str) -> dict[str, Any]:
    """What the resolved settings of a run are, by their keys.

    Raises
    ------
    ValueError
        If a setting that every experiment has is missing, or one has a wrong type. The message is one line.
    """
    from pydantic import ValidationError

    settings = parse_toml(text)
    try:
        _adapter().validate_python(settings)
    except ValidationError as error:
        raise ValueError(in_one_line(error.errors())) from error
    return settings


@cache
def _adapter() -> "TypeAdapter[_Settings]":
    from pydantic import TypeAdapter

    return TypeAdapter(_Settings)
