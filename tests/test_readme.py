"""The README's example does what it says."""

import os
import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
SEEN = {"MYPYPATH": str(README.parent / "src")}


def test_the_python_example_runs_and_its_tables_are_as_described(capsys):
    code, _ = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)  # the other: tests/api
    scope: dict = {}
    exec(code, scope)
    assert {"du_px", "dv_px", "truth"} <= set(scope["errors"].columns)
    assert set(scope["curves"]["statistic"].unique()) == {"nu", "eta", "Phi", "central"}
    assert set(scope["curves"].select("tracker", "speed").unique().iter_rows()) == {
        (tracker, speed) for tracker in ("lucas-kanade", "correspondence") for speed in (1, 2)
    }
    assert scope["lifetimes"]["survival"].drop_nulls().is_between(0, 1).all()
    assert "lucas-kanade" in capsys.readouterr().out


def test_the_python_examples_pass_mypy_strict(tmp_path):
    """As in a user's project, which sees the types of the package."""
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)):
        file = tmp_path / f"example_{number}.py"
        file.write_text(code)
        command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", file]
        checked = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=os.environ | SEEN)
        assert checked.returncode == 0, checked.stdout + checked.stderr


def test_every_file_that_the_readme_links_to_exists():
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README.read_text())
    assert links
    for link in links:
        assert (README.parent / link).exists(), link
