"""Run folders of made-up measurements, written once for all processes that run the tests."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.report.synthetic import SMALL, World, tell, write_run

from tracknoise.sequences.images import encode_webp
from tracknoise.tables.schema import FILM
from tracknoise.tables.store import RunFolder


def filmed(run: RunFolder, path: Path, *, n_frames: int = 6) -> RunFolder:
    """A copy of a run that keeps grey images of the first frames of its first scene."""
    copied = RunFolder(shutil.copytree(run.path, path))
    manifest = copied.manifest()
    key, entry = sorted(manifest.sequences.items())[0]
    image = encode_webp(np.full((entry.height, entry.width), 90, np.uint8), quality=60)
    table = pl.DataFrame({"frame": range(n_frames), "image": [image] * n_frames}, schema=dict(FILM))
    tables = {name: copied.sequence_table(name, key) for name in entry.sha256 if name != "snapshots"} | {"film": table}
    hashes = copied.write_sequence(key, tables, copied.snapshot(key))
    manifest.sequences[key] = replace(entry, sha256=hashes)
    copied.write_manifest(manifest)
    return copied


@pytest.fixture(scope="session")
def make_run(
    made_once: Callable[[str, Callable[[Path], object]], Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., RunFolder]:
    """Writes a run folder of a `World` of the given settings; the small one where nothing is given.

    Tests of one process share the folder of the same settings; every process has a copy of its own.
    """
    made: dict[str, RunFolder] = {}

    def make(**settings: Any) -> RunFolder:
        world = World(**{**SMALL, **settings})
        name = sha256(repr(world).encode()).hexdigest()[:16]
        if name not in made:
            original = made_once(name, lambda path: write(path, world))
            made[name] = RunFolder(shutil.copytree(original, tmp_path_factory.mktemp("run") / "run"))
        return made[name]

    def write(path: Path, world: World) -> None:
        """Those with sentences are made from those without."""
        if world.told:
            untold = make(**{**vars(world), "told": False})
            tell(RunFolder(shutil.copytree(untold.path, path)), world)
        else:
            write_run(path, world)

    return make
