"""Columns of the tables of the audit of the truth: what it is made from, and what it finds."""

from enum import StrEnum

import polars as pl

from tracknoise.tables.enumerations import Resampled
from tracknoise.tables.schema import ORIGIN, SEQUENCE, Schema


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

CAMERAS: Schema = {
    **SEQUENCE,
    "frame": pl.UInt32,
    "time_s": pl.Float64,
    "model": pl.String,
    "width": pl.Int32,
    "height": pl.Int32,
    **dict.fromkeys(("fx_px", "fy_px", "cx_px", "cy_px"), pl.Float64),
    "distortion": pl.List(pl.Float64),
    "readout_s": pl.Float64,
    "shutter_axis": pl.UInt8,
}
"""One row per frame: its time and its camera, a model of `tracknoise.geometry.lenses`.

time_s is null where times are unknown. What describes the lens is null for other models, and the two columns of the
shutter where all rows of an image are exposed together.
"""

PATH: Schema = {
    **SEQUENCE,
    "time_s": pl.Float64,
    **dict.fromkeys(("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"), pl.Float64),
}
"""World from camera at the times of a recording at which the run has no frame, see `POSES`."""

AUDIT_SAMPLES: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "track": pl.UInt32,
    "birth_frame": pl.UInt32,
    "frame": pl.UInt32,
    "age": pl.UInt32,
    **dict.fromkeys(("birth_time_s", "time_s"), pl.Float64),
    **dict.fromkeys(("u_birth_px", "v_birth_px", "depth_m"), pl.Float64),
    **dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), pl.Float64),
}
"""A few visible observations of each tracker at the lowest speed, at most two per track, with what the truth states.

birth is the frame in which the feature got its true position: the first of its track, or the key frame of a scan.
u_birth and depth are its position and its depth there, age the number of frames between the two.
"""

AUDIT: Schema = {
    "dataset": pl.String,
    "rank": pl.Int32,
    "family": pl.String,
    "parameter": pl.String,
    "component": pl.String,
    "unit": pl.String,
    "stated": pl.Float64,
    "value": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "in_frames": pl.Float64,
    "level": pl.Float64,
    "resampled": pl.Enum(Resampled),
    "n_units": pl.Int32,
    "n_scenes": pl.Int32,
    "n": pl.Int64,
    "p": pl.Float64,
    "gain": pl.Float64,
    "gain_low": pl.Float64,
    "gain_high": pl.Float64,
    "second_moment_share": pl.Float64,
    "condition": pl.Float64,
    "correlation": pl.Float64,
    "correlated_with": pl.String,
    "visible_above": pl.Float64,
    "verdict": pl.Enum(AuditVerdict),
    "text": pl.String,
}
"""One row per number of every fit: its corrected value beside the stated one, and what the correction explains.

`family` is one of `tracknoise.audit.parameters.Family`. Rows of the family `alone` have the verdict on the parameter,
its sentence, and `visible_above`: 90 % of the errors of this size would have been named; null where none would. What
was not tried has no numbers. rank numbers the named faults from 1. p is adjusted for all parameters by Holm's method in
the families `alone` and `beside_bias`. gain is the share of the second moment in scaled units, outliers cut, that the
correction removes from held-out units; in the family `beside_bias` beyond what biases of the trackers remove.
second_moment_share is the share of the second moment in px^2 that it removes, outliers left out. condition is the
condition number of the fit. correlation is the largest one of the number in this fit, and `correlated_with` the other
number. in_frames is the value of times in frame intervals.

A run that could not be audited has one row, with the reason in its text.
"""

AUDIT_CURVES: Schema = {
    "dataset": pl.String,
    "tracker": pl.String,
    "correction": pl.String,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("mean_u_px", "mean_v_px"), pl.Float64),
    **dict.fromkeys(("second_uu", "second_vv"), pl.Float64),
    **dict.fromkeys(("core_u_px", "core_v_px"), pl.Float64),
}
"""Errors of the audited observations by age: as `measured`, with each named fault corrected, and with `all` of them.

A fault is corrected together with those that were named before it.

A correction is applied to units that took no part in its fit. Outliers are left out of all columns, the same ones for
every correction: errors that are longer, after all corrections, than five times the median length of their tracker
and age. core is 1.4826 times the median absolute error.
"""
