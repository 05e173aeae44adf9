"""Where the real samples lie (`TRACKNOISE_DATA`, or ``../shared/data``), and folders that many tests begin with."""

import fcntl
import gc
import os
import pickle
import shutil
import signal
import stat
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path
from pkgutil import resolve_name
from types import SimpleNamespace
from typing import Any
from weakref import WeakSet

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import NDArray
from tests import lean

from tracknoise import processes
from tracknoise.sequences import simulated
from tracknoise.simulation.render import RenderedWorld
from tracknoise.simulation.world import Scenery

# How long an example takes depends on what else runs. The same examples each time, so that a change is judged by what
# it changes; `pytest --hypothesis-profile=explore` draws others.
settings.register_profile("tracknoise", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, derandomize=False)
settings.load_profile("tracknoise")

gc.disable()  # until all is collected: of what tests are made of, next to nothing is garbage

# Each of the hundred programs that tests start would compile the package again: see the Makefile.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


_WORLDS: WeakSet[RenderedWorld] = WeakSet()
_make_world = RenderedWorld.__init__


def _make_noted_world(world: RenderedWorld, *about: Any) -> None:
    _make_world(world, *about)
    _WORLDS.add(world)


RenderedWorld.__init__ = _make_noted_world


def pytest_collection_finish() -> None:
    """What was collected stays until the end: to search it for garbage again and again takes processor time."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="module", autouse=True)
def freed_memory() -> Iterator[None]:
    """What a module needed goes back to the system: the process that runs tests would keep the most of each.

    What is left is not searched again: with all that was imported, that would take a second for each module.
    """
    yield
    for world in _WORLDS:  # those that other modules look at again are made again
        world._renderers.clear()
        for name in ("_scenery", "raycaster"):
            world.__dict__.pop(name, None)
    gc.collect()
    gc.freeze()
    processes.release_memory()


_SIGNALS = {number: signal.getsignal(number) for number in processes.ENDING}


def _restore_signals() -> None:
    for number, handler in _SIGNALS.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def kept_signals() -> Iterator[None]:
    """The command line, which tests and what they share call in this process, changes how signals are handled."""
    _restore_signals()
    yield
    _restore_signals()


@pytest.fixture(scope="session", autouse=True)
def unfitted() -> Iterator[None]:
    """Runs have no noise models but where a test wants them (`tests.lean.with_models`)."""
    with lean.without_models():
        yield


@pytest.fixture(scope="session")
def data_root() -> Path:
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    root = Path(os.environ.get("TRACKNOISE_DATA", default))
    if not root.is_dir():
        pytest.skip(f"no real samples: {root} is no folder (TRACKNOISE_DATA names another place)")
    return root


@pytest.fixture(scope="session")
def sample(data_root: Path) -> Callable[[str], Path]:
    """Gives the folder of a real sample by name, or skips the test."""

    def folder(name: str) -> Path:
        if not (data_root / name).is_dir():
            pytest.skip(f"no real sample {name!r} in {data_root} (TRACKNOISE_DATA names another place)")
        return data_root / name

    return folder


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Writes a folder once for all processes of a test session; whoever changes something changes a copy.

    The first process that asks for a name writes the folder; another that asks meanwhile waits. The lock goes with the
    process that holds it, and what a process that died left unfinished is written again.
    """
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "made-once"
    shared.mkdir(exist_ok=True)

    def folder(name: str, write: Callable[[Path], object]) -> Path:
        original, written = shared / name, shared / f"{name}.written"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not written.exists():
                shutil.rmtree(original, ignore_errors=True)
                write(original)
                written.touch()
        return original

    return folder


@pytest.fixture(scope="session", autouse=True)
def kept_worlds(made_once: Callable[[str, Callable[[Path], object]], Path]) -> Iterator[None]:
    """Tests of many modules look at the same few simulated worlds, which take longer to make than to look at.

    Each is made once for all processes, whose memory holds the arrays of its file once.
    """

    built = simulated._kept.__wrapped__

    def written(folder: Path, *about: object) -> None:
        folder.mkdir()
        buffers: list[pickle.PickleBuffer] = []
        (folder / "world").write_bytes(pickle.dumps(built(*about), 5, buffer_callback=buffers.append))
        for place, buffer in enumerate(buffers):
            (folder / str(place)).write_bytes(buffer.raw())

    @lru_cache(maxsize=2)
    def kept(*about: object) -> Scenery:
        name = "world-" + sha256(repr(about).encode()).hexdigest()[:16]
        folder = made_once(name, lambda path: written(path, *about))
        arrays = [np.memmap(folder / str(place), mode="r") for place in range(len(list(folder.iterdir())) - 1)]
        return pickle.loads((folder / "world").read_bytes(), buffers=arrays)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated, "_kept", _Pickled(kept))
        yield


class _Pickled:
    """Stands for `simulated._kept`, also where it is pickled: another process has no such patch."""

    def __init__(self, kept: Callable[..., Scenery]) -> None:
        self._kept = kept

    def __call__(self, *about: object) -> Scenery:
        return self._kept(*about)

    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return resolve_name, (f"{simulated.__name__}:_kept",)


_IMAGES: dict[tuple[str, bytes, int], NDArray[np.uint8]] = {}
_MOST_IMAGES = 400
_SHOWING = ("contract", "sequences", "simulation")
"""Folders whose tests are about what is rendered."""
_render = simulated.SimulatedSequence.image


def _shown(sequence: simulated.SimulatedSequence, index: int) -> NDArray[np.uint8]:
    build = sequence.world._build
    if not isinstance(build, partial) or build.func is not simulated._kept:
        return _render(sequence, index)  # its world may depend on files
    about = repr((build.args, sequence.settings, sequence.id, sequence.camera))
    name = about, sequence.world_from_camera.tobytes(), index
    if name not in _IMAGES:
        if len(_IMAGES) == _MOST_IMAGES:
            del _IMAGES[next(iter(_IMAGES))]
        _IMAGES[name] = _render(sequence, index)
    return _IMAGES[name].copy()


@pytest.fixture(scope="module", autouse=True)
def kept_images(request: pytest.FixtureRequest) -> Iterator[None]:
    """A frame of a simulated sequence is rendered once in a process, except where tests are about what is rendered."""
    with pytest.MonkeyPatch.context() as patch:
        if not {*_SHOWING} & {*request.path.parts}:
            patch.setattr(simulated.SimulatedSequence, "image", _shown)
        yield


_PIPES = """
import stat
from types import SimpleNamespace
from typing import Any
from weakref import WeakSet

import tracknoise.foreign_files as files

files.stat = SimpleNamespace(
    S_ISREG=lambda mode: stat.S_ISREG(mode) or stat.S_ISFIFO(mode), S_ISDIR=stat.S_ISDIR
)
"""


@pytest.fixture
def pipes_are_files(monkeypatch, tmp_path_factory):
    """Pipes count as regular files, here and in every program that is started: whoever reads one waits for a writer."""
    folder = tmp_path_factory.mktemp("pipes")
    (folder / "sitecustomize.py").write_text(_PIPES)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]))
    either = SimpleNamespace(S_ISREG=lambda mode: stat.S_ISREG(mode) or stat.S_ISFIFO(mode), S_ISDIR=stat.S_ISDIR)
    monkeypatch.setattr("tracknoise.foreign_files.stat", either)
