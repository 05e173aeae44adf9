"""Roles of the statistics on which the effects of factors are tested."""

from collections.abc import Mapping

from tracknoise.findings.wording import STATISTICS
from tracknoise.statistics.definitions import NAMES

ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items() if role in STATISTICS},
    "core": "core",
    "lifetime": "lifetime",
    "outlier_ratio": "outlier_ratio",
}
"""Role of each statistic, by its name in the tables."""
