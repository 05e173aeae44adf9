"""What the visual-inertial odometry Basalt makes of exported noise: the unmodified node of the package depthai.

    python3 -m venv ENV && ENV/bin/pip install depthai==3.12.0 opencv-python-headless
    python -m benchmarks.basalt.trial FOLDER --python ENV/bin/python                 # 10 sequences, about an hour
    python -m benchmarks.basalt.trial FOLDER --python ENV/bin/python --arms shipped export --imu-seeds 1

Needs Linux and g++. In FOLDER, sequences are simulated in the layout of EuRoC with a second camera, and the noise of
the preset `basalt-stereo` is fitted to other scenes, of another seed and of the world `plaza`. Basalt then runs on each
sequence with each setting of `vio_obs_std_dev` and `vio_obs_huber_thresh`, and with several draws of inertial noise of
EuRoC's densities. All else is what the node sets without a file (`config.json`). The node asks a device for its
calibration only: a preloaded library (`shim.cpp`) answers instead. What is in FOLDER already is not made again.

Prints, for each setting, the position error after alignment of yaw and position (ATE) as the geometric mean over
sequences, and ratios of errors to those of the first setting with 95 % bootstrap intervals over sequences: ATE, and the
change of pose over 1 s (RPE), of all frames and of those later than 4 s. Draws of one sequence are averaged first, in
log. All errors are root mean squares. Runs that lack poses are counted and left out.
"""

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.harness import program
from benchmarks.program import ended
from tracknoise.exceptions import SettingsError
from tracknoise.simulation.inertial import RATE_HZ, InertialNoise, SmoothPath, inertial_readings

SEQUENCES = (
    *("arvr-plaza-101", "linear-objects-102", "forward-plaza-103", "sideways-objects-104", "fixating-plaza-105"),
    *("arvr-objects-106", "sideways-plaza-107", "linear-objects-108", "forward-plaza-109", "arvr-plaza-110"),
)
"""Motion, world and seed."""
FIT = {"motions": ("arvr", "forward", "sideways", "fixating"), "world": "plaza", "worlds": 2, "frames": 80, "seed": 7}
"""Scenes of the fit: options of the reader `simulated`."""
CAMERA = {"width": 480, "height": 360, "hfov_deg": 80.0, "baseline_m": 0.11}
"""Options of the reader `simulated`."""
FRAME_RATE_HZ = 20
LATE_S = 4.0
LIMIT_S = 600
"""Longest run of Basalt."""
METRICS = ("ate_mm", "late_ate_mm", "rpe_mm", "late_rpe_mm", "rpe_deg", "late_rpe_deg")
_BEYOND = 20
"""Readings after the last frame."""
_FIRST_FROM_FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Turns poses of x forward, y left, z up into those of x right, y down, z forward."""
_RESAMPLES = 10_000


class Setting(NamedTuple):
    """Standard deviation of observations and threshold of Huber's loss, px."""

    sigma_px: float
    huber_px: float


SHIPPED = Setting(0.5, 1.0)
ARMS = ("shipped", "export", "sigma", "huber", "double")
"""As shipped; as exported; either exported value alone; both doubled."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A simulated sequence: `poses` (n, 4, 4) are world_from_camera of the frames, true."""

    name: str
    folder: Path
    times_ns: NDArray[np.int64]
    poses: NDArray[np.float64]

    @classmethod
    def of(cls, folder: Path) -> "Recording":
        rows = np.loadtxt(folder / "mav0/state_groundtruth_estimate0/data.csv", delimiter=",")
        times_ns = np.loadtxt(folder / "mav0/cam0/data.csv", delimiter=",", usecols=0, dtype=np.int64)
        rows = rows[np.searchsorted(rows[:, 0], times_ns)]
        poses = np.tile(np.eye(4), (len(rows), 1, 1))
        poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:8], scalar_first=True).as_matrix()
        poses[:, :3, 3] = rows[:, 1:4]
        return cls(folder.name, folder, times_ns, poses)

    def write_readings(self, path: Path, *, seed: int) -> None:
        """Readings of an inertial sensor at the camera, which go on after the last frame."""
        at_s = np.arange(round((self.times_ns[-1] - self.times_ns[0]) * RATE_HZ / 1e9) + 1 + _BEYOND) / RATE_HZ
        smooth = SmoothPath((self.times_ns - self.times_ns[0]) / 1e9, self.poses)
        read = inertial_readings(smooth, at_s, np.random.default_rng((seed, int(self.name.rpartition("-")[2]))))
        rows = np.column_stack([self.times_ns[0] + np.round(at_s * 1e9), read.gyro, read.accelerometer])
        np.savetxt(path, rows, delimiter=",", fmt=["%d"] + ["%.17g"] * 6)

    def errors(self, found: NDArray[np.float64]) -> dict[str, float]:
        """`METRICS` of poses (n, 7): positions, m, and quaternions w x y z of x forward, y left, z up."""
        poses = np.tile(np.eye(4), (len(found), 1, 1))
        poses[:, :3, :3] = Rotation.from_quat(found[:, 3:], scalar_first=True).as_matrix() @ _FIRST_FROM_FORWARD
        poses[:, :3, 3] = found[:, :3]
        late = round(LATE_S * FRAME_RATE_HZ)
        every = (*_errors(poses, self.poses), *_errors(poses[late:], self.poses[late:]))
        return dict(zip(METRICS, (every[index] for index in (0, 3, 1, 4, 2, 5)), strict=True))


def _errors(found: NDArray[np.float64], true: NDArray[np.float64]) -> tuple[float, float, float]:
    """ATE, mm, and RPE, mm and degrees."""
    own, other = (poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0) for poses in (found, true))
    cross = own[:, :2].T @ other[:, :2]
    yaw = Rotation.from_euler("z", np.arctan2(cross[0, 1] - cross[1, 0], cross[0, 0] + cross[1, 1]))
    moved, truly = (np.linalg.inv(poses[:-FRAME_RATE_HZ]) @ poses[FRAME_RATE_HZ:] for poses in (found, true))
    turned = Rotation.from_matrix(moved[:, :3, :3].swapaxes(1, 2) @ truly[:, :3, :3]).magnitude()
    metres = (np.linalg.norm(each, axis=1) for each in (yaw.apply(own) - other, (moved - truly)[:, :3, 3]))
    ate, rpe, angle = (float(np.sqrt(np.mean(values**2))) for values in (*metres, turned))
    return 1e3 * ate, 1e3 * rpe, float(np.rad2deg(angle))


def recordings(folder: Path, frames: int, count: int) -> list[Recording]:
    """The sequences, simulated unless they exist."""
    made = []
    for name in SEQUENCES[:count]:
        path = folder / "sequences" / name
        if not path.exists():
            motion, world, seed = name.split("-")
            options = [f"--option={key}={value}" for key, value in {**CAMERA, "world": world, "seed": seed}.items()]
            scene = [f"--motion={motion}", f"--frames={frames}", *options]
            program("simulate", "-q", "--layout=euroc", *scene, "-o", path)
        made.append(Recording.of(path))
        if len(made[-1].poses) != frames:
            raise SettingsError(f"{path}: found {len(made[-1].poses)} frames, expected {frames}")
    return made


def exported(folder: Path) -> Setting:
    """What `tracknoise export` writes for Basalt, of a run."""
    run = folder / "fit"
    if not (run / "statistics").exists():
        lines = ['name = "basalt-fit"', "speeds = [1]", 'keep = "observations"']
        lines += ['trackers = [{ preset = "basalt-stereo" }]', "[dataset]", 'reader = "simulated"']
        lines += ["[dataset.options]", f"imaging = {{ rate_hz = {FRAME_RATE_HZ:.1f} }}"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in {**FIT, **CAMERA}.items()]
        run.with_suffix(".toml").write_text("\n".join(lines))
        program("run", run.with_suffix(".toml"), "-q", "--no-report", "--workers=1", "--out", run)
    out = folder / "export"
    program("export", run, "-q", "--to=basalt", "--tracker=basalt-stereo", "--force", "-o", out)
    values = json.loads((out / "basalt_noise.json").read_text())["value0"]
    return Setting(values["config.vio_obs_std_dev"], values["config.vio_obs_huber_thresh"])


def settings_of(arms: Sequence[str], folder: Path) -> dict[str, Setting]:
    """What each arm sets."""
    own = exported(folder) if set(arms) - {"shipped"} else SHIPPED
    alone = Setting(own.sigma_px, SHIPPED.huber_px), Setting(SHIPPED.sigma_px, own.huber_px)
    every = (SHIPPED, own, *alone, Setting(2.0 * own.sigma_px, 2.0 * own.huber_px))
    named = dict(zip(ARMS, every, strict=True))
    return {arm: named[arm] for arm in arms}


class Basalt:
    """Runs the node in an environment that has depthai."""

    def __init__(self, python: Path, folder: Path) -> None:
        self._python, self._folder = python, folder
        if shutil.which(python) is None:
            raise SettingsError(f"found no {python}, expected the Python of an environment with depthai")
        find = "from importlib.metadata import files; print(*(f for f in files('depthai') if 'depthaicore' in f.name))"
        asked = subprocess.run([python, "-c", find], capture_output=True, text=True, check=False)
        if asked.returncode or len(asked.stdout.split()) != 1:
            raise SettingsError(f"{python}: found no core library of depthai, expected an environment with depthai")
        if shutil.which("g++") is None:
            raise SettingsError("found no g++, which builds the library that stands in for a device")
        shim, source = folder / "basalt_shim.so", Path(__file__).with_name("shim.cpp")
        subprocess.run(["g++", "-std=c++17", "-O2", "-shared", "-fPIC", source, "-o", shim, "-ldl"], check=True)
        core, calibration = Path(asked.stdout.strip()).name, str(folder / "calibration.json")
        own = {"LD_PRELOAD": str(shim), "BASALT_CORE": core, "BASALT_CALIBRATION": calibration}
        self._environment = {**os.environ, **own}
        self._config = json.loads(Path(__file__).with_name("config.json").read_text())["value0"]

    def poses(self, recording: Recording, setting: Setting, *, seed: int) -> NDArray[np.float64]:
        """Poses (n, 7) of the frames that have one."""
        readings, config, job = (self._folder / name for name in ("readings.csv", "config.json", "job.json"))
        out = self._folder / "poses" / f"{key_of(recording.name, setting, seed)}.csv"
        out.parent.mkdir(exist_ok=True)
        out.unlink(missing_ok=True)
        recording.write_readings(readings, seed=seed)
        values = {"config.vio_obs_std_dev": setting.sigma_px, "config.vio_obs_huber_thresh": setting.huber_px}
        config.write_text(json.dumps({"value0": {**self._config, **values}}))
        sensors = [recording.folder / f"mav0/cam{camera}/sensor.yaml" for camera in (0, 1)]
        cameras, noise = [yaml.safe_load(path.read_text()) for path in sensors], InertialNoise()
        first, second = (np.reshape(camera["T_BS"]["data"], (4, 4)) for camera in cameras)
        told = {
            "sequence": str(recording.folder),
            "times_ns": recording.times_ns.tolist(),
            "size": cameras[0]["resolution"],
            "intrinsics": [camera["intrinsics"] for camera in cameras],
            "first_from_second": (np.linalg.inv(first) @ second).tolist(),
            "gyro": noise.gyro,
            "accelerometer": noise.accelerometer,
            "readings": str(readings),
            "config": str(config),
            "poses": str(out),
        }
        job.write_text(json.dumps(told))
        node = str(Path(__file__).with_name("node.py"))
        command = ["timeout", str(LIMIT_S), str(self._python), node, str(job)]
        ran = subprocess.run(command, env=self._environment, capture_output=True, text=True, check=False)
        if not out.exists() and ran.returncode == 1:
            raise SettingsError(f"Basalt: {(ran.stderr.strip().splitlines() or ['no message'])[-1]}")
        return np.loadtxt(out, delimiter=",", ndmin=2) if out.exists() else np.empty((0, 7))


def key_of(sequence: str, setting: Setting, seed: int) -> str:
    """Name of a run."""
    return f"{sequence}.imu{seed}.{setting.sigma_px:g}.{setting.huber_px:g}"


Results = Mapping[str, Mapping[str, float]]


def table(results: Results, names: Sequence[str], arms: Mapping[str, Setting], draws: int) -> str:
    """Rows by arm."""
    header = "".join(f"{name.replace('_', ' ').removesuffix(' mm'):>21}" for name in METRICS)
    lines, first = [f"{'':15}{'sigma px':>9}{'Huber px':>9}{'ATE mm':>8}{'lost':>5}{header}"], None
    for arm, setting in arms.items():
        runs = [[results[key_of(name, setting, seed)] for seed in range(draws)] for name in names]
        own = np.log([[[run.get(metric, np.nan) for metric in METRICS] for run in of] for of in runs])
        first = own if first is None else first
        ratios = np.ma.masked_invalid(own - first).mean(axis=1)  # (sequences, metrics)
        cells = "".join(f"{_interval(column.compressed()):>21}" for column in ratios.T)
        ate, lost = np.exp(np.ma.masked_invalid(own[..., 0]).mean(axis=1).mean()), np.isnan(own[..., 0]).sum()
        lines.append(f"{arm:15}{setting.sigma_px:9.4f}{setting.huber_px:9.4f}{ate:8.1f}{lost:5d}{cells}")
    return "\n".join(lines)


def _interval(logs: NDArray[np.float64]) -> str:
    """A ratio, from its logarithms of sequences, with a 95 % bootstrap interval."""
    if not len(logs):
        return "-"
    draws = np.random.default_rng(0).choice(logs, (_RESAMPLES, len(logs))).mean(axis=1)
    value, low, high = np.exp([logs.mean(), *np.quantile(draws, [0.025, 0.975])])
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.basalt.trial", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="for sequences, fits and results")
    parser.add_argument("--python", type=Path, required=True, help="of an environment with depthai and OpenCV")
    parser.add_argument("--frames", type=int, default=300, help="of each sequence")
    parser.add_argument("--sequences", type=int, default=len(SEQUENCES), help="how many, from the first on")
    parser.add_argument("--imu-seeds", type=int, default=2, help="draws of inertial noise for each sequence")
    parser.add_argument(
        "--arms", nargs="+", choices=ARMS, default=ARMS, help="settings; ratios are to the first of them here"
    )
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    folder = options.folder.resolve()
    basalt = Basalt(options.python.absolute(), folder)
    arms, sequences = settings_of(options.arms, folder), recordings(folder, options.frames, options.sequences)
    path = folder / "results.json"
    results = json.loads(path.read_text()) if path.exists() else {}
    for seed, recording, setting in itertools.product(range(options.imu_seeds), sequences, arms.values()):
        key = key_of(recording.name, setting, seed)
        if key not in results:
            found = basalt.poses(recording, setting, seed=seed)
            results[key] = recording.errors(found) if len(found) == len(recording.poses) else {}
            path.write_text(json.dumps(results, indent=1))
            print(key, results[key] or f"lost after {len(found)} frames", file=sys.stderr, flush=True)
    print(table(results, [recording.name for recording in sequences], arms, options.imu_seeds))
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))
