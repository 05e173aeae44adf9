"""What the documents say in Python does run, and is typed."""

import re
import subprocess
import sys
from pathlib import Path

import tracknoise as tn

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"```python\n(.*?)```", flags=re.DOTALL)


def test_the_example_of_the_readme_reads_a_run(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    _, code = BLOCK.findall((ROOT / "README.md").read_text())
    scope: dict = {}
    exec(code, scope)
    assert "lucas-kanade: set " in capsys.readouterr().out
    assert (place / "error-by-age.svg").read_text().startswith("<svg")
    assert set(scope["intervals"]["tracker"]) == {"lucas-kanade"}
    assert scope["track"]["track"].unique().to_list() == [17]


def test_the_examples_are_typed(tmp_path):
    """In a process of its own: what mypy holds would stay in memory."""
    scripts = [tmp_path / "readme.py", tmp_path / "page.py"]
    for script, document in zip(scripts, ("README.md", "docs/python.md"), strict=True):
        script.write_text("\n".join(BLOCK.findall((ROOT / document).read_text())))
    command = [sys.executable, "-m", "mypy", *map(str, scripts), "--strict"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)  # whose settings and cache mypy uses
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_page_on_python_runs_from_top_to_bottom(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    scope: dict = {}
    exec("\n".join(BLOCK.findall((ROOT / "docs" / "python.md").read_text())), scope)
    assert set(scope["analysis"].table("summary")["tracker"]) == {"small window", "large window"}
    assert scope["errors"].height > scope["tracks"].height


def test_the_page_on_python_names_every_method():
    page = (ROOT / "docs" / "python.md").read_text()
    methods = [name for name in vars(tn.Run) if not name.startswith("_")]
    assert methods
    for name in methods:
        assert f"run.{name}" in page, name
