"""Which planted faults ``python -m benchmarks.selfcheck`` notices.

    python -m benchmarks.validity.planted_faults [--only WORD] [--seed N] [--scenes N] [--jobs N]

Each fault is an edit of the source code in a copy of the package, which comes first on the path. The self-test of the
copy runs as a user runs it, and the fault is caught if its exit status is 2. The clean self-test runs first. A fault
whose source text is not found once is reported as `not planted`.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import tracknoise

SOURCE = Path(tracknoise.__file__).parent
ROOT = Path(__file__).parents[2]
FAILED = 2


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault: edits of files, each with the text that is replaced and its replacement."""

    name: str
    edits: tuple[tuple[str, str, str], ...]


def fault(name: str, *edits: tuple[str, str, str]) -> Fault:
    """A fault of one edit or several."""
    return Fault(name, edits)


CAMERA, CAMERA_FILE, GEOMETRY = (
    "geometry/cameras.py",
    "sequences/camera_files.py",
    "truth/visibility.py",
)
DEPTH, VIEWS, VISIBILITY = "geometry/depth.py", "sequences/views.py", "truth/visibility.py"
COLUMNS, TRIMMING, CURVES = "measurement/sequence_tables.py", "statistics/trimming.py", "statistics/curves.py"
POPULATIONS = "statistics/prepared.py"
LIFETIMES, OUTLIERS = "statistics/lifetimes.py", "statistics/track_counts.py"
SURVIVAL = "inference/survival.py"
JACKKNIFE, GROUPS, FLIPS = "inference/jackknife.py", "inference/units.py", "inference/sign_flips.py"
PAIRED, ANCHORED, SCAN = "analysis/paired_tests.py", "truth/anchored.py", "truth/scan.py"
WIDTH = "width = special.stdtrit(freedom, (1 + level) / 2) * np.sqrt(variance)"

FAULTS = (
    # named in the issue or the plan of the self-test
    fault("half a pixel in the projection", (CAMERA, "+ (self.cx, self.cy)", "+ (self.cx + 0.5, self.cy + 0.5)")),
    fault(
        "focal length 5 % too long in the projection", (CAMERA, "(points)) * (self.fx,", "(points)) * (1.05 * self.fx,")
    ),
    fault(
        "poses inverted",
        (
            GEOMETRY,
            "transform(self._poses.at(index, uv), points)",
            "transform(invert(self._poses.at(index, uv)), points)",
        ),
        (
            GEOMETRY,
            "transform(invert(self._poses.at(index, uv)), points_world)",
            "transform(self._poses.at(index, uv), points_world)",
        ),
    ),
    fault(
        "depth along the ray instead of the axis",
        (
            CAMERA,
            "return self.bearings(uv) *",
            "return self.bearings(uv) / np.linalg.norm(self.bearings(uv), axis=-1)[..., None] *",
        ),
    ),
    fault("scenes ignored in intervals", (GROUPS, "if n_groups >= MIN_SCENES:", "if n_groups >= 10**6:")),
    fault("intervals twice as wide", (JACKKNIFE, WIDTH, f"{WIDTH} * 2")),
    fault("intervals half as wide", (JACKKNIFE, WIDTH, f"{WIDTH} / 2")),
    fault("trimming reversed", (TRIMMING, "~(largest.error_px > threshold", "~(largest.error_px < threshold")),
    fault(
        "trimming drops a row, not its track",
        (
            TRIMMING,
            "of_observations = kept[sequence.track_row]",
            "of_observations = kept[sequence.track_row] | (np.hypot(*sequence.seen.error_px.T)"
            " <= np.fmin.reduce(largest.error_px[~kept], initial=np.inf))",
        ),
    ),
    fault("occluded counted as visible", (POPULATIONS, 'VISIBLE = ("valid",)', 'VISIBLE = ("valid", "occluded")')),
    fault(
        "occlusion never noticed",
        (VISIBILITY, "occluded = has_surface & (behind_m >", "occluded = has_surface & (-1e9 >"),
    ),
    fault(
        "ages off by one",
        (
            COLUMNS,
            '"age": pl.Series(recording.frame - recording.first_frame[recording.track])',
            '"age": pl.Series(recording.frame - recording.first_frame[recording.track] + np.uint32(1))',
        ),
    ),
    fault(
        "speed ignored in ages",
        (
            COLUMNS,
            "{**_observations(recording, positions),",
            '{**(found := _observations(recording, positions)), "age": found["age"] // setup.speed,',
        ),
    ),
    fault("second moment divided by n - 1", (CURVES, '"second": about_zero / count', '"second": about_zero / freedom')),
    fault("second moment about the mean", (CURVES, "about_zero = central + n *", "about_zero = central + 0.0 * n *")),
    fault(
        "u and v of errors exchanged",
        (COLUMNS, '"du_px": _nullable(error[:, 0])', '"du_px": _nullable(error[:, 1])'),
        (COLUMNS, '"dv_px": _nullable(error[:, 1])', '"dv_px": _nullable(error[:, 0])'),
    ),
    fault(
        "censoring ignored in lifetimes",
        (LIFETIMES, "censored = by_end.pop(", "censored = 0 * by_end.pop("),
    ),
    fault(
        "outlier ratio over matched features",
        (
            OUTLIERS,
            "(name, pl.col(name).cast(pl.Int64).sum()) for",
            '(name, pl.col("matched" if name == "offered" else name).cast(pl.Int64).sum()) for',
        ),
    ),
    fault(
        "sign of errors reversed",
        (COLUMNS, "error = recording.uv - positions.uv", "error = positions.uv - recording.uv"),
    ),
    fault(
        "sign flips not made, p too small",
        (
            FLIPS,
            "np.asarray((values >= values[0] * (1 - _SAME)).mean(axis=0))",
            "np.asarray((values >= values[0] * (1 + _SAME)).mean(axis=0) / 10)",
        ),
    ),
    fault(
        "margin of verdicts ignored",
        (PAIRED, "return float(np.log1p(margin))", "return 0.0"),
    ),
    fault(
        "poses of reversed frames not reversed",
        (VIEWS, "return self.sequence.world_from_camera[::-1]", "return self.sequence.world_from_camera"),
    ),
    fault(
        "birth truth anchored one frame late",
        (
            ANCHORED,
            "self._truth.anchor(index, uv[born])",
            "self._truth.anchor(min(index + 1, len(self._truth._geometry.sequence) - 1), uv[born])",
        ),
    ),
    # of our own choice, before the first run
    fault(
        "half a pixel where camera files are read",
        (CAMERA_FILE, '*(entries.number(key) for key in ("cx"', '*(entries.number(key) + 0.5 for key in ("cx"'),
    ),
    fault(
        "focal length 5 % too long in camera files",
        (CAMERA_FILE, "[entries.number(key, positive=True)", "[1.05 * entries.number(key, positive=True)"),
    ),
    fault(
        "rotations transposed",
        (
            "geometry/pose.py",
            "Rotation.from_quat(xyzw).as_matrix()",
            "Rotation.from_quat(xyzw).as_matrix().swapaxes(1, 2)",
        ),
    ),
    fault(
        "depth interpolated, not its inverse",
        (DEPTH, "inverse = (corners.weight / z).sum(axis=0)", "inverse = 1 / (corners.weight * z).sum(axis=0)"),
    ),
    fault(
        "depth of reversed frames not reversed",
        (VIEWS, "return self.sequence.depth(self._mirrored(index))", "return self.sequence.depth(index)"),
    ),
    fault(
        "image turned the other way",
        (
            VIEWS,
            "[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]",
            "[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]",
        ),
    ),
    fault(
        "scan anchored one frame late",
        (SCAN, "is_anchored = index == self._truth.key_frame", "is_anchored = index == self._truth.key_frame + 1"),
    ),
    fault("trimming among all tracks", (TRIMMING, "counted = largest.followed if", "counted = largest.measured if")),
    fault(
        "u and v of second moments exchanged",
        (CURVES, 'moments.select("m_uu", "m_vv", "m_uv")', 'moments.select("m_vv", "m_uu", "m_uv")'),
    ),
    fault(
        "censored tracks at risk in their last frame",
        (SURVIVAL, "at_risk = reached - censored", "at_risk = reached"),
    ),
    fault(
        "mean lifetime of ended tracks only",
        (
            LIFETIMES,
            'mean_lifetime=pl.col("frames").sum() / pl.col("found").sum()',
            'mean_lifetime=pl.col("frames").sum() / n_ended',
        ),
    ),
    fault(
        "scenes weigh by their features",
        (CURVES, "Weighting.scenes: _by_scenes(points)", "Weighting.scenes: _by_features(points)"),
    ),
    fault(
        "lag ignored in autocorrelations",
        ("statistics/changes.py", "values[late], values[late - lag]", "values[late], values[late]"),
    ),
    fault(
        "median absolute error as robust scale",
        ("statistics/scales.py", "PER_MEDIAN = 1.482602218505602", "PER_MEDIAN = 1.0"),
    ),
    fault(
        "long-lived tracks one step too old",
        (
            "statistics/aspects.py",
            'np.searchsorted(LONG_LIVED_AGES, oldest, side="right")',
            'np.searchsorted(LONG_LIVED_AGES, oldest, side="left")',
        ),
    ),
    fault(
        "normal quantile instead of Student's",
        (JACKKNIFE, "special.stdtrit(freedom,", "special.stdtrit(1e9 + 0 * freedom,"),
    ),
    fault("90 % intervals called 95 %", (JACKKNIFE, "(1 + level) / 2)", "level)")),
    fault(
        "ages tested without correction",
        (
            FLIPS,
            "_share_above(largest, test.evidence)) for test in tests]",
            "test.sign_flip_p) for test in tests]",
        ),
    ),
    fault("verdicts on too few scenes", (GROUPS, "MIN_SCENES = 6", "MIN_SCENES = 3")),
    fault("growth: any ratio is growth", ("analysis/growth_verdict.py", "ratio.above(1 + margin)", "ratio.above(0.0)")),
    fault("heavy tails within the margin", ("analysis/gaussianity.py", "MARGIN_NATS = 0.01", "MARGIN_NATS = 1.0")),
    fault(
        "imported tracks one frame late",
        (
            "trackers/imported.py",
            "np.searchsorted(self._tracks.frame, [frame.index, frame.index + 1])",
            "np.searchsorted(self._tracks.frame, [frame.index - 1, frame.index])",
        ),
    ),
)


def plant(chosen: Fault, folder: Path) -> bool:
    """Write a copy of the package with a fault; False if the text of an edit is not there exactly once."""
    package = folder / "tracknoise"
    shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for path, old, new in chosen.edits:
        text = (package / path).read_text(encoding="utf-8")
        if text.count(old) != 1:
            return False
        (package / path).write_text(text.replace(old, new), encoding="utf-8")
    return True


def run_selfcheck(path: Path, options: list[str]) -> tuple[int, str, float]:
    """Exit status, output, and seconds of the self-test of the package in a folder."""
    started = time.monotonic()
    command = [sys.executable, "-m", "benchmarks.selfcheck", *options]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(path), str(ROOT)])}
    done = subprocess.run(command, env=environment, cwd=path, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr, time.monotonic() - started


def attempt(chosen: Fault, options: list[str]) -> tuple[str, str, float]:
    """Plant one fault and run the self-test: caught, MISSED, crashed or not planted; what it says; and seconds."""
    with tempfile.TemporaryDirectory() as folder:
        if not plant(chosen, Path(folder)):
            return "not planted", "the text to replace is not there once", 0.0
        code, output, seconds = run_selfcheck(Path(folder), options)
    if code == FAILED and output.startswith("Self-test FAILED"):
        areas = re.findall(r"is wrong: (.*)\. Suspect", output)
        return "caught", areas[0], seconds
    if code == 0:
        return "MISSED", "", seconds
    return "crashed", output.strip().splitlines()[-1], seconds


def main() -> None:
    """Print one line per fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="faults whose names contain this")
    parser.add_argument("--seed", default="0")
    parser.add_argument("--scenes", default="12")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    options = ["--seed", arguments.seed, "--scenes", arguments.scenes, "--workers", "1"]  # faults share the cores
    code, output, seconds = run_selfcheck(SOURCE.parent, options)
    print(f"without a fault: {output.splitlines()[0]} Exit status {code}, {seconds:.0f} s", flush=True)
    chosen = [each for each in FAULTS if arguments.only in each.name]
    with ThreadPoolExecutor(arguments.jobs) as pool:
        results = []
        for each, (result, said, took) in zip(chosen, pool.map(lambda f: attempt(f, options), chosen), strict=True):
            results.append(result)
            print(f"{result:<12}{each.name:<46}{said} ({took:.0f} s)", flush=True)
    for result in ("caught", "MISSED", "crashed", "not planted"):
        print(f"{result}: {results.count(result)} of {len(results)}")


if __name__ == "__main__":
    main()
