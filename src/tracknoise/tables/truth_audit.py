"""The audit of the truth of a run: what it says about each parameter, and errors before and after corrections."""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

import polars as pl

from tracknoise.tables.findings_schema import RESAMPLED
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.store import RunFolder


class AuditVerdict(StrEnum):
    """What an audit says about a parameter of the truth.

    fault: the truth is wrong in it. explained: it looked wrong, but not established once the named faults are
    corrected. like_bias: what it explains cannot be distinguished from a bias of the trackers. disagreement: trackers
    contradict each other. small: another value fits better, but explains next to nothing. none: no fault.
    undetermined: its interval is too wide for an answer, or what it explains is not established. not_tried: it is right
    by construction.
    """

    fault = "fault"
    explained = "explained"
    like_bias = "like_bias"
    disagreement = "disagreement"
    small = "small"
    none = "none"
    undetermined = "undetermined"
    not_tried = "not_tried"


MEASURED, EVERYTHING = "measured", "all"
"""Corrections in `AUDIT_CURVES` besides the names of parameters: none, and all of them."""

AUDIT = RunTable(
    "audit",
    {
        "dataset": pl.String,
        "rank": pl.Int32,
        **dict.fromkeys(("family", "parameter", "component", "unit"), pl.String),
        **dict.fromkeys(("stated", "value", "low", "high", "in_frames", "level"), pl.Float64),
        "resampled": RESAMPLED,
        "n_units": pl.Int32,
        "n_scenes": pl.Int32,
        "n": pl.Int64,
        **dict.fromkeys(("p", "gain", "gain_low", "gain_high"), pl.Float64),
        **dict.fromkeys(("second_moment_share", "condition", "correlation"), pl.Float64),
        "correlated_with": pl.String,
        "visible_above": pl.Float64,
        "verdict": pl.Enum(AuditVerdict),
        "text": pl.String,
    },
)
"""One row per number of every fit: its corrected value beside the stated one, and what the correction explains.

`family` is one of `tracknoise.truth_faults.fault_parameters.Family`. Rows of the family `alone` have the verdict on the
parameter, its sentence, and `visible_above`: 90 % of the errors of this size would have been named; null where none
would, or poses are refined and may absorb one. What was not tried has no numbers. rank numbers the named faults from 1.
p is adjusted for all parameters by Holm's method in the families `alone` and `beside_bias`. gain is the share of the
second moment in scaled units, outliers cut, that the correction removes from held-out units; in the family
`beside_bias` beyond what biases of the trackers remove. second_moment_share is the share of the second moment in px^2
that it removes, outliers left out. condition is the condition number of the fit. correlation is the largest one of the
number in this fit, and `correlated_with` the other number. in_frames is the value of times in frame intervals, as they
are fitted. `moved` in the family `at_most` is (truth.moved), null where that has no bound.

A run that could not be audited has one row, with the reason in its text.
"""

AUDIT_CURVES = RunTable(
    "audit_curves",
    {
        "dataset": pl.String,
        "tracker": pl.String,
        "correction": pl.String,
        "age": pl.UInt32,
        "n": pl.Int64,
        **dict.fromkeys(("mean_u_px", "mean_v_px"), pl.Float64),
        **dict.fromkeys(("second_uu", "second_vv"), pl.Float64),
        **dict.fromkeys(("core_u_px", "core_v_px", "near_px"), pl.Float64),
    },
)
"""Errors of the audited observations by age: as `measured`, with each named fault corrected, and with `all` of them.

A fault is corrected together with those that were named before it.

A correction is applied to units that took no part in its fit. Outliers are left out of all columns, the same ones for
every correction: errors that are longer, after all corrections, than five times the median length of their tracker
and age. core is 1.4826 times the median absolute error. near_px is the RMS length of those up to three robust scales,
which shares that are explained are of.
"""


class AuditTables(NamedTuple):
    """Tables `AUDIT` and `AUDIT_CURVES`."""

    audit: pl.DataFrame
    audit_curves: pl.DataFrame

    @classmethod
    def of(cls, tables: Mapping[str, pl.DataFrame]) -> "AuditTables":
        """Those among the tables of a run, by their names."""
        return cls(tables[AUDIT.name], tables[AUDIT_CURVES.name])

    @classmethod
    def of_run(cls, run: RunFolder) -> "AuditTables":
        """Those of a run; without rows in runs of earlier versions.

        Raises
        ------
        StoreError, SchemaError
            If the run is not finished, or a file is missing or damaged.
        """
        return cls(run.statistics(AUDIT), run.statistics(AUDIT_CURVES))
