"""A table of noise as CSV and as JSON."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import polars as pl

from tracknoise.noise_models.lookup.noise_table import NoiseRow, NoiseTable, SecondMoment

FORMAT = "tracknoise.noise-table/1"
_COLUMNS: Mapping[str, type[pl.DataType]] = {
    "tracker": pl.String,
    "speed": pl.Int64,
    "motion": pl.String,
    "n_scenes": pl.Int64,
    "estimand": pl.String,
    "age": pl.Int64,
    "n": pl.Int64,
    **dict.fromkeys(("uu_px2", "uv_px2", "vv_px2", "mean_u_px", "mean_v_px", "bias_u_px", "bias_v_px"), pl.Float64),
    "bias_per_motion": pl.Float64,
    **dict.fromkeys(("sigma_px", "sigma_low_px", "sigma_high_px"), pl.Float64),
}


def noise_table_csv(table: NoiseTable) -> str:
    """One row per tracker, speed, motion and estimand, and per age of errors; empty where a column does not apply.

    The estimands are `error about the first position`, `change between observations`, and `sigma: PURPOSE`. bias is the
    correction that is warranted, empty where none is: px, or per px of motion.
    """
    rows = [
        {"tracker": row.tracker, "speed": row.speed, "motion": row.motion, "n_scenes": len(row.scenes), **one}
        for row in table.rows
        for one in _estimands(row)
    ]
    return pl.DataFrame(rows, schema=dict(_COLUMNS), orient="row").write_csv()


def noise_table_json(table: NoiseTable) -> str:
    """The whole table with reasons, and the gains on scenes that were left out; what is unknown is null."""
    document = {
        "format": FORMAT,
        "window": table.window,
        "level": table.level,
        "rows": [asdict(row) for row in table.rows],
        "gains": table.gains.to_dicts(),
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _estimands(row: NoiseRow) -> Iterator[dict[str, Any]]:
    bias = dict(zip(row.bias.ages, row.bias.mean_px, strict=True))
    for one in row.errors:
        u, v = bias.get(one.age or 0, (None, None))
        per_motion = row.bias.per_motion or None
        corrected = {"bias_u_px": u, "bias_v_px": v, "bias_per_motion": per_motion}
        yield {"estimand": "error about the first position", **_moment(one), **corrected}
    if row.changes is not None:
        yield {"estimand": "change between observations", **_moment(row.changes)}
    for purpose, sigma in row.sigma.items():
        bounds = {"sigma_px": sigma.value, "sigma_low_px": sigma.low, "sigma_high_px": sigma.high}
        yield {"estimand": f"sigma: {purpose}", "n": row.n, **bounds}


def _moment(one: SecondMoment) -> dict[str, Any]:
    entries = {f"{name}_px2": getattr(one, name) for name in ("uu", "uv", "vv")}
    return {"age": one.age, "n": one.n, **entries, "mean_u_px": one.mean_u, "mean_v_px": one.mean_v}
