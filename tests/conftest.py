"""Where the real samples lie: `TRACKNOISE_DATA`, or ``../shared/data`` beside the repository."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest


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
