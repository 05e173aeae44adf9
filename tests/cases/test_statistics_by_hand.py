"""Three tracks, small enough to compute every statistic on paper.

Speed 2: the tracker saw frames 0, 2 and 4 of the nominal sequence.

======  =====  ==========================  ==========================  ========
track   ended  (du, dv) at ages 0, 2, 4    largest error               lifetime
======  =====  ==========================  ==========================  ========
0       never  (0, 0)  (1, 0)  (2, -2)     sqrt(8) = 2.83              3
1       as an  (0, 0)  (3, 4)              5                           2
        outlier
2       lost   (0, 0)                      0                           1
======  =====  ==========================  ==========================  ========
"""

import math

import polars as pl
import pytest

from tracknoise.statistics.curves import curves
from tracknoise.statistics.histograms import error_histogram
from tracknoise.statistics.lifetimes import lifetimes, mean_lifetime, median_survival, surviving
from tracknoise.statistics.moments import merge, scene_moments
from tracknoise.statistics.prepared import prepare_observations
from tracknoise.statistics.summary import summary
from tracknoise.statistics.track_counts import counts, outlier_ratios
from tracknoise.statistics.trimming import Trimmed, trim
from tracknoise.tables.schema import FRAME_COUNTS, OBSERVATIONS, ORIGIN, TRACKS, Schema

SEEN = [  # track, frame, age, truth, du, dv
    (0, 0, 0, "valid", 0.0, 0.0),
    (1, 0, 0, "valid", 0.0, 0.0),
    (2, 0, 0, "valid", 0.0, 0.0),
    (0, 2, 2, "valid", 1.0, 0.0),
    (1, 2, 2, "valid", 3.0, 4.0),
    (0, 4, 4, "valid", 2.0, -2.0),
]
LIVED = [(0, 3, "sequence_end"), (1, 2, "outlier"), (2, 1, "lost")]
OFFERED = [(0, 0, 0), (2, 3, 0), (4, 2, 1)]  # frame, F(t-1), f1


def table(schema: Schema, names: list[str], rows: list[tuple[object, ...]], scene: str = "a") -> pl.DataFrame:
    """A table of one scene at speed 2; columns that are not given are null, kept is true."""
    origin = dict(zip(ORIGIN, ("paper", scene, "nominal", 0, "forward", "", "tracker", 2), strict=True))
    given = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    values = {"kept": True} | origin | given
    filled = {name: values.get(name) for name in schema}
    columns = {name: value if isinstance(value, list) else [value] * len(rows) for name, value in filled.items()}
    return pl.DataFrame(columns, schema=dict(schema))


def observed(rows: list[tuple[object, ...]], scene: str = "a") -> pl.DataFrame:
    return table(OBSERVATIONS, ["track", "frame", "age", "truth", "du_px", "dv_px"], rows, scene)


@pytest.fixture(scope="module")
def trimmed() -> Trimmed:
    """Cut at the median largest error, which is that of track 0: only track 1 exceeds it."""
    return trim(observed(SEEN), table(TRACKS, ["track", "lifetime", "end"], LIVED), percentile=50, among="all")


def at(curve_table: pl.DataFrame, statistic: str, trimming: str = "untrimmed") -> dict[int, tuple[float | None, ...]]:
    """u, v, uv of a statistic by age, features pooled, visible ones only."""
    chosen = curve_table.filter(statistic=statistic, trimming=trimming, population="visible", weighting="features")
    return {row["at"]: (row["u"], row["v"], row["uv"]) for row in chosen.iter_rows(named=True)}


def test_trimming(trimmed: Trimmed) -> None:
    assert trimmed.tracks["max_error_px"].to_list() == [math.sqrt(8), 5.0, 0.0]
    assert trimmed.tracks["kept"].to_list() == [True, False, True]
    assert trimmed.observations["kept"].to_list() == [True, False, True, True, False, True]
    cut = trimmed.trims.row(0, named=True)
    assert (cut["threshold_px"], cut["n_dropped"], cut["dropped_share"]) == (math.sqrt(8), 1, 1 / 3)


def test_moments_at_age_two(trimmed: Trimmed) -> None:
    # Mean (2, 2); deviations (-1, -2) and (1, 2): even sums double, odd ones cancel.
    row = scene_moments(trimmed.sequence.seen).filter(at=2, population="visible", trimming="untrimmed")
    expected = {
        "n": 2, "mean_u": 2, "mean_v": 2,
        "m_uu": 2, "m_uv": 4, "m_vv": 8,
        "m_uuu": 0, "m_uuv": 0, "m_uvv": 0, "m_vvv": 0,
        "m_uuuu": 2, "m_uuuv": 4, "m_uuvv": 8, "m_uvvv": 16, "m_vvvv": 32,
        "mean_abs_u": 2, "mean_abs_v": 2, "m_abs_uu": 2, "m_abs_vv": 8,
    }  # fmt: skip
    assert row.select(*expected).row(0, named=True) == expected


def test_curves(trimmed: Trimmed) -> None:
    table = curves(scene_moments(trimmed.sequence.seen))
    assert at(table, "nu") == {0: (0, 0, None), 2: (2, 2, None), 4: (2, -2, None)}
    assert at(table, "eta") == {0: (0, 0, None), 2: (2, 2, None), 4: (2, 2, None)}
    # (1 + 9) / 2, (0 + 16) / 2, (0 + 12) / 2; one feature has no covariance
    assert at(table, "Phi") == {0: (0, 0, 0), 2: (5, 8, 6), 4: (4, 4, -4)}
    assert at(table, "central") == {0: (0, 0, 0), 2: (2, 8, 4), 4: (None, None, None)}
    assert at(table, "nu", "trimmed") == {0: (0, 0, None), 2: (1, 0, None), 4: (2, -2, None)}
    assert at(table, "Phi", "trimmed") == {0: (0, 0, 0), 2: (1, 0, 0), 4: (4, 4, -4)}
    assert at(table, "central", "trimmed") == {0: (0, 0, 0), 2: (None, None, None), 4: (None, None, None)}


def test_the_cut(trimmed: Trimmed) -> None:
    chosen = {"statistic": "nu", "trimming": "untrimmed", "population": "visible", "weighting": "features"}
    table = curves(scene_moments(trimmed.sequence.seen), min_features=2).filter(**chosen)
    assert table.select("at", "n", "cut").rows() == [(0, 3, False), (2, 2, False), (4, 1, True)]


def test_occluded_features_count_as_projected_only() -> None:
    rows = [(0, 2, 2, "valid", 1.0, 0.0), (1, 2, 2, "occluded", 3.0, 4.0), (2, 2, 2, "no_depth", None, None)]
    table = curves(scene_moments(prepare_observations(observed(rows)))).filter(
        statistic="nu", trimming="untrimmed", weighting="features"
    )
    assert table.select("population", "n", "u", "v").rows() == [("visible", 1, 1.0, 0.0), ("projected", 2, 2.0, 2.0)]


def test_two_scenes() -> None:
    # Scene a: du 1 and 3; scene b: du -4. Features: (1 + 3 - 4) / 3 = 0. Scenes: (2 - 4) / 2 = -1.
    one = observed([(0, 2, 2, "valid", 1.0, 0.0), (1, 2, 2, "valid", 3.0, 0.0)])
    two = observed([(0, 2, 2, "valid", -4.0, 0.0)], scene="b")
    moments = pl.concat([scene_moments(prepare_observations(one)), scene_moments(prepare_observations(two))])
    table = curves(moments).filter(population="visible", trimming="untrimmed")
    assert table.filter(statistic="nu").select("weighting", "u", "n", "n_scenes").rows() == [
        ("features", 0.0, 3, 2),
        ("scenes", -1.0, 3, 2),
    ]
    # (1 + 9 + 16) / 3 over all; scene a alone has (1 + 9) / 2, scene b 16
    assert table.filter(statistic="Phi").select("u", "n_scenes").rows() == [(26 / 3, 2), (10.5, 2)]
    pooled = merge(moments, by=["population", "trimming"]).row(0, named=True)
    assert (pooled["n"], pooled["mean_u"], pooled["m_uu"], pooled["m_uuu"]) == (3, 0.0, 26.0, 1.0 + 27.0 - 64.0)


def test_lifetimes(trimmed: Trimmed) -> None:
    # Track 0 was alive at the end: it is not at risk at lifetime 3, where nobody is.
    table = lifetimes(trimmed.tracks)
    columns = ["lifetime", "n_ended", "n_censored", "at_risk"]
    assert table.select(columns).rows() == [(1, 1, 0, 3), (2, 1, 0, 2), (3, 0, 1, 0)]
    assert table["survival"].to_list() == [pytest.approx(2 / 3), pytest.approx(1 / 3), None]
    mean = mean_lifetime(table).row(0, named=True)
    assert (mean["mean_lifetime"], mean["restricted_to"]) == (2.0, 3)
    assert mean["restricted_mean_lifetime"] == pytest.approx(1 + 2 / 3 + 1 / 3)
    assert median_survival(table)["median_lifetime"].to_list() == [2]
    assert surviving(table).select("age", "n").rows() == [(0, 3), (2, 2), (4, 1)]


def test_outlier_ratio() -> None:
    # 0/3 and 1/2; frame 0 had nothing to track.
    table = outlier_ratios(table_of_frames())
    row = table.row(0, named=True)
    assert (row["n_frames"], row["pooled_ratio"], row["mean"], row["median"]) == (2, 0.2, 0.25, 0.25)
    assert (row["lower_quartile"], row["upper_quartile"]) == (0.125, 0.375)
    assert (row["lower_whisker"], row["upper_whisker"]) == (0.0, 0.5)


def test_histogram_of_largest_errors(trimmed: Trimmed) -> None:
    filled = error_histogram(trimmed.tracks).filter(pl.col("n") > 0)
    bins = [(0.0, 0.001, 1), (2.51189, 3.16228, 1), (3.98107, 5.01187, 1)]
    assert filled.select("bin_low_px", "bin_high_px", "n").rows() == bins


def test_counts(trimmed: Trimmed) -> None:
    found = counts(trimmed.sequence).filter(pl.col("n") > 0)
    expected = [("end", "lost", 1), ("end", "outlier", 1), ("end", "sequence_end", 1), ("truth", "valid", 6)]
    assert found.select("kind", "name", "n").rows() == expected


def test_summary(trimmed: Trimmed) -> None:
    table = curves(scene_moments(trimmed.sequence.seen), min_features=1)
    row = summary(table, lifetimes(trimmed.tracks), outlier_ratios(table_of_frames()), age=3).row(0, named=True)
    assert (row["n_tracks"], row["mean_lifetime"], row["median_lifetime"], row["outlier_ratio"]) == (3, 2.0, 2, 0.2)
    assert (row["at"], row["untrimmed_n"], row["trimmed_n"]) == (2, 2, 1)
    assert (row["untrimmed_nu_u_px"], row["untrimmed_rms_u_px"], row["untrimmed_rms_v_px"]) == (
        2.0,
        math.sqrt(5),
        math.sqrt(8),
    )
    assert (row["trimmed_nu_u_px"], row["trimmed_eta_v_px"], row["trimmed_rms_u_px"]) == (1.0, 0.0, 1.0)


def table_of_frames() -> pl.DataFrame:
    rows = [(*row, 0, 0, 0) for row in OFFERED]
    return table(FRAME_COUNTS, ["frame", "offered", "outliers", "matched", "new", "alive"], rows)
