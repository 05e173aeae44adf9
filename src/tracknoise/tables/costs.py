"""What a step of each tracker costs, beside the tables of a run: times are not the same in equal runs."""

import json
from collections.abc import Mapping

from tracknoise.exceptions import StoreError
from tracknoise.tables.store import RunFolder

COSTS_JSON = "costs.json"
"""The document of a run with CPU times of steps, ms, by tracker."""


def write_costs(run: RunFolder, costs: Mapping[str, float]) -> None:
    """Keep the costs in a run folder.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    run.write_statistics({}, documents={COSTS_JSON: json.dumps(dict(costs), indent=1, ensure_ascii=False) + "\n"})


def read_costs(run: RunFolder) -> dict[str, float]:
    """What `write_costs` wrote; empty where it wrote nothing.

    Raises
    ------
    StoreError
        If it is missing or damaged.
    """
    text = run.document(COSTS_JSON)
    try:
        return {} if text is None else {str(tracker): float(cost) for tracker, cost in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        expected = "CPU times of trackers; `tracknoise run` writes them again"
        raise StoreError(f"{run.path / 'statistics' / COSTS_JSON}: damaged ({error}), expected {expected}") from error
