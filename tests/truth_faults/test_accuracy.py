"""The block ``[truth.accuracy]`` that an audit offers."""

import tomllib
from dataclasses import fields

import polars as pl
import pytest

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.truth_faults.pose_accuracy import accuracy_toml

LAW = pl.DataFrame(
    {
        "rotation": 4 * [0] + [90],
        "direction": 5 * ["forward"],
        "motion": ["rotation", "rotation", "translation", "translation", "rotation"],
        "law": ["white", "random walk", "white", "random walk", "white"],
        "value": [0.0, 0.0567812, 0.0, 0.00177512, 9.0],
    }
)


def shares(**low: float) -> pl.DataFrame:
    """Shares at two ages, fitted to the other trackers."""
    rows = [
        {"tracker": name, "fitted_to": "others", "coordinate": "both", "age": age, "share": bound + 0.06, "low": bound}
        for name, bound in low.items()
        for age in (1, 4)
    ]
    return pl.DataFrame(rows)


def test_measured_pose_errors_are_settings_of_an_experiment():
    block = accuracy_toml(LAW, shares(a=0.1, b=0.2))
    stated = tomllib.loads(block)["truth"]["accuracy"]
    assert stated == {
        "rotation_white_deg": 0.0,
        "rotation_deg_per_sqrt_frame": 0.0568,
        "translation_white_m": 0.0,
        "translation_m_per_sqrt_frame": 0.00178,
    }
    assert set(stated) <= {field.name for field in fields(TruthAccuracy)}


def test_where_every_fourth_frame_was_measured_the_walk_is_that_of_the_recording():
    stated = tomllib.loads(accuracy_toml(LAW.with_columns(value=pl.lit(0.08)), shares(a=0.1, b=0.2), 4))
    assert stated["truth"]["accuracy"] == {
        "rotation_white_deg": 0.08,
        "rotation_deg_per_sqrt_frame": 0.04,
        "translation_white_m": 0.08,
        "translation_m_per_sqrt_frame": 0.04,
    }


@pytest.mark.parametrize(
    "unconfirmed",
    [
        pytest.param(shares(a=0.3), id="one tracker alone"),
        pytest.param(shares(a=0.3, b=-0.01), id="an interval that includes 0"),
        pytest.param(shares(a=0.3, b=-0.05), id="next to nothing explained"),
        pytest.param(shares(a=0.3, b=0.3).with_columns(fitted_to=pl.lit("own")), id="fitted to itself"),
        pytest.param(shares(a=0.3, b=0.3).with_columns(low=pl.lit(None, pl.Float64)), id="no intervals"),
    ],
)
def test_nothing_is_offered_that_other_trackers_do_not_confirm(unconfirmed):
    assert accuracy_toml(LAW, unconfirmed) is None


def test_nothing_is_offered_where_no_pose_error_was_measured():
    assert accuracy_toml(LAW.clear(), shares(a=0.1, b=0.2)) is None
    assert accuracy_toml(LAW.with_columns(value=0.0), shares(a=0.1, b=0.2)) is None  # 0 would state exact poses
