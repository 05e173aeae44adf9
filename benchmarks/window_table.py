"""The noise of windows worked out from a run's observations by other code, with a choice of the least parallax.

    python -m benchmarks.window_table RUN [--least-parallax PX] [--trimming trimmed] [--windows N ...]

RUN has `keep = "observations"` and pinhole cameras. Points are fitted to the visible observations of each window with
the stated poses. Only windows with enough parallax count, for residuals too. Printed are, in px, the root mean square
error in the last frame of windows, the residual sigma and the consistent sigma, and their ratio. docs/estimators.md
compares them with an earlier table, for which the experiment file has

    speeds = [1]                  trackers.options.rejection.consensus = "hypothesis"      (of both trackers)
    [statistics]  trim_among = "all"          [...]  --least-parallax 2
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.tables.store import RunFolder

HALF = 0.6744897501960817
"""Median of the absolute value of a Gaussian number of standard deviation 1."""


def windows(run: RunFolder, key: str, length: int) -> Iterator[tuple[str, bool, NDArray[np.float64]]]:
    """Tracker and trimming of each window of one sequence, with derivatives by the point and errors, (2 N, 4)."""
    poses, camera = run.sequence_table("poses", key), run.sequence_table("cameras", key).row(0, named=True)
    turn = Rotation.from_quat(poses.select("qx", "qy", "qz", "qw").to_numpy()).as_matrix()
    origin = poses.select("x_m", "y_m", "z_m").to_numpy()
    focal, centre = (np.array([camera[f"{name}{axis}_px"] for axis in "xy"]) for name in "fc")
    depths = run.sequence_table("tracks", key).select("tracker", "speed", "track", "depth_m")
    seen = run.sequence_table("observations", key).filter(pl.col("speed") == pl.col("speed").min())
    seen = seen.join(depths, on=["tracker", "speed", "track"]).sort("tracker", "track", "frame")
    for (tracker, _), track in seen.group_by("tracker", "track", maintain_order=True):
        first = track.head(length)
        if first.height < length or (first["truth"] != "valid").any():
            continue
        frames = first["frame"].to_numpy()
        ray = (first.select("u_true_px", "v_true_px").to_numpy()[0] - centre) / focal
        ray_m = turn[frames[0]] @ np.append(ray, 1.0) * first["depth_m"][0]
        x, y, z = np.einsum("nji,nj->in", turn[frames], ray_m + origin[frames[0]] - origin[frames])
        along = np.array([[focal[0] / z, 0 * z, -focal[0] * x / z**2], [0 * z, focal[1] / z, -focal[1] * y / z**2]])
        jacobian = np.einsum("ikn,njk->nij", along, turn[frames])
        across = np.linalg.svd(ray_m[None])[2]
        errors = first.select("du_px", "dv_px").to_numpy().reshape(-1, 1)
        derivatives = jacobian.reshape(-1, 3) @ np.column_stack([across[1:].T, ray_m])
        yield str(tracker), bool(track["kept"][0]), np.hstack([derivatives, errors])


def fitted(window: NDArray[np.float64]) -> tuple[float, float, float, float, float]:
    """Parallax, sum of squared residuals, their degrees of freedom, z, and the squared error in the last frame."""
    lateral, depth, errors = window[:, :2], window[:, 2], window[:, 3]
    values = np.column_stack([depth, errors])
    g, left = (values - lateral @ np.linalg.lstsq(lateral, values, rcond=None)[0]).T
    parallax = float(np.linalg.norm(g))
    z = float(g @ left) / parallax
    return parallax, float(left @ left) - z**2, len(errors) - 3, z, float(errors[-2:] @ errors[-2:])


def quantities(
    run: RunFolder, length: int, *, least_parallax_px: float, trimmed: bool
) -> dict[str, tuple[int, float, float, float]]:
    """By tracker: windows, root mean square error in the last frame, residual sigma and consistent sigma, px."""
    found: dict[str, list[tuple[float, ...]]] = {}
    for key in sorted(run.manifest().sequences):
        for tracker, kept, window in windows(run, key, length):
            if kept or not trimmed:
                found.setdefault(tracker, []).append(fitted(window))
    sizes = {}
    for tracker, rows in sorted(found.items()):
        shown = np.array([row for row in rows if row[0] >= least_parallax_px])
        _, squares, freedom, z, last = shown.T
        residual = float(np.sqrt(squares.sum() / freedom.sum()))
        sizes[tracker] = (len(shown), float(np.sqrt(last.mean() / 2)), residual, float(np.median(np.abs(z))) / HALF)
    return sizes


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--least-parallax", type=float, default=1.0)
    parser.add_argument("--trimming", choices=("trimmed", "untrimmed"), default="trimmed")
    parser.add_argument("--windows", type=int, nargs="*", default=[5, 10, 15])
    chosen = parser.parse_args(arguments)
    print(
        f"{'tracker':<16}{'window':>8}{'windows':>10}{'rms, last':>12}{'residual':>12}{'consistent':>12}{'ratio':>10}"
    )
    for length in chosen.windows:
        trimmed = chosen.trimming == "trimmed"
        found = quantities(RunFolder(chosen.run), length, least_parallax_px=chosen.least_parallax, trimmed=trimmed)
        for tracker, (n, last, residual, consistent) in found.items():
            sizes = f"{last:>12.3f}{residual:>12.3f}{consistent:>12.3f}{consistent / residual:>10.2f}"
            print(f"{tracker:<16}{length:>8}{n:>10}{sizes}", flush=True)


if __name__ == "__main__":
    main()
