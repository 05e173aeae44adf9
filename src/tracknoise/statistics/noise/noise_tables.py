"""All tables of a sequence that noise models are fitted to."""

import polars as pl

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.noise.covariate_pairs import noise_pairs
from tracknoise.statistics.noise.covariates import noise_covariates
from tracknoise.statistics.noise.error_products import products
from tracknoise.statistics.noise.noise_sums import noise_outliers, noise_sums
from tracknoise.statistics.noise.tracked_errors import error_tracks
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Product
from tracknoise.tables.schema import NOISE_COVARIATES, NOISE_OUTLIERS, NOISE_PAIRS, NOISE_SUMS, empty

_SCHEMAS = {
    "noise_sums": NOISE_SUMS,
    "noise_outliers": NOISE_OUTLIERS,
    "noise_covariates": NOISE_COVARIATES,
    "noise_pairs": NOISE_PAIRS,
}


def noise_tables(sequence: PreparedSequence, geometry: FrameGeometry) -> dict[str, pl.DataFrame]:
    """Sums of products of errors, their outliers, and changes of errors by what is known at run time.

    Parameters
    ----------
    sequence
        With errors about the first position of each track. Where a scan makes them zero elsewhere, tables have no rows.
    geometry
        Poses and cameras of its frames.

    Returns
    -------
    dict
        Tables of the schemas `NOISE_SUMS`, `NOISE_OUTLIERS`, `NOISE_COVARIATES` and `NOISE_PAIRS` by their names in
        lower case, sorted.
    """
    if sequence.key_frame is not None:
        return {name: empty(schema) for name, schema in _SCHEMAS.items()}
    tracks = error_tracks(sequence, geometry)
    found = dict(products(tracks))
    return {
        "noise_sums": noise_sums(sequence, tracks, found),
        "noise_outliers": noise_outliers(sequence, tracks),
        "noise_covariates": noise_covariates(sequence, tracks, found[Product.change]),
        "noise_pairs": noise_pairs(sequence, tracks, found[Product.change]),
    }
