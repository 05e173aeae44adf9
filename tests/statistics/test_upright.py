import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tracknoise.statistics.curves import curves
from tracknoise.statistics.definitions import upright
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations

WIDTH = HEIGHT = 100


def turned(uv: np.ndarray, rotation: int) -> np.ndarray:
    """Where points of an image lie once it was turned counter-clockwise, a quarter turn at a time."""
    for _ in range(rotation // 90):
        uv = np.stack([uv[:, 1], WIDTH - 1 - uv[:, 0]], axis=1)
    return uv


@pytest.mark.parametrize("rotation", [0, 90, 180, 270])
def test_turned_curves_are_those_of_the_upright_image(observations, rotation: int) -> None:
    rng = np.random.default_rng(3)
    true = rng.uniform(20, 80, (9, 2))
    seen = true + rng.normal([0.4, -1.0], [1.0, 3.0], (9, 2))

    def measured(rotation: int) -> pl.DataFrame:
        error = turned(seen, rotation) - turned(true, rotation)
        table = observations(age=[1] * 9, du_px=error[:, 0].tolist(), dv_px=error[:, 1].tolist(), rotation=rotation)
        return curves(scene_moments(prepare_observations(table)), min_features=1)

    found = upright(measured(rotation), signed=pl.col("statistic") == "nu")
    assert_frame_equal(found.select("statistic", "u", "v"), measured(0).select("statistic", "u", "v"))
