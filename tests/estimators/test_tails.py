"""Tails of single errors, in units of what the components give."""

import math

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.fit import fit_tails
from tracknoise.estimators.model import Tails
from tracknoise.inference.track_noise import TrackNoise


def samples(nu: float) -> pl.DataFrame:
    """Errors of scale 1 at ages 1 to 10 in two scenes."""
    random = np.random.default_rng(0)
    scale = np.sqrt(nu / random.chisquare(nu, 4000)) if math.isfinite(nu) else np.ones(4000)
    errors = scale[:, None] * random.standard_normal((4000, 2))
    at = np.tile(np.arange(1, 11), 400)
    return pl.DataFrame({"scene": ["a", "b"] * 2000, "at": at, "du_px": errors[:, 0], "dv_px": errors[:, 1]})


def test_planted_tails_come_back() -> None:
    white = TrackNoise.isotropic(white=1.0)
    assert fit_tails(samples(4.0), white, last_age=30).nu == pytest.approx(4.0, rel=0.15)
    assert fit_tails(samples(math.inf), white, last_age=30) == Tails(nu=math.inf, core_sigma=1.0, core_ratio=1.0)


def test_noise_in_one_direction_only_has_no_tails() -> None:
    errors = samples(4.0).with_columns(dv_px=pl.lit(0.0))
    found = fit_tails(errors, TrackNoise(white=np.diag([1.0, 0.0])), last_age=30)
    assert (found.nu, found.core_ratio) == (math.inf, 1.0)
    assert found.core_sigma == pytest.approx(0.5**0.5)
