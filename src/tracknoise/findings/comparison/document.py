"""A comparison as one JSON document, for programs."""

import json
from dataclasses import asdict
from typing import Any

from tracknoise.findings.comparison.estimands import ESTIMANDS
from tracknoise.findings.comparison.result import Comparison

FORMAT = 1


def comparison_json(comparison: Comparison) -> str:
    """Write a comparison.

    Returns
    -------
    str
        An object with `format`, the fields of `Comparison`, and `estimands`: title, meaning and unit of every statistic
        that occurs. What is missing is null.
    """
    statistics = {row.statistic for row in comparison.rows}
    estimands = {name: asdict(estimand) for name, estimand in ESTIMANDS.items() if name in statistics}
    document: dict[str, Any] = {"format": FORMAT, **asdict(comparison), "estimands": estimands}
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
