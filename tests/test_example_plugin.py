"""The example of a plug-in, installed as a package of its own and used by another process."""

import base64
import hashlib
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tracknoise as tn

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "plugin"
MOST_LINES = 60
"""Of each file: the classes are about 30 lines long."""


def wheel(folder: Path) -> Path:
    """The wheel that the build backend of the example would make; backends need a network to be installed."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    name = f"{project['name'].replace('-', '_')}-{project['version']}"
    groups = project["entry-points"].items()
    points = "".join(f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in items.items()) for group, items in groups)
    files = {
        path.relative_to(EXAMPLE).as_posix(): path.read_text() for path in EXAMPLE.rglob("tracknoise_example/*.py")
    }
    files |= {
        f"{name}.dist-info/METADATA": "Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n".format(**project),
        f"{name}.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{name}.dist-info/entry_points.txt": points,
    }
    record = f"{name}.dist-info/RECORD"
    rows = [f"{path},sha256={_digest(text)},{len(text.encode())}" for path, text in files.items()]
    path = folder / f"{name}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for file, text in {**files, record: "\n".join([*rows, f"{record},,"]) + "\n"}.items():
            archive.writestr(file, text)
    return path


def _digest(text: str) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()


@pytest.fixture(scope="module")
def environment(tmp_path_factory) -> dict[str, str]:
    """An environment in which the example is installed."""
    folder = tmp_path_factory.mktemp("plugin")
    target = folder / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", target, wheel(folder)]
    subprocess.run(pip, check=True, capture_output=True, env={**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"})
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(target), str(ROOT / "src"), *sys.path])}


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("archives")
    sequence = tn.open_sequence("simulated", motions=["forward"], frames=6, width=160, height=120, supersampling=1)
    np.savez(
        folder / "office.npz",
        images=np.stack([sequence.image(index) for index in range(6)]),
        poses=sequence.world_from_camera,
        K=sequence.camera.matrix,
        depths=np.stack([1000 * sequence.depth(index).depth_m for index in range(6)]),
    )
    return folder


def tracknoise(environment: dict[str, str], *arguments: object) -> str:
    program = "from tracknoise.cli.app import main; main()"
    command = [sys.executable, "-c", program, *map(str, arguments)]
    finished = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def test_the_tracker_and_the_reader_are_listed_with_their_options(environment):
    assert "Shi-Tomasi corners of the first frame" in tracknoise(environment, "trackers")
    assert "metres_per_unit = 1.0" in tracknoise(environment, "datasets", "archive")


def test_an_experiment_measures_the_tracker_on_the_data_of_the_reader(environment, data, tmp_path):
    (tmp_path / "experiment.toml").write_text(
        f'name = "example"\n[dataset]\nreader = "archive"\nroot = "{data}"\noptions = {{ metres_per_unit = 0.001 }}\n'
        '[[trackers]]\nkind = "corners"\noptions = { most = 100 }\n[statistics]\nmin_features = 5\n'
    )
    options = ("--quiet", "--no-report", "--workers", 1)
    tracknoise(environment, "run", tmp_path / "experiment.toml", "--out", tmp_path / "run", *options)
    run = tn.open_run(tmp_path / "run")
    errors = run.observations()
    assert errors["tracker"].unique().to_list() == ["corners"]
    assert 20 < errors["track"].n_unique() <= 100
    later = errors.filter(pl.col("age") > 0, pl.col("truth") == "valid")
    assert later.select(pl.col("du_px").abs().median()).item() < 0.5
    assert '"tracknoise-example": "1.0"' in (tmp_path / "run" / "manifest.json").read_text()


def test_the_example_is_short():
    for file in EXAMPLE.rglob("tracknoise_example/*.py"):
        assert len(file.read_text().splitlines()) <= MOST_LINES, file


def test_the_documentation_has_the_entry_points_of_the_example():
    points = (EXAMPLE / "pyproject.toml").read_text().split("dependencies")[1].split("\n\n", 1)[1]
    assert points.split("\n\n[tool")[0] in (ROOT / "docs" / "your-tracks.md").read_text()
