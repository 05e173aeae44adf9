"""Run folders of made-up measurements, written once a session."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """The module beside this file, which no import statement reaches under import-mode=importlib."""
    path = Path(__file__).with_name("synthetic.py")
    spec = importlib.util.spec_from_file_location("tracknoise_synthetic", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def make_run(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., RunFolder]:
    """Writes a run folder of a `World` of the given settings; the small one where nothing is given."""
    made: dict[str, RunFolder] = {}

    def make(**settings: Any) -> RunFolder:
        key = repr(sorted(settings.items()))
        if key not in made:
            world = synthetic.World(**{**synthetic.SMALL, **settings})
            made[key] = synthetic.write_run(tmp_path_factory.mktemp("run"), world)
        return made[key]

    return make


@pytest.fixture(scope="session")
def run(make_run: Callable[..., RunFolder]) -> RunFolder:
    """Two scenes, two trackers, two speeds."""
    return make_run()
