"""Lucas-Kanade is drawn along at depth edges of a rendered world, and nothing of it is found without depth edges."""

import numpy as np
import pytest
from benchmarks.validity.depth_edges import Plain, errors_of
from scipy.ndimage import maximum_filter, minimum_filter

from tracknoise.experiments.measure import measure
from tracknoise.sequences.simulated import Simulated
from tracknoise.tables.identity import Direction

OPTIONS = {
    "world": "objects",
    "motions": ("linear",),
    "frames": 24,
    "width": 320,
    "height": 240,
    "seed": 4711,
    "supersampling": 1,
}


def means(reader: Simulated, direction: Direction) -> dict[str, dict[str, float]]:
    """Mean errors in u at age 20 by side."""
    errors = errors_of(reader, direction, "lucas-kanade")
    rows = errors.filter(surrounding="side", coordinate="u", statistic="mean", at=20).to_dicts()
    return {row["class"]: row for row in rows}


@pytest.mark.parametrize(("direction", "sign"), [(Direction.forward, 1.0), (Direction.backward, -1.0)])
def test_features_on_both_sides_of_depth_edges_are_drawn_along(direction: Direction, sign: float) -> None:
    found = means(Simulated(**OPTIONS), direction)
    assert sign * found["far"]["value"] < -0.5
    assert sign * found["near"]["value"] > 0.2
    assert abs(found["none"]["value"]) < 0.2


def test_a_plain_world_has_no_features_at_depth_edges() -> None:
    found = means(Plain(**OPTIONS), Direction.forward)
    assert found["none"]["n"] > 100
    assert sum(row["n"] for side, row in found.items() if side != "none") < 0.05 * found["none"]["n"]


@pytest.mark.parametrize("truth", ["raycast", "birth"])
def test_columns_of_tracks_agree_with_the_depth_map(truth: str) -> None:
    """Beside a near edge lies something deeper, beside a far one something nearer, and around the others neither."""
    reader = Simulated(**{**OPTIONS, "frames": 2})
    sequence = reader.open(reader.sequences()[0])
    measured = measure(sequence, ["lucas-kanade"], truth=truth)
    born = measured.observations.filter(frame=0).join(measured.tracks, on="track").drop_nulls("incidence_deg")
    depth = sequence.depth(0)
    assert depth is not None
    u, v = (np.rint(born[name].to_numpy()).astype(int) for name in ("u_px", "v_px"))
    own_m, side = depth.depth_m[v, u], born["edge_side"].to_numpy()
    shares = {  # of the depth beside an edge, or around a feature, in excess of the feature's own
        "deeper": maximum_filter(depth.depth_m, 35)[v, u] / own_m - 1,
        "nearer": 1 - minimum_filter(depth.depth_m, 35)[v, u] / own_m,
    }
    assert (shares["deeper"][side == "near"] > 0.019).mean() > 0.98
    assert (shares["nearer"][side == "far"] > 0.019).mean() > 0.98
    assert ((born["edge_px"].to_numpy() > 0) == (side == "near")).all()
    assert ((born["edge_px"].to_numpy() < 0) == (side == "far")).all()
    assert born.filter(edge_side="none")["edge_px"].null_count() == (side == "none").sum()
    assert min((side == name).sum() for name in ("near", "far", "none")) > 5
