"""Tests of whether the mean error is zero, at every age and at all ages together.

The sampling units of the test are scenes (`tracknoise.findings.flips`). Each counts once. The table also has the
p-value of Hotelling's test with features as sampling units (iid). Errors of the features of a scene are correlated, so
this test rejects most true zeros.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.flips import FlipTest, flip_test
from tracknoise.findings.sampling.multiplicity import holm
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import scenes_counted
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.defaults import POPULATION
from tracknoise.tables.enumerations import Axis, Verdict, Weighting
from tracknoise.tables.findings_schema import ZERO_MEAN
from tracknoise.tables.schema import CURVES, MOMENTS, check, empty

ALPHA = 0.05
"""Probability of a false `yes`: of rejecting a true zero, all ages of a condition together."""
_FLAT = 1e-12
"""Determinants that are smaller than this, relative to what they are a difference of, are rounding."""
_CHANCE = "a mean error of this size may be chance"
_LINE = ["trimming", "axis"]
_CURVE = [*POOLED, *_LINE]


def zero_mean(
    moments: Tables,
    curves: pl.DataFrame,
    *,
    key_frames: Mapping[str, int] | None = None,
    population: str = POPULATION,
    seed: int = 0,
) -> pl.DataFrame:
    """Test at every age whether the mean error is zero, and at all ages together.

    Parameters
    ----------
    moments
        Schema `MOMENTS`, of all scenes.
    curves
        What `tracknoise.statistics.curves.curves` made of them. Where they are cut there is no test.
    key_frames
        Where curves run along frames: the one in which errors are zero by construction, by direction. Neither it nor
        age 0 is tested.
    population
        Which observations the errors are of: `visible` or `projected`.
    seed
        Of the flips, where they are not all used.

    Returns
    -------
    polars.DataFrame
        Schema `ZERO_MEAN`, sorted by condition, trimming and age, the row of all ages first. Means and second moments
        weigh scenes equally. The row of all ages has the means at the age where the evidence is strongest, which `why`
        names; these are larger than at an age chosen beforehand. The verdict is `yes` if the flips' p-value, adjusted
        over the ages, is at most `ALPHA`; it is never `no`: a mean that could not be distinguished from zero may
        differ from it by as much as its interval is wide. Under `MIN_SCENES` scenes there is no test.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    points = _points(check(curves, CURVES, "curves").filter(population=population), key_frames or {})
    by_curve = points.partition_by(_CURVE, as_dict=True)
    parts = [empty(ZERO_MEAN)]
    for key, scenes in _means_by_curve(by_condition(moments, MOMENTS, "moments"), population):
        rows = _of_curve(by_curve.get(key, points.clear()), scenes, seed)
        named = [pl.lit(value).alias(name) for name, value in zip(_CURVE, key, strict=True)]
        parts.append(rows.with_columns(named).select(pl.col(name).cast(kind) for name, kind in ZERO_MEAN.items()))
    table = pl.concat(parts).with_columns(pl.col("^.*_p(_adjusted)?$").fill_nan(None))
    return check(table.sort(*POOLED, "trimming", "axis", "at"), ZERO_MEAN, "zero mean")


def _means_by_curve(moments: TablesByCondition, population: str) -> Iterator[tuple[tuple[Any, ...], pl.DataFrame]]:
    """Mean errors of the scenes of each curve."""
    for condition, part in moments.items():
        means = part.filter(pl.col("n") > 0, population=population).select(*_LINE, "scene", "at", "mean_u", "mean_v")
        for line, scenes in means.partition_by(_LINE, as_dict=True, include_key=False).items():
            yield (*condition, *line), scenes


def _points(curves: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """Places that are tested, by curve: what weighs scenes equally, and (iid), which weighs features equally."""
    key = pl.col("direction").replace_strict(dict(key_frames), default=0, return_dtype=pl.Int64)
    zero = pl.when(pl.col("axis") == Axis.frame).then(key).otherwise(0)
    usable = curves.with_columns(pl.col("at").cast(pl.Int64)).filter(~pl.col("cut"), pl.col("at") != zero)
    points = usable.group_by(*_CURVE, "at").agg(
        n=pl.col("n").first(),
        mean_u=_value("u", "mean", Weighting.scenes),
        mean_v=_value("v", "mean", Weighting.scenes),
        second=_value("u", "second", Weighting.scenes) + _value("v", "second", Weighting.scenes),
        iid_p=_iid_p(),
    )
    length = (pl.col("mean_u") ** 2 + pl.col("mean_v") ** 2).sqrt()
    share = pl.when(pl.col("second") > 0).then(length**2 / pl.col("second"))
    return points.with_columns(effect_px=length, share_of_second=share).sort(*_CURVE, "at")


def _value(column: str, role: str, weighting: str) -> pl.Expr:
    names = [called[role] for called in NAMES.values()]
    return pl.col(column).filter(pl.col("statistic").is_in(names), weighting=weighting).first()


def _iid_p() -> pl.Expr:
    """P-value of Hotelling's test over features; null where they do not vary in both directions."""
    n, u, v = pl.col("n").first(), _value("u", "mean", Weighting.features), _value("v", "mean", Weighting.features)
    uu, vv, uv = (_value(column, "central", Weighting.features) for column in ("u", "v", "uv"))
    determinant = uu * vv - uv**2
    t2 = n * (vv * u**2 - 2 * uv * u * v + uu * v**2) / determinant
    possible = (n > 2) & (determinant > _FLAT * uu * vv)
    return pl.when(possible).then((-(n - 2) / 2 * (t2 / (n - 1)).log1p()).exp())


def _of_curve(points: pl.DataFrame, scenes: pl.DataFrame, seed: int) -> pl.DataFrame:
    """Rows of one curve: of every age, and of all together."""
    found = flip_test(_means(points, scenes), seed=seed)
    tests = {
        "n_scenes": found.n_scenes,
        "hotelling_p": found.hotelling_p,
        "hotelling_p_adjusted": holm(found.hotelling_p),
        "sign_flip_p": found.sign_flip_p,
        "sign_flip_p_adjusted": found.adjusted_p,
    }
    ages = points.with_columns(mean_u_px="mean_u", mean_v_px="mean_v", **{k: pl.Series(v) for k, v in tests.items()})
    overall = _overall(ages, found, scenes["scene"].n_unique())
    rows = pl.concat([overall, ages], how="diagonal_relaxed")
    differs = (pl.col("sign_flip_p_adjusted").fill_nan(None) <= ALPHA).fill_null(value=False)
    few = pl.format(f"a test at 5 % needs at least {MIN_SCENES} scenes; found {{}}", scenes_counted("n_scenes"))
    chance = pl.when(~differs).then(pl.lit(_CHANCE))
    why = pl.when(pl.col("n_scenes") < MIN_SCENES).then(few).otherwise(pl.coalesce("why", chance))
    return rows.with_columns(
        why=why, verdict=pl.when(differs).then(pl.lit(Verdict.yes)).otherwise(pl.lit(Verdict.undecided))
    )


def _overall(ages: pl.DataFrame, found: FlipTest, n_scenes: int) -> pl.DataFrame:
    """Row of all ages, with the means of the strongest."""
    counted = {"n_scenes": n_scenes}
    if found.strongest is None:
        why = f"no age or frame has {MIN_SCENES} scenes" if ages.height else "no age or frame has enough features"
        return pl.DataFrame({**counted, "why": why})
    strongest = ages.select("n", "mean_u_px", "mean_v_px", "effect_px", "share_of_second").row(
        found.strongest, named=True
    )
    p = {"sign_flip_p": found.overall_p, "sign_flip_p_adjusted": found.overall_p}
    why = "strongest evidence at {axis} {at}".format(**ages.row(found.strongest, named=True))
    return pl.DataFrame({**strongest, **counted, **p, "why": why})


def _means(points: pl.DataFrame, scenes: pl.DataFrame) -> NDArray[np.float64]:
    """Mean error of each scene at each of the points, (scenes, points, 2), NaN where a scene has none."""
    groups = group_rows(scenes, ["scene"])
    order = points.select(pl.col("at"), place=pl.int_range(pl.len()))
    rows = scenes.with_columns(pl.col("at").cast(pl.Int64), number=groups.index).join(order, on="at")
    means = np.full((groups.count, points.height, 2), np.nan)
    means[rows["number"].to_numpy(), rows["place"].to_numpy()] = rows.select("mean_u", "mean_v").to_numpy()
    return means
