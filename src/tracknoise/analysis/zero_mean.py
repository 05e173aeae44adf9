"""Tests of whether the mean error is zero, at every age and at all ages together.

The sampling units of the test are scenes (`tracknoise.inference.sign_flips`). Each counts once. The table also has the
p-value of Hotelling's test with features as sampling units (iid). Errors of the features of a scene are correlated, so
this test rejects most true zeros.

Many conditions are asked at once. The verdict therefore allows for all of a dataset: it is `yes` if the evidence is
larger than the largest that flips of the same scenes lead to in any condition, at any age.

An age that is chosen beforehand has a verdict of its own (`verdict_at`), and bounds that agree with it.

The confidence region of the mean error at one age, u and v together, agrees with the test there. Scene means x_i (or
what stands for them where scenes have groups, `tracknoise.inference.sign_flips`) have the mean m, the sum s, the matrix
Q = sum x_i x_i' about zero, and W about m. With q = s' Q^-1 s / n and q / (1 - q) = n m' W^-1 m, the region is

    n (x - m)' W^-1 (x - m) <= q_c / (1 - q_c)                                                             (region)

where q_c is the largest value that more than `ALPHA` of the flips reach. It is Hotelling's ellipse, with the limit
from the flips in place of that of F. Zero lies outside exactly where the p-value of the flips at this age is at most
`ALPHA`. The bounds of u and of v are the extent of the ellipse, so that both hold at once; those of the length of the
mean are the smallest and the largest distance of the ellipse from zero. Where groups of unequal size share a large
mean, W has a part of it, and the region is too large.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.inference.multiple_tests import holm
from tracknoise.inference.sign_flips import Chance, FlipTest, family_p, flip_test
from tracknoise.inference.units import MIN_SCENES, NO_GROUPS, Resampled, SceneGroups
from tracknoise.statistics.definitions import NAMES, POOLED, since_zero
from tracknoise.statistics.grouping import (
    Groups,
    Tables,
    TablesByCondition,
    by_condition,
    group_rows,
    scenes_by_dataset,
)
from tracknoise.tables.defaults import POPULATION
from tracknoise.tables.enumerations import Verdict, Weighting
from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import COUNTED, OF_CONDITION, Rows, RunTable, Value, bounds_of, same
from tracknoise.tables.schema import MOMENTS, TRIMMING, VERDICT, check, empty, typed
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.words import scenes_counted

_BIAS_TESTS = (
    *("hotelling_p", "hotelling_p_adjusted"),
    *("sign_flip_p", "sign_flip_p_adjusted", "sign_flip_p_family", "iid_p"),
)


def _bias() -> Rows:
    of_mean = {name: bounds_of(f"mean_{name}", "_px") for name in "uv"}
    values = [
        Value("bias", "effect_px", carried={**COUNTED, **same("verdict", "why"), **bounds_of("effect", "_px")}),
        *(
            Value("bias_component", f"mean_{name}_px", {"coordinate": name}, carried=COUNTED | of_mean[name])
            for name in "uv"
        ),
        Value("bias_share", "share_of_second"),
        *(Value("p_value", name, {"part": name}) for name in _BIAS_TESTS),
    ]
    keys = {**OF_CONDITION, **same("trimming", "axis", "at")}
    return Rows("bias", keys, values)


ZERO_MEAN = RunTable(
    "zero_mean",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "axis": pl.String,
        "at": pl.Int64,
        "n": pl.Int64,
        "n_scenes": pl.Int32,
        **dict.fromkeys(("mean_u_px", "mean_u_low_px", "mean_u_high_px"), pl.Float64),
        **dict.fromkeys(("mean_v_px", "mean_v_low_px", "mean_v_high_px"), pl.Float64),
        **dict.fromkeys(("effect_px", "effect_low_px", "effect_high_px", "share_of_second"), pl.Float64),
        **dict.fromkeys(_BIAS_TESTS, pl.Float64),
        "verdict": VERDICT,
        "why": pl.String,
        "level": pl.Float64,
    },
    _bias(),
    title="tests of zero mean error",
    verdicts=pl.col("at").is_null(),
    quantities={
        "bias": Quantity(
            "px", "Length of the mean error, scenes weighted equally; the verdict says whether it is not zero."
        ),
        "bias_component": Quantity("px", "Mean error in u or v, scenes weighted equally."),
        "bias_share": Quantity("share", "Square of the mean over the second moment, u and v together."),
        "p_value": Quantity("1", "Chance of such a mean error, or a larger one, if the true mean is zero."),
    },
)
"""Is the mean error zero: one row per age (or frame), and one for all together where `at` is null.

effect_px is the length of the mean, share_of_second its square over the trace of the second moment about zero. Bounds
are for one age alone, u and v together: effect_low_px is above 0 exactly where sign_flip_p is at most 1 - level. They
and level are null where there is no test, and in the row of all ages. Adjusted p-values are over the ages of a
condition: Hotelling's by Holm, that of the sign flips by the largest statistic of each flip. sign_flip_p_family is over
all ages of all conditions of the dataset, and the verdict is about it. iid_p is the p-value of a test that assumes
independent features. The verdict `yes` means that the mean differs from zero, `undecided` that it may or may not.
"""

Array = NDArray[np.float64]

ALPHA = 0.05
"""Probability of a false rejection of a true zero."""
BOUNDS = tuple(f"{name}_{end}_px" for name in ("effect", "mean_u", "mean_v") for end in ("low", "high"))
"""Names of the bounds, in the order of `mean_bounds`."""
_ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)
_ROUNDING = 1e-9
_FLAT = 1e-12
"""Variances, and determinants, that are smaller than this, relative to what they come from, are rounding."""
_FEW_GROUPS = "too few groups of scenes for a test"
_CHANCE = "a mean error of this size may be chance"
_LINE = ["trimming", "axis"]
_CURVE = [*POOLED, *_LINE]


def zero_mean(
    moments: Tables,
    curves: pl.DataFrame,
    *,
    key_frames: Mapping[str, int] | None = None,
    population: str = POPULATION,
    groups: SceneGroups = NO_GROUPS,
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
    groups
        Scenes that are not independent of each other. Whole groups are flipped. With fewer than `MIN_SCENES` groups
        the test is within groups, and holds for these groups only.
    seed
        Of the flips, where they are not all used.

    Returns
    -------
    polars.DataFrame
        Schema `ZERO_MEAN`, sorted by condition, trimming and age, the row of all ages first. Means and second moments
        weigh scenes equally. The row of all ages has the means at the age where the evidence is strongest, which `why`
        names; these are larger than at an age chosen beforehand. The verdict is `yes` if the flips' p-value, adjusted
        over the ages of all conditions of the dataset (of one trimming and axis), is at most `ALPHA`; it is never `no`:
        a mean that could not be distinguished from zero may differ from it by as much as its interval is wide. Under
        `MIN_SCENES` scenes there is no test. Bounds are those of one age alone, u and v together; the row of all ages
        has none.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    points = _points(check(curves, CURVES, "curves").filter(population=population), key_frames or {})
    by_curve = points.partition_by(_CURVE, as_dict=True)
    errors = by_condition(moments, MOMENTS, "moments")
    chances = {
        dataset: Chance.of(sorted(scenes), groups.of(dataset, sorted(scenes)), seed=seed)
        for dataset, scenes in scenes_by_dataset(errors.items()).items()
    }
    asked = [
        _Curve.of(key, by_curve.get(key, points.clear()), scenes, chances[key[0]])
        for key, scenes in _means_by_curve(errors, population)
    ]
    tables = [empty({**ZERO_MEAN, "within": pl.Boolean})]
    for family in _families(asked):
        for curve, p in zip(family, family_p([curve.test for curve in family]), strict=True):
            tables += _of_curve(curve, p)
    rows = pl.concat(tables, how="diagonal_relaxed").with_columns_seq(
        pl.col("^.*_p(_adjusted|_family)?$").fill_nan(None), pl.col(BOUNDS).fill_nan(None)
    )
    return typed(_judged(rows), ZERO_MEAN).sort(*POOLED, "trimming", "axis", "at")


def verdict_at(row: Mapping[str, Any]) -> Verdict:
    """Whether the mean differs from zero at one age alone, u and v together: `yes`, or `undecided`.

    Parameters
    ----------
    row
        Of `ZERO_MEAN`, with an age.
    """
    p = row["sign_flip_p"]
    return Verdict.yes if p is not None and p <= ALPHA else Verdict.undecided


@dataclass(frozen=True, slots=True)
class _Curve:
    """A curve that is tested: its key, the points, how many scenes it has, the test, and bounds of its means."""

    key: tuple[Any, ...]
    points: pl.DataFrame
    n_scenes: int
    test: FlipTest
    bounds: Mapping[str, Array]
    within: bool

    @classmethod
    def of(cls, key: tuple[Any, ...], points: pl.DataFrame, scenes: pl.DataFrame, chance: Chance) -> "_Curve":
        """Test the means of some scenes."""
        groups = group_rows(scenes, ["scene"])
        means, own = _means(points, scenes, groups), chance.some(groups.keys["scene"].to_list())
        test, bounds = flip_test(means, chance=own), mean_bounds(means, own)
        return cls(key, points, groups.count, test, bounds, chance.kind == Resampled.within)


def _families(curves: Sequence[_Curve]) -> Iterator[list[_Curve]]:
    """Curves of each dataset, trimming and axis: their verdicts are asked together."""
    families: dict[tuple[Any, ...], list[_Curve]] = {}
    for curve in curves:
        family = (curve.key[0], *curve.key[-len(_LINE) :])
        families.setdefault(family, []).append(curve)
    yield from families.values()


def _means_by_curve(moments: TablesByCondition, population: str) -> Iterator[tuple[tuple[Any, ...], pl.DataFrame]]:
    """Mean errors of the scenes of each curve."""
    for condition, part in moments.items():
        means = part.filter(pl.col("n") > 0, population=population).select_seq(
            *_LINE, "scene", "at", "mean_u", "mean_v"
        )
        for line, scenes in means.partition_by(_LINE, as_dict=True, include_key=False).items():
            yield (*condition, *line), scenes


def _points(curves: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """Places that are tested, by curve: what weighs scenes equally, and (iid), which weighs features equally."""
    usable = curves.with_columns_seq(pl.col("at").cast(pl.Int64)).filter(~pl.col("cut"), since_zero(key_frames) != 0)
    points = usable.group_by(*_CURVE, "at").agg(
        n=pl.col("n").first(),
        mean_u=_value("u", "mean", Weighting.scenes),
        mean_v=_value("v", "mean", Weighting.scenes),
        second=_value("u", "second", Weighting.scenes) + _value("v", "second", Weighting.scenes),
        iid_p=_iid_p(),
    )
    length = (pl.col("mean_u") ** 2 + pl.col("mean_v") ** 2).sqrt()
    share = pl.when(pl.col("second") > 0).then(length**2 / pl.col("second"))
    return points.with_columns_seq(effect_px=length, share_of_second=share).sort(*_CURVE, "at")


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


def _of_curve(curve: _Curve, family: Array) -> list[pl.DataFrame]:
    """Rows of one curve: of all ages together, and of every age."""
    test = curve.test
    tests = {
        "n_scenes": test.n_scenes,
        "hotelling_p": test.hotelling_p,
        "hotelling_p_adjusted": holm(test.hotelling_p),
        "sign_flip_p": test.sign_flip_p,
        "sign_flip_p_adjusted": test.adjusted_p,
        "sign_flip_p_family": family,
    }
    means = {"mean_u_px": "mean_u", "mean_v_px": "mean_v"}
    found_at = {**tests, **curve.bounds}
    ages = curve.points.with_columns_seq(**means, **{name: pl.Series(p) for name, p in found_at.items()})
    labels = {name: pl.lit(value) for name, value in zip(_CURVE, curve.key, strict=True)}
    return [
        rows.with_columns_seq(**labels, within=curve.within) for rows in (_overall(ages, test, curve.n_scenes), ages)
    ]


def _judged(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows with the verdict, and the reason; that of all ages together has one already."""
    p, of_ages, own = (pl.col(name) for name in ("sign_flip_p_family", "sign_flip_p_adjusted", "sign_flip_p"))
    differs = (p <= ALPHA).fill_null(value=False)
    few = pl.format(
        f"a test at {100 * ALPHA:g} % needs at least {MIN_SCENES} scenes; this one has {{}}", scenes_counted("n_scenes")
    )
    among = pl.when(of_ages <= ALPHA).then(pl.lit(" in one of the conditions that were asked"))
    others = among.when(own <= ALPHA).then(pl.lit(" at one of the ages that were asked")).otherwise(pl.lit(""))
    why = pl.when(~differs).then(pl.lit(_CHANCE) + others)
    untested = pl.when(p.is_null()).then(pl.lit(_FEW_GROUPS))
    limits = pl.when("within").then(pl.lit("; for these groups of scenes only")).otherwise(pl.lit(""))
    said = (
        pl.when(pl.col("n_scenes") < MIN_SCENES)
        .then(few)
        .otherwise(pl.coalesce("why", untested, why) + pl.when(p.is_null()).then(pl.lit("")).otherwise(limits))
    )
    verdict = pl.when(differs).then(pl.lit(Verdict.yes)).otherwise(pl.lit(Verdict.undecided))
    level = pl.when(pl.col("effect_low_px").is_not_null()).then(pl.lit(1.0 - ALPHA))
    return rows.with_columns_seq(why=said, verdict=verdict, level=level)


def _overall(ages: pl.DataFrame, test: FlipTest, n_scenes: int) -> pl.DataFrame:
    """Row of all ages, with the means of the strongest."""
    counted = {"n_scenes": n_scenes}
    if test.strongest is None:
        enough = (test.n_scenes >= MIN_SCENES).any()
        why = _FEW_GROUPS if enough else f"no age or frame has {MIN_SCENES} scenes"
        why = why if ages.height else "no age or frame has enough features"
        return pl.DataFrame({**counted, "why": why})
    strongest = ages.select_seq("n", "mean_u_px", "mean_v_px", "effect_px", "share_of_second").row(
        test.strongest, named=True
    )
    family = {"sign_flip_p_family": ages["sign_flip_p_family"][test.strongest]}
    p = {"sign_flip_p": test.overall_p, "sign_flip_p_adjusted": test.overall_p, **family}
    why = "strongest evidence at {axis} {at}".format(**ages.row(test.strongest, named=True))
    return pl.DataFrame({**strongest, **counted, **p, "why": why})


def _means(points: pl.DataFrame, scenes: pl.DataFrame, groups: Groups) -> Array:
    """Mean error of each scene at each of the points, (scenes, points, 2), NaN where a scene has none."""
    order = points.select_seq(pl.col("at"), place=pl.int_range(pl.len()))
    rows = scenes.with_columns_seq(pl.col("at").cast(pl.Int64), number=groups.index).join(order, on="at")
    means = np.full((groups.count, points.height, 2), np.nan)
    means[rows["number"].to_numpy(), rows["place"].to_numpy()] = rows.select_seq("mean_u", "mean_v").to_numpy()
    return means


def mean_bounds(means: Array, chance: Chance) -> Mapping[str, Array]:
    """Bounds of the mean over scenes at every age, px, NaN where there is no test; (ages,) by the names in `BOUNDS`.

    Parameters
    ----------
    means : (scenes, ages, 2)
        Mean error of each scene at each age, px; NaN where a scene has none.
    chance
        Flips of these scenes.
    """
    there = ~np.isnan(means[..., 0])
    bounds = np.full((means.shape[1], len(BOUNDS)), np.nan)
    patterns, kind = np.unique(there, axis=1, return_inverse=True)
    for place, pattern in enumerate(patterns.T):
        if not chance.units(pattern):
            continue
        rows, directions = chance.rows(pattern)
        for age in np.flatnonzero(kind.ravel() == place):
            put_together = rows[:, pattern] @ means[pattern, age]
            bounds[age] = _bounds(put_together, directions, rows[:, pattern].sum(axis=1) @ directions[0])
    return dict(zip(BOUNDS, bounds.T, strict=True))


def _bounds(rows: Array, directions: Array, length: float) -> Array:
    """Bounds at one age: of rows (rows, 2) in directions (draws, rows), and the length of the mean's direction."""
    turned = directions @ rows
    about_zero = rows.T @ rows
    q = np.minimum(np.einsum("di,ij,dj->d", turned, _inverse(about_zero), turned), 1.0)
    limit = np.sort(q)[::-1][int(ALPHA * len(q))] * (1 + _ROUNDING)
    if limit >= 1 - _ROUNDING:
        return np.full(len(BOUNDS), np.nan)
    mean = turned[0] / length
    values, vectors = np.linalg.eigh(about_zero - np.outer(turned[0], turned[0]))
    axes = vectors * np.sqrt(np.maximum(values, 0.0) * limit / (1 - limit)) / length
    edge = mean + np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) @ axes.T
    distance, extent = np.hypot(*edge.T), np.linalg.norm(axes, axis=1)
    nearest = 0.0 if q[0] <= limit else distance.min()
    return np.array(
        [nearest, distance.max(), *(end for u in range(2) for end in (mean[u] - extent[u], mean[u] + extent[u]))]
    )


def _inverse(matrix: Array) -> Array:
    """Inverse in the directions in which means vary."""
    values, vectors = np.linalg.eigh(matrix)
    varies = values > _FLAT * np.maximum(values[-1], np.finfo(np.float64).tiny / _FLAT)
    return np.asarray((vectors * np.where(varies, 1 / np.where(varies, values, 1.0), 0.0)) @ vectors.T)
