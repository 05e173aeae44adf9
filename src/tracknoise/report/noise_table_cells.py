"""Tables of noise by tracker, speed and motion, as sentences and tables."""

import math
from typing import Any

from tracknoise.findings.headlines.lookup_topic import lookup_sentences, nat_text
from tracknoise.findings.wording import DASH, number, percent, ratio
from tracknoise.noise_models.lookup.noise_table import NoiseRow, NoiseTable, SecondMoment
from tracknoise.noise_models.model import Bias, BiasKind, Purpose
from tracknoise.printable import counted
from tracknoise.report.cells import Cells
from tracknoise.tables.enumerations import Product

_ALL = "all"


def noise_table_sentences(table: NoiseTable) -> list[str]:
    """Which lookup is worth it on scenes that were left out, and how much bias is warranted."""
    gains = [text for product in (Product.error, Product.change) for text in lookup_sentences(table.gains, product)]
    warranted = sum(_is_warranted(row.bias) for row in table.rows)
    bias = f"A correction of the mean error is warranted in {warranted} of {counted(len(table.rows), 'row')}."
    return [*gains, bias] if gains else [_no_gain(table), bias]


def _no_gain(table: NoiseTable) -> str:
    """Why no gain is known."""
    reasons = table.gains["why"].drop_nulls().unique(maintain_order=True).to_list()
    if not reasons:
        return "The run varies neither tracker, speed nor motion."
    return f"It is unknown whether the noise depends on tracker, speed or motion: {reasons[0]}."


def noise_table_cells(table: NoiseTable) -> Cells:
    """One row per tracker, speed and motion: sigmas, root second moments, and the bias."""
    age = _common_age(table)
    headings = ["tracker", "speed", "motion", "scenes", "innovations", "newest pose", "change u", "change v"]
    headings += [f"error u, age {age}", f"error v, age {age}"] if age else []
    rows = [_row(row, age) for row in table.rows]
    caption = (
        f"Noise in px. Sigma that makes innovations and the newest pose right, windows of {table.window} frames; root "
        "second moments about zero of changes between observations and of errors about the first position"
    )
    numeric = [False, True, False, *[True] * (len(headings) - 3), True, False]
    return Cells(caption, [*headings, "outliers", "bias"], rows, numeric)


def gain_cells(table: NoiseTable) -> Cells:
    """What each lookup gains on scenes that were left out."""
    headings = ["second moment of", "looked up by", "over", "gain, nat", "low", "high", "gain", "factor", "before"]
    rows = [_gain(row) for row in table.gains.to_dicts()]
    return Cells(
        "Gain on scenes that were left out, per error, and by which factor the second moment of a scene differs",
        [*headings, "scenes", "why"],
        rows,
        [False] * 3 + [True] * 3 + [False] + [True] * 3 + [False],
    )


def _common_age(table: NoiseTable) -> int | None:
    """The oldest age at which all rows have errors."""
    ages = [{one.age for one in row.errors if one.age is not None} for row in table.rows]
    return max(set.intersection(*ages), default=None) if ages else None


def _row(row: NoiseRow, age: int | None) -> list[str]:
    sigmas = [row.sigma.get(purpose) for purpose in (Purpose.INNOVATIONS, Purpose.NEWEST_POSE)]
    error = next((one for one in row.errors if one.age == age), None)
    return [
        row.tracker,
        str(row.speed),
        row.motion or _ALL,
        str(len(row.scenes)),
        *(DASH if one is None else number(one.value) for one in sigmas),
        *_roots(row.changes),
        *(_roots(error) if age else ()),
        percent(row.outlier_share),
        _bias(row.bias),
    ]


def _roots(one: SecondMoment | None) -> list[str]:
    return [DASH, DASH] if one is None else [number(math.sqrt(one.uu)), number(math.sqrt(one.vv))]


def _is_warranted(bias: Bias) -> bool:
    return bias.kind in (BiasKind.BY_AGE, BiasKind.ALONG_MOTION)


def _bias(bias: Bias) -> str:
    """The correction, or that none is warranted."""
    if bias.kind is BiasKind.ALONG_MOTION:
        return f"{number(bias.per_motion)} per px of motion"
    if bias.kind is BiasKind.BY_AGE:
        longest = max(bias.mean_px, key=lambda mean: math.hypot(*mean))
        return f"by age, up to {number(math.hypot(*longest))} px"
    return "none"


def _gain(row: dict[str, Any]) -> list[str]:
    what = [row["product"], row["lookup"], row["against"]]
    nats = [nat_text(row[name]) for name in ("gain_nats", "low", "high")]
    factors = [DASH if row[name] is None else ratio(row[name]) for name in ("factor", "factor_against")]
    verdict = {True: "established", False: "not established", None: "unknown"}[row["established"]]
    return [*what, *nats, verdict, *factors, str(row["n_scenes"]), row["why"] or ""]
