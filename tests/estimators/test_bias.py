import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.fit import fit_bias
from tracknoise.estimators.model import BiasKind
from tracknoise.inference.units import NO_GROUPS, SceneGroups
from tracknoise.tables.schema import FLOORS, NOISE_SUMS
from tracknoise.tables.truth_audit import AUDIT_CURVES

AGES, N = 10, 500
VIEW = {"lighting": "", "rotation": 0, "direction": "forward", "camera": "", "tracker": "t", "speed": 1}


def sums(mean: np.ndarray, beta: float = 0.0, *, scenes: int = 12, agree: bool = True) -> pl.DataFrame:
    """Of errors of 0.2 px about a mean (ages, 2) and along a motion of 3 px; scenes may differ in its sign."""
    random = np.random.default_rng(1)
    rows = []
    for scene in range(scenes):
        sign = 1.0 if agree else (-1.0) ** scene
        for age in range(1, AGES + 1):
            motion = random.normal(0.0, 3.0, (N, 2))
            error = sign * (mean[age - 1] + beta * motion) + random.normal(0.0, 0.2, (N, 2))
            rows.append(
                {
                    **dict.fromkeys(NOISE_SUMS, None),
                    "dataset": "made",
                    "scene": f"{scene:02}",
                    "block": 0,
                    "product": "error",
                    "age": age,
                    "n": N,
                    "sum_u": error[:, 0].sum(),
                    "sum_v": error[:, 1].sum(),
                    "uu": np.square(error[:, 0]).sum(),
                    "vv": np.square(error[:, 1]).sum(),
                    "along": (error * motion).sum(),
                    "motion": np.square(motion).sum(),
                }
            )
    return pl.DataFrame(rows, schema=dict(NOISE_SUMS), orient="row")


def floors(mean_px: float) -> pl.DataFrame:
    """A truth whose errors have a mean of this standard deviation at every age."""
    row = {
        **dict.fromkeys(FLOORS, None),
        "dataset": "made",
        "scene": "00",
        **VIEW,
        "source": "all",
        "axis": "age",
        "n": N,
    }
    names = ("sum_uu", "sum_uv", "sum_vv", "own_uu", "own_vv", "shared_u", "shared_v")
    values = {"n": N, **dict.fromkeys(names, 0.0), "shared_u": mean_px * N, "shared_v": mean_px * N}
    rows = [{**row, **values, "at": age} for age in range(1, AGES + 1)]
    return pl.DataFrame(rows, schema=dict(FLOORS), orient="row")


DRIFT = np.linspace(0.02, 0.2, AGES)[:, None] * [1.0, -0.5]
NONE = np.zeros((AGES, 2))


def test_a_mean_on_which_scenes_agree_is_corrected() -> None:
    bias = fit_bias(sums(DRIFT), floors(0.0), groups=NO_GROUPS, level=0.95)
    assert bias.kind is BiasKind.BY_AGE
    np.testing.assert_allclose(bias.mean_px, DRIFT, atol=0.02)
    removed = np.square(DRIFT).sum(axis=1).mean()
    assert bias.reduction.value == pytest.approx(removed / (removed + 2 * 0.2**2), rel=0.1)
    assert bias.reduction.low < bias.reduction.value < bias.reduction.high


def test_an_error_along_the_motion_is_corrected() -> None:
    bias = fit_bias(sums(NONE, beta=-0.03), floors(0.0), groups=NO_GROUPS, level=0.95)
    assert bias.kind is BiasKind.ALONG_MOTION
    assert bias.per_motion == pytest.approx(-0.03, abs=0.002)


def test_no_mean_error_needs_no_correction() -> None:
    bias = fit_bias(sums(NONE), floors(0.0), groups=NO_GROUPS, level=0.95)
    assert (bias.kind, bias.why) == (
        BiasKind.REFUSED,
        "it would change the second moment of new scenes by less than 1 %",
    )


def test_scenes_that_disagree_refuse_a_correction() -> None:
    assert fit_bias(sums(DRIFT, agree=False), floors(0.0), groups=NO_GROUPS, level=0.95).kind is BiasKind.REFUSED


def test_what_the_truth_may_cause_is_not_corrected() -> None:
    covered = fit_bias(sums(DRIFT), floors(0.1), groups=NO_GROUPS, level=0.95)
    assert (covered.kind, covered.why) == (BiasKind.REFUSED, "errors of the truth may cause the mean error")
    unknown = fit_bias(sums(DRIFT), floors(0.0).clear(), groups=NO_GROUPS, level=0.95)
    assert (unknown.kind, unknown.why) == (BiasKind.REFUSED, "the errors of the truth are unknown")


@pytest.mark.parametrize(("left", "kind"), [(0.2, BiasKind.REFUSED), (0.7, BiasKind.BY_AGE)])
def test_what_faults_of_the_truth_explain_is_not_corrected(left: float, kind: BiasKind) -> None:
    """An estimator that took it would correct a wrong focal length by a bias of the tracker."""
    rows = [
        {**dict.fromkeys(AUDIT_CURVES), "dataset": "made", "tracker": "t", "correction": name, "age": 8, "n": 99,
         "mean_u_px": 0.16 * share, "mean_v_px": -0.08 * share}
        for name, share in (("measured", 1.0), ("all", left))
    ]  # fmt: skip
    curves = pl.DataFrame(rows, schema=dict(AUDIT_CURVES))
    named = sums(DRIFT).with_columns(tracker=pl.lit("t"))
    bias = fit_bias(named, floors(0.0), groups=NO_GROUPS, level=0.95, audit_curves=curves)
    assert bias.kind is kind
    assert ("audit" in bias.why) is (kind is BiasKind.REFUSED)


def in_blocks(one: pl.DataFrame, count: int = 4) -> pl.DataFrame:
    """The same errors in several equal blocks of tracks of each scene."""
    parts = [pl.col(name) / count for name in ("sum_u", "sum_v", "uu", "vv", "along", "motion")]
    each = one.with_columns(pl.col("n") // count, *parts)
    return pl.concat([each.with_columns(block=pl.lit(block, dtype=pl.UInt8)) for block in range(count)])


def test_one_scene_alone_cannot_be_left_out() -> None:
    for made in (sums(DRIFT, scenes=1), in_blocks(sums(DRIFT, scenes=1))):
        bias = fit_bias(made, floors(0.0), groups=NO_GROUPS, level=0.95)
        assert (bias.kind, bias.reduction) == (BiasKind.REFUSED, None)
        assert bias.why == "there is only one scene, so that none can be left out"


def test_whole_scenes_are_left_out_however_few_there_are() -> None:
    for agree, kind in ((False, BiasKind.REFUSED), (True, BiasKind.BY_AGE)):
        few = sums(DRIFT, scenes=4, agree=agree)
        found = [fit_bias(made, floors(0.0), groups=NO_GROUPS, level=0.95) for made in (few, in_blocks(few))]
        assert [one.kind for one in found] == [kind, kind]
        assert found[1].reduction.low == pytest.approx(found[0].reduction.low)


def test_scenes_of_a_group_are_left_out_together() -> None:
    pairs = SceneGroups({("made", f"{scene:02}"): f"{scene % 3}" for scene in range(5)})
    found = [fit_bias(sums(DRIFT, scenes=5), floors(0.0), groups=one, level=0.95) for one in (NO_GROUPS, pairs)]
    assert found[0].reduction.low != found[1].reduction.low
