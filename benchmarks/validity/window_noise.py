"""Does the noise of windows come back: independent noise, noise of the first position, walks, and all of them?

    python -m benchmarks.validity.window_noise [--scenes N] [--frames N] [--features N] [--seed N] [--on-surface]

The oracle tracks through simulated worlds, sideways and forward. Its errors are planted. Printed are the residual
sigma, the consistent sigma and their ratio, the overconfidence, of windows of each length: as the tool measures them,
and as linear algebra predicts them from the planted covariance of each window, with derivatives that are taken
numerically.
With independent errors of 0.3 px in all frames (`detection`), both sigmas are 0.3 px. Where the first position has no
error (`white`), the first observation of a window is better than the others, and both sigmas are smaller: by a tenth
and by a quarter in windows of 5. Walks are of 0.1 px per frame. `all` has every kind, each smaller.

With `--on-surface`, features leave their points along surfaces, as real ones do, and not at the same depth. The truth
takes the depth at the first observed position, which is then not that of the point that is followed.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import optimize, stats

import tracknoise as tn
from tracknoise.estimators.window_noise import window_sigmas
from tracknoise.experiments.geometry_tables import frame_geometry
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.simulated import Simulated
from tracknoise.statistics.windows import LEAST_PARALLAX_PX, window_noise
from tracknoise.trackers.oracle import Oracle, OracleTracker
from tracknoise.trackers.tracker import DisplacingTruth, SequenceContext

WINDOWS = (5, 10, 15)
SIGMAS = ("residual_sigma", "consistent_sigma", "overconfidence")


@dataclass(frozen=True, slots=True)
class Surface:
    """A truth that moves points along surfaces; where there is none, at the same depth."""

    truth: DisplacingTruth

    def anchor(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """World points of pixels, as those of the truth."""
        return self.truth.anchor(index, uv)

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels of world points, as those of the truth."""
        return self.truth.project(index, points_world)

    def displaced(
        self, index: int, points_world: NDArray[np.float64], by_px: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points of surfaces whose positions lie beside those of others."""
        on_surface, _ = self.truth.anchor(index, self.truth.project(index, points_world) + by_px)
        known = np.isfinite(on_surface).all(axis=1)[:, None]
        return np.where(known, on_surface, self.truth.displaced(index, points_world, by_px))


@dataclass(frozen=True, slots=True)
class SurfaceOracle(Oracle):
    """An oracle whose features leave their points along surfaces."""

    def start(self, context: SequenceContext) -> OracleTracker:
        """Start it on one sequence at one speed."""
        assert isinstance(context.truth, DisplacingTruth)
        return Oracle.start(self, replace(context, truth=Surface(context.truth)))


@dataclass(frozen=True, slots=True)
class Planted:
    """Standard deviations of the errors: of the first position, of each later frame, and of the steps of a walk."""

    birth_px: float = 0.0
    white_px: float = 0.0
    walk_px: float = 0.0

    def tracker(self, features: int, *, on_surface: bool = False) -> Oracle:
        """The oracle with these errors."""
        white = ((self.white_px**2, 0.0), (0.0, self.white_px**2))
        kind = SurfaceOracle if on_surface else Oracle
        return kind(features, covariance_px2=white, birth_px=self.birth_px, walk_px_per_sqrt_frame=self.walk_px)

    def covariance(self, magnification: NDArray[np.float64]) -> NDArray[np.float64]:
        """(windows, N, N) of the errors of a coordinate about the first position, for magnifications (windows, N)."""
        both = magnification[:, :, None] * magnification[:, None, :]
        steps = np.cumsum(magnification**-2, axis=1) - magnification[:, :1] ** -2
        number = np.arange(magnification.shape[1])
        walked = steps[:, np.minimum.outer(number, number)]
        later = np.diag((number > 0).astype(float))
        covariance = both * (self.birth_px**2 + self.walk_px**2 * walked) + self.white_px**2 * later
        covariance[:, 0] = covariance[:, :, 0] = 0.0
        return np.asarray(covariance)


CASES = {
    "white": Planted(white_px=0.3),
    "detection": Planted(birth_px=0.3, white_px=0.3),
    "walk": Planted(walk_px=0.1),
    "all": Planted(birth_px=0.2, white_px=0.2, walk_px=0.08),
}


def measured(
    motion: str, *, scenes: int, frames: int, features: int, seed: int, on_surface: bool = False
) -> list[tn.Measurement]:
    """Oracles with the errors of `CASES` in simulated worlds."""
    reader = Simulated(
        motions=(motion,), worlds=scenes, frames=frames, width=320, height=240, supersampling=1, seed=seed
    )
    trackers = {name: planted.tracker(features, on_surface=on_surface) for name, planted in CASES.items()}
    return [tn.measure(reader.open(scene), trackers, seed=seed) for scene in reader.sequences()]


def found(measurements: Sequence[tn.Measurement]) -> pl.DataFrame:
    """Quantities of windows as the tool measures them: columns tracker, window and those of `SIGMAS`."""
    tables = [
        window_noise(one.prepared, frame_geometry(one.sequence, one.n_frames), population="visible")["window_noise"]
        for one in measurements
    ]
    chosen = window_sigmas(tables).filter(pl.col("quantity").is_in(SIGMAS), trimming="untrimmed")
    return chosen.pivot(on="quantity", index=["tracker", "window"], values="value")


def predicted(measurements: Sequence[tn.Measurement], name: str, window: int) -> dict[str, float]:
    """The same of one tracker and length from the planted covariance."""
    squares, freedom, sizes = (
        np.concatenate(parts) for parts in zip(*(_of_windows(one, name, window) for one in measurements), strict=True)
    )
    residual = float(np.sqrt(squares.sum() / freedom.sum()))
    consistent = _median_of_mixture(sizes[np.isfinite(sizes)]) / stats.norm.ppf(0.75)
    return dict(zip(SIGMAS, (residual, consistent, consistent / residual), strict=True))


def _median_of_mixture(sizes: NDArray[np.float64]) -> float:
    """Median of |x|, where x is Gaussian with one of these standard deviations."""
    return float(optimize.brentq(lambda x: np.mean(stats.chi.cdf(x / sizes, 1)) - 0.5, 0.0, 10 * sizes.max()))


def _of_windows(one: tn.Measurement, name: str, window: int) -> tuple[NDArray[np.float64], ...]:
    """Expected squares, their degrees of freedom and the standard deviation of z of each window."""
    points, frames = _points(one, name, window)
    poses, camera = one.sequence.world_from_camera, one.sequence.camera
    ray = points - poses[frames[:, 0], :3, 3]
    step = 1e-6 * np.linalg.norm(ray, axis=1)[:, None]
    jacobian = np.empty((*frames.shape, 2, 3))
    depth = np.empty(frames.shape)
    for place in range(window):
        view = invert(poses)[frames[:, place]]
        depth[:, place] = transform(view, points)[:, 2]
        for axis, unit in enumerate(np.eye(3)):
            ahead, behind = (camera.project(transform(view, points + sign * step * unit)) for sign in (1, -1))
            jacobian[:, place, :, axis] = (ahead - behind) / (2 * step)
    covariance = CASES[name].covariance(depth[:, :1] / depth)
    parts = [_expected(*of_window) for of_window in zip(jacobian, covariance, ray, strict=True)]
    squares, freedom, size = np.array(parts).T
    return squares, freedom, size


def _points(one: tn.Measurement, name: str, window: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """True points (windows, 3) of the tracks whose first observations are all visible, and the frames of these."""
    seen = one.observations.filter(tracker=name).sort("track", "frame").group_by("track", maintain_order=True)
    whole = seen.agg(pl.all().head(window)).filter(
        pl.col("frame").list.len() == window,
        pl.col("truth").cast(pl.List(pl.String)).list.eval(pl.element() == "valid").list.all(),
    )
    whole = whole.join(one.tracks.filter(tracker=name).select("track", "depth_m"), on="track", maintain_order="left")
    frames = np.array(whole["frame"].to_list(), dtype=np.intp).reshape(-1, window)
    uv = np.column_stack([whole[f"{axis}_true_px"].list.first() for axis in "uv"])
    points = one.sequence.camera.unproject(uv, whole["depth_m"].to_numpy())
    return transform(one.sequence.world_from_camera[frames[:, 0]], points), frames


def _expected(
    jacobian: NDArray[np.float64], covariance: NDArray[np.float64], ray: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Of one window: derivatives (N, 2, 3), covariance (N, N) of a coordinate, and the ray of the first observation."""
    of_point = jacobian.reshape(-1, 3)
    whole = np.kron(covariance, np.eye(2))
    across = np.linalg.svd(ray[None])[2][1:]
    along = of_point @ ray
    basis = np.linalg.qr(of_point @ across.T)[0]
    g = along - basis @ (basis.T @ along)
    shown = np.linalg.norm(g) >= LEAST_PARALLAX_PX
    unit = g / np.linalg.norm(g)
    taken = np.column_stack([basis, unit]) if shown else basis
    squares = np.trace(whole) - np.trace(taken.T @ whole @ taken)
    return squares, len(whole) - taken.shape[1], float(np.sqrt(unit @ whole @ unit)) if shown else np.nan


def rows(motion: str, measurements: Sequence[tn.Measurement]) -> Iterator[dict[str, object]]:
    """What was found and what was predicted, for each kind of noise and length of window."""
    table = found(measurements)
    for name in CASES:
        for window in WINDOWS:
            (row,) = table.filter(tracker=name, window=window).to_dicts()
            expected = predicted(measurements, name, window)
            yield {"motion": motion, "noise": name, "window": window} | {
                quantity: (row[quantity], expected[quantity]) for quantity in SIGMAS
            }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--frames", type=int, default=18)
    parser.add_argument("--features", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--on-surface", action="store_true")
    chosen = parser.parse_args(arguments)
    print(f"{'':32}" + "".join(f"{name:>34}" for name in SIGMAS))
    print(f"{'motion':<10}{'noise':<12}{'window':>10}" + f"{'measured':>14}{'predicted':>12}{'ratio':>8}" * 3)
    for motion in ("sideways", "forward"):
        measurements = measured(motion, **vars(chosen))
        for row in rows(motion, measurements):
            cells = "".join(f"{a:>14.4f}{b:>12.4f}{a / b:>8.3f}" for a, b in (row[name] for name in SIGMAS))
            print(f"{row['motion']:<10}{row['noise']:<12}{row['window']:>10}{cells}", flush=True)


if __name__ == "__main__":
    main()
