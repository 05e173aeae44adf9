"""Findings of a made-up run, written down rather than worked out: what reads them is tested, not what they say."""

import math
from collections.abc import Mapping

import polars as pl

from tracknoise.analysis.factors import DEPENDENCE
from tracknoise.analysis.gaussianity import GAUSSIANITY, RADII
from tracknoise.analysis.lifetime_intervals import INCIDENCE
from tracknoise.analysis.seed_spread import SEED_SPREAD
from tracknoise.analysis.time_structure import TIME_STRUCTURE
from tracknoise.analysis.truth_shares import TRACKER_DIFFERENCES
from tracknoise.analysis.zero_mean import ZERO_MEAN
from tracknoise.estimators.depth_intervals import DEPTH_INTERVALS
from tracknoise.estimators.lookup_table import NOISE_LOOKUP
from tracknoise.estimators.run_models import ADVICE
from tracknoise.estimators.window_noise import WINDOW_SIGMAS
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.lifetimes import mean_lifetime, median_survival
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.schema import CAUSES, Schema, empty
from tracknoise.tables.trust import TRUST
from tracknoise.tables.truth_audit import AUDIT, AUDIT_CURVES
from tracknoise.truth_faults.pose_accuracy import POSE_LAW, POSE_SHARE, RIGID_SHARE

BANDS = ((1, 4), (5, 9), (10, 19))
PROBABILITIES = (0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999)
AUDITED = "The stated focal length is 10 % too long (100 ± 2 px instead of 110)."
LIMITED = "Errors of the truth can explain up to 12.0 % of the squared errors."
FEW = "a test at 5 % needs at least 6 scenes; this one has {} scenes"


def made_up(tables: Mapping[str, pl.DataFrame], *, population: str) -> dict[str, pl.DataFrame]:
    """All findings for the statistics of a run but sentences: intervals are a tenth of the value to either side."""
    return {
        "intervals": intervals(tables, population=population),
        "seed_spread": empty(SEED_SPREAD),
        "incidence": incidence(tables["lifetimes"]),
        "zero_mean": zero_mean(tables["curves"], population=population),
        "gaussianity": gaussianity(tables["curves"]),
        "radii": radii(tables["curves"]),
        "time_structure": time_structure(tables["curves"]),
        "window_sigmas": window_sigmas(tables["curves"]),
        "advice": advice(tables["curves"]),
        "noise_lookup": noise_lookup(tables["curves"]),
        "depth_intervals": depth_intervals(tables["curves"]),
        "dependence": dependence(tables["effects"]),
        "rigid_share": rigid_share(tables["curves"]),
        "pose_share": pose_share(tables["curves"]),
        "pose_law": pose_law(tables["curves"]),
        "tracker_differences": tracker_differences(tables["curves"]),
        "audit": audit(),
        "audit_curves": audit_curves(tables["curves"]),
        "trust": trust(),
    }


def intervals(tables: Mapping[str, pl.DataFrame], *, population: str) -> pl.DataFrame:
    curves = tables["curves"].filter(population=population)
    names = [name for name in curves.columns if name not in ("u", "v", "uv", "cut")]
    long = curves.unpivot(["u", "v", "uv"], index=names, variable_name="coordinate", value_name="value")
    parts = [long.filter(pl.col("value").is_not_null()).with_columns(aspect=pl.lit("all"))]
    lifetimes = tables["lifetimes"]
    survival = {"statistic": pl.lit("survival"), "axis": pl.lit("lifetime"), "at": "lifetime", "value": "survival"}
    parts.append(lifetimes.with_columns(**survival))
    halves = median_survival(lifetimes).with_columns(value="median_lifetime")
    scalars = {
        "outlier_ratio": (tables["outliers"].with_columns(value="pooled_ratio"), "share"),
        "median_lifetime": (halves, "frames"),
        "mean_lifetime": (mean_lifetime(lifetimes).with_columns(value="mean_lifetime"), "frames"),
    }
    parts += [table.with_columns(statistic=pl.lit(name), unit=pl.lit(unit)) for name, (table, unit) in scalars.items()]
    typed = [_typed(part.with_columns(aspect=pl.lit("all")), INTERVALS) for part in parts]
    room = 0.1 * pl.col("value").abs()
    return (
        pl.concat(typed)
        .drop_nulls("value")
        .with_columns(
            low=pl.col("value") - room,
            high=pl.col("value") + room,
            kind=pl.lit("bca", dtype=INTERVALS["kind"]),
            level=pl.lit(0.95),
            resampled=_resampled(INTERVALS),
            n_units=pl.lit(16, dtype=pl.Int32),
        )
    )


def incidence(lifetimes: pl.DataFrame) -> pl.DataFrame:
    """The shares of all tracks that ended by each cause, as if none were censored."""
    counts = lifetimes.unpivot(
        [f"n_{cause}" for cause in CAUSES],
        index=[*POOLED, "lifetime", "n_scenes"],
        variable_name="cause",
        value_name="n",
    ).sort(*POOLED, "cause", "lifetime")
    share = (pl.col("n").cum_sum().over(*POOLED, "cause") / pl.col("n").sum().over(POOLED)).fill_nan(0.0)
    table = counts.with_columns(pl.col("cause").str.strip_prefix("n_"), incidence=share)
    return _typed(
        table.with_columns(
            low=0.9 * share,
            high=1.1 * share,
            kind=pl.lit("bca", dtype=INTERVALS["kind"]),
            level=pl.lit(0.95),
            resampled=_resampled(INCIDENCE),
            n_units=pl.lit(16, dtype=pl.Int32),
        ),
        INCIDENCE,
    )


def zero_mean(curves: pl.DataFrame, *, population: str) -> pl.DataFrame:
    signed = pl.col("statistic").is_in(["nu", "mu"])
    length = (pl.col("u") ** 2 + pl.col("v") ** 2).sqrt()
    ages = curves.filter(signed, population=population, weighting="scenes").with_columns(
        mean_u_px="u", mean_v_px="v", effect_px=length, share_of_second=pl.lit(0.02)
    )
    enough = pl.col("n_scenes") >= 6
    tested = {
        name: pl.when(enough).then(pl.lit(p))
        for name, p in (
            ("sign_flip_p", 0.012),
            ("sign_flip_p_adjusted", 0.024),
            ("sign_flip_p_family", 0.024),
            ("hotelling_p", 0.02),
            ("level", 0.95),
        )
    }
    verdict = pl.when(enough).then(pl.lit("yes")).otherwise(pl.lit("undecided")).cast(ZERO_MEAN["verdict"])
    why = pl.when(~enough).then(pl.format(FEW, pl.col("n_scenes")))
    ages = _typed(ages, ZERO_MEAN).with_columns(**tested, iid_p=pl.lit(1e-9), verdict=verdict, why=why)
    overall = ages.group_by(*POOLED, "trimming", "axis", maintain_order=True).agg(
        pl.all().exclude(*POOLED, "trimming", "axis").first()
    )
    overall = overall.with_columns(at=pl.lit(None, dtype=pl.Int64)).select(ages.columns)
    return pl.concat([ages, overall])


def gaussianity(curves: pl.DataFrame) -> pl.DataFrame:
    values = {
        "n": 5000, "n_sampled": 500, "skewness": 0.1, "kurtosis": 31.0, "kurtosis_low": 25.0, "kurtosis_high": 40.0,
        "tail_99": 2.4, "tail_999": 11.0, "gain_student_nats": 0.41, "gain_student_low": 0.35,
        "gain_student_high": 0.47, "gain_mixture_nats": 0.38, "gain_mixture_low": 0.3, "gain_mixture_high": 0.45,
        "student_nu": 2.1, "student_scale_px": 0.1, "mixture_share": 0.1, "mixture_ratio": 9.0, "level": 0.95,
    }  # fmt: skip
    trimmed = pl.col("trimming") == "trimmed"
    verdict = pl.when(trimmed).then(pl.lit("light-tailed")).otherwise(pl.lit("heavy-tailed"))
    table = _banded(curves).with_columns(pl.lit(value).alias(name) for name, value in values.items())
    table = table.with_columns(resampled=_resampled(GAUSSIANITY), verdict=verdict.cast(GAUSSIANITY["verdict"]))
    return _typed(table, GAUSSIANITY)


def radii(curves: pl.DataFrame) -> pl.DataFrame:
    expected = [math.sqrt(-2 * math.log(1 - p)) for p in PROBABILITIES]
    points = pl.DataFrame({"probability": PROBABILITIES, "expected": expected})
    observed = pl.col("expected") ** pl.when(pl.col("trimming") == "trimmed").then(0.9).otherwise(1.6)
    return _typed(_banded(curves).join(points, how="cross").with_columns(observed=observed), RADII)


def time_structure(curves: pl.DataFrame) -> pl.DataFrame:
    walk = {"white_px": 0.05, "walk_px_per_sqrt_frame": 0.09, "drift_px_per_frame": 0.0}
    walk = {**walk, **{f"{name}_geometric": value for name, value in walk.items()}}
    walk |= {"autocorrelation": -0.03, "growth_ratio": 1.5}
    bounds = {
        f"{name}{end}": value + step
        for name, value in walk.items()
        for end, step in (("", 0.0), ("_low", -0.02), ("_high", 0.02))
    }
    table = _conditions(curves).join(pl.DataFrame({"coordinate": ["u", "v"]}), how="cross")
    table = table.with_columns(pl.lit(value).alias(name) for name, value in bounds.items()).with_columns(
        n_ages=pl.lit(12),
        level=pl.lit(0.95),
        resampled=_resampled(TIME_STRUCTURE),
        growth_from=pl.lit(1),
        growth_to=pl.lit(10),
        grows=pl.lit("yes", dtype=TIME_STRUCTURE["grows"]),
        verdict=pl.lit("random walk", dtype=TIME_STRUCTURE["verdict"]),
        why=pl.lit("random walk: 0.09 px per sqrt(frame)"),
    )
    return _typed(table, TIME_STRUCTURE)


def noise_lookup(curves: pl.DataFrame) -> pl.DataFrame:
    """A table by tracker that is better than one covariance for all."""
    row = {
        "product": "error", "lookup": "tracker", "against": "one for all",
        "n": 90_000, "gain_nats": 0.4, "low": 0.3, "high": 0.5, "kind": "student", "level": 0.95,
        "resampled": "scenes", "n_units": 8, "n_scenes": 8, "established": True,
        "factor": 1.2, "factor_low": 1.1, "factor_high": 1.4,
        "factor_against": 2.1, "factor_against_low": 1.7, "factor_against_high": 2.6, "why": None,
    }  # fmt: skip
    rows = [{"dataset": dataset, **row} for dataset in curves["dataset"].unique()]
    return pl.DataFrame(rows, schema=dict(NOISE_LOOKUP))


def window_sigmas(curves: pl.DataFrame) -> pl.DataFrame:
    """Residuals of 0.1 px in all windows, and a sigma for depths that grows with their length."""
    windows = pl.DataFrame({"window": [3, 5, 10, 15]})
    values = {
        "residual_sigma": pl.lit(0.12),
        "residual_core": pl.lit(0.1),
        "consistent_sigma": 0.1 + 0.01 * pl.col("window"),
        "core_overconfidence": 1.0 + 0.1 * pl.col("window"),
        "depth_share": pl.lit(0.8),
    }
    table = _conditions(curves).join(windows, how="cross")
    rows = [table.with_columns(quantity=pl.lit(name), value=value) for name, value in values.items()]
    made = pl.concat(rows).with_columns(
        n=pl.lit(200), low=0.9 * pl.col("value"), high=1.1 * pl.col("value"), level=pl.lit(0.95),
        resampled=_resampled(WINDOW_SIGMAS),
    )  # fmt: skip
    return _typed(made, WINDOW_SIGMAS)


def advice(curves: pl.DataFrame) -> pl.DataFrame:
    """Sigma of 0.2 px for a filter whose innovations suggest 0.1 px, and its gates."""
    values = {"sigma": 0.2, "innovations": 0.1, "track_gate": 0.3, "observation_gate": 0.5}
    table = _conditions(curves).with_columns(
        estimator=pl.lit("filter"), landmark=pl.lit("free"), purpose=pl.lit("newest_pose"), window=pl.lit(11)
    )
    rows = [table.with_columns(quantity=pl.lit(name), value=pl.lit(value)) for name, value in values.items()]
    is_sigma = pl.col("quantity").is_in(["sigma", "innovations"])
    bounds = {name: pl.when(is_sigma).then(factor * pl.col("value")) for name, factor in (("low", 0.9), ("high", 1.1))}
    return _typed(pl.concat(rows).with_columns(**bounds), ADVICE)


def depth_intervals(curves: pl.DataFrame) -> pl.DataFrame:
    """Intervals that hold too few depths with the residual core, and the right share with other noise."""
    held = {"1 px": 1.2, "residual sigma": 0.7, "consistent sigma": 0.98, "whole tracks": 1.0}
    assumed = pl.DataFrame({"covariance": list(held), "sigma_px": [1.0, 0.1, 0.25, None], "share": list(held.values())})
    levels = {"coverage_50": 0.5, "coverage_90": 0.8, "coverage_95": 0.82, "coverage_99": 0.83}
    table = _conditions(curves).join(pl.DataFrame({"window": [5, 10, 15]}), how="cross").join(assumed, how="cross")
    rows = [table.with_columns(quantity=pl.lit(name), value=value * pl.col("share")) for name, value in levels.items()]
    made = pl.concat(rows).with_columns(
        n=pl.lit(200), low=0.9 * pl.col("value"), high=0.5 * (1.0 + pl.col("value")), level=pl.lit(0.95),
        resampled=_resampled(DEPTH_INTERVALS),
    )  # fmt: skip
    return _typed(made, DEPTH_INTERVALS)


def dependence(effects: pl.DataFrame, *, verdict: str = "undecided", n_scenes: int = 2) -> pl.DataFrame:
    enough = n_scenes >= 6
    asked = effects.filter(pl.col("statistic") != "central").drop("unit", "effect", "margin", "at", "coordinate")
    core = asked.filter(pl.col("statistic").is_in(["eta", "kappa"])).with_columns(statistic=pl.lit("core"))
    table = pl.concat([asked, core]).with_columns(
        unit=pl.when(pl.col("statistic").is_in(["nu", "mu"])).then(pl.lit("px")).otherwise(pl.lit("ratio")),
        larger="level_b",
        better="level_a",
        effect=pl.lit(1.5 if enough else None),
        low=pl.lit(1.2 if enough else None),
        high=pl.lit(1.9 if enough else None),
        most=pl.lit(2.1 if enough else None),
        margin=pl.lit(1.1),
        level=pl.lit(0.95),
        n_scenes=pl.lit(n_scenes),
        n_places=pl.when(pl.col("axis").is_not_null()).then(5),
        verdict=pl.lit(verdict, dtype=DEPENDENCE["verdict"]),
        why=pl.lit(None if enough else f"only {n_scenes} scenes, at least 6 are needed"),
    )
    return _typed(table, DEPENDENCE)


def rigid_share(curves: pl.DataFrame) -> pl.DataFrame:
    """Half of the second moment by the other half of the tracks, a quarter by other trackers."""
    sources = pl.DataFrame({"fitted_to": ["own", "others"], "share": [0.5, 0.25]})
    table = _at_ages(curves).join(sources, how="cross").with_columns(
        second_px2=pl.lit(0.8), left_px2=0.8 * (1.0 - pl.col("share")), low=pl.col("share") - 0.1,
        high=pl.col("share") + 0.1, level=pl.lit(0.95), resampled=_resampled(RIGID_SHARE),
    )  # fmt: skip
    coordinates = pl.DataFrame({"coordinate": ["both", "u", "v"]})
    return _typed(table.join(coordinates, how="cross"), RIGID_SHARE)


def pose_share(curves: pl.DataFrame) -> pl.DataFrame:
    """The same shares of all ages together."""
    shares = rigid_share(curves).filter(coordinate="both").unique([*POOLED, "fitted_to"], keep="first")
    return _typed(shares.select(pl.col(name) for name in POSE_SHARE if name in shares.columns), POSE_SHARE)


def pose_law(curves: pl.DataFrame) -> pl.DataFrame:
    """Of each view: a random walk of the rotation, and white noise of the translation."""
    views = _conditions(curves).filter(speed=1).unique([name for name in POOLED if name != "tracker"], keep="first")
    rows = pl.DataFrame(
        {
            "motion": ["rotation", "translation"],
            "law": ["random walk", "white"],
            "unit": ["deg per sqrt(frame)", "m"],
            "value": [0.1, 0.002],
        }
    )
    table = views.sort(POOLED).join(rows, how="cross")
    return _typed(table.with_columns(level=pl.lit(0.95), resampled=_resampled(POSE_LAW)), POSE_LAW)


def tracker_differences(curves: pl.DataFrame) -> pl.DataFrame:
    """Of every two trackers: a mean of 0.1 px and a variance of 0.04 px^2 that grows with age."""
    table = _at_ages(curves)
    names = [name for name in POOLED if name != "tracker"]
    pairs = table.join(table.select(*names, "age", other="tracker"), on=[*names, "age"]).filter(
        pl.col("tracker") < pl.col("other")
    )
    rows = pl.DataFrame(
        {
            "statistic": ["mean", "mean", "central", "central", "central"],
            "coordinate": ["u", "v", "u", "uv", "v"],
            "unit": ["px", "px", "px^2", "px^2", "px^2"],
            "value": [0.1, -0.05, 0.04, 0.0, 0.03],
            "established": [True, False, None, None, None],
        }
    )
    table = pairs.join(rows, how="cross").with_columns(
        low=pl.col("value") - 0.02, high=pl.col("value") + 0.02, level=pl.lit(0.95),
        resampled=_resampled(TRACKER_DIFFERENCES),
    )  # fmt: skip
    return _typed(table, TRACKER_DIFFERENCES)


def trust() -> pl.DataFrame:
    """Errors of the truth are a part of the errors."""
    row = {"dataset": "made-up", "cause": "every", "verdict": "limited", "text": LIMITED, "step": "Use other poses."}
    return pl.DataFrame([row], schema=dict(TRUST))


def audit() -> pl.DataFrame:
    """A focal length that is wrong: the parameter alone, and all faults together."""
    shared = {"dataset": "made-up", "parameter": "focal_length", "component": "", "unit": "px", "stated": 110.0}
    numbers = {"value": 100.0, "low": 98.0, "high": 102.0, "level": 0.95, "n_units": 8, "gain": 0.2, "condition": 1.0}
    alone = {"family": "alone", "rank": 1, "verdict": "fault", "text": AUDITED}
    rows = [{**shared, **numbers, **more} for more in (alone, {"family": "named"})]
    return pl.DataFrame(rows, schema=dict(AUDIT)).with_columns(resampled=pl.lit("blocks", dtype=AUDIT["resampled"]))


def audit_curves(curves: pl.DataFrame) -> pl.DataFrame:
    """Errors of which the correction leaves most, so that it explains neither a bias nor growth."""
    rows = [
        {
            "dataset": "made-up",
            "tracker": tracker,
            "correction": correction,
            "age": age,
            "n": 50,
            **{f"{name}_{axis}_px": factor * age for name in ("mean", "core") for axis in "uv"},
            **dict.fromkeys(("second_uu", "second_vv"), (factor * age) ** 2),
        }
        for tracker in curves["tracker"].unique().sort()
        for correction, factor in (("measured", 0.1), ("focal_length", 0.08), ("all", 0.08))
        for age in (1, 4, 8)
    ]
    return pl.DataFrame(rows, schema=dict(AUDIT_CURVES))


def _at_ages(curves: pl.DataFrame) -> pl.DataFrame:
    """Conditions at the ages that the tables have."""
    ages = pl.DataFrame({"age": [1, 4, 10]})
    return _conditions(curves).filter(trimming="untrimmed").join(ages, how="cross").with_columns(n=pl.lit(400))


def _conditions(curves: pl.DataFrame) -> pl.DataFrame:
    known = curves.filter(pl.col("n") > 0)
    keys = [*POOLED, "trimming"]
    return known.group_by(keys).agg(pl.col("n_scenes").max()).sort(keys)


def _banded(curves: pl.DataFrame) -> pl.DataFrame:
    bands = pl.DataFrame(BANDS, schema=["age_low", "age_high"], orient="row")
    return _conditions(curves).join(bands, how="cross")


def _resampled(schema: Schema) -> pl.Expr:
    few = pl.col("n_scenes").fill_null(0) < 6
    return pl.when(few).then(pl.lit("blocks")).otherwise(pl.lit("scenes")).cast(schema["resampled"])


def _typed(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """The columns of a schema, null where the table has none."""
    missing = {name: pl.lit(None) for name in schema if name not in table.columns}
    return table.with_columns(**missing).select(pl.col(name).cast(kind) for name, kind in schema.items())
