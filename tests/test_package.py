"""The package's public face: quick to import, complete, and typed."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import tracknoise


def test_every_public_name_can_be_loaded():
    for name in tracknoise.__all__:
        assert getattr(tracknoise, name).__name__ == name


def test_editors_and_type_checkers_see_every_public_name():
    stub = ast.parse(Path(tracknoise.__file__).with_suffix(".pyi").read_text())
    shown = {name.name: node.module for node in stub.body if isinstance(node, ast.ImportFrom) for name in node.names}
    assert sorted(shown) == sorted(tracknoise.__all__)
    for name, module in shown.items():
        assert getattr(sys.modules[module], name) is getattr(tracknoise, name)


def test_the_signature_of_measure_can_be_read():
    signature = str(inspect.signature(tracknoise.measure))
    assert "trackers: 'Trackers'" in signature
    assert "corrections: 'Corrections' = Corrections()" in signature
    assert repr(tracknoise.Corrections(k1=0.1)) == "Corrections(k1=0.1)"


def test_parameters_of_public_functions_are_named_and_typed():
    """So that editors complete them; those behind ``**`` are completed by few."""
    public = [getattr(tracknoise, name) for name in tracknoise.__all__]
    choosing = [getattr(tracknoise.Run, name) for name in ("results", "intervals", "observations", "tracks", "track")]
    for function in (*filter(inspect.isfunction, public), *choosing):
        parameters = inspect.signature(function).parameters
        untyped = [name for name, parameter in parameters.items() if parameter.annotation is inspect.Parameter.empty]
        assert untyped == ["self"] * (function in choosing), function.__qualname__
        assert {"tracker", "speed"} <= {*parameters} or function not in choosing, function.__qualname__


def test_importing_loads_nothing_heavy():
    code = "import sys, tracknoise; print(sorted({'numpy', 'cv2', 'polars', 'altair', 'dask'} & set(sys.modules)))"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stdout.strip() == "[]"


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom tracknoise.cli.app import main\n"
        "try: main(['run', '--help'])\nexcept SystemExit: pass\n"
        "print(sorted({'numpy', 'cv2', 'polars', 'altair', 'dask'} & set(sys.modules)), file=sys.stderr)"
    )
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stderr.strip() == "[]"
    assert "Example" in finished.stdout


def test_a_run_starts_without_what_it_does_not_need():
    """`scipy.stats` and what it imports would take a third of the processor time of the start."""
    code = (
        "import sys, tracknoise.experiments.execute\n"
        "print(sorted({'scipy.stats', 'scipy.ndimage', 'altair', 'distributed'} & set(sys.modules)))"
    )
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stdout.strip() == "[]"


def test_the_program_runs_as_a_module():
    finished = subprocess.run(
        [sys.executable, "-m", "tracknoise", "--version"], capture_output=True, text=True, check=True
    )
    assert tracknoise.__version__ in finished.stdout
