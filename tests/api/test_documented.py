"""What the documents say in Python does run, and is typed."""

import re
from pathlib import Path

from mypy import api as mypy

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


def test_the_examples_are_typed(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)  # whose settings and cache mypy uses, strict and quick
    scripts = [tmp_path / "readme.py", tmp_path / "page.py"]
    for script, document in zip(scripts, ("README.md", "docs/python.md"), strict=True):
        script.write_text("\n".join(BLOCK.findall((ROOT / document).read_text())))
    output, errors, status = mypy.run([*map(str, scripts), "--strict"])
    assert status == 0, output + errors


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
