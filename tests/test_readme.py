"""The README's example does what it says."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_python_example_runs_and_its_tables_are_as_described(capsys):
    code, _ = re.findall(
        r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL
    )  # the other, and their types: tests/api
    scope: dict = {}
    exec(code, scope)
    assert {"du_px", "dv_px", "truth"} <= set(scope["errors"].columns)
    assert set(scope["curves"]["statistic"].unique()) == {"nu", "eta", "Phi", "central"}
    assert set(scope["curves"].select("tracker", "speed").unique().iter_rows()) == {
        (tracker, speed) for tracker in ("lucas-kanade", "correspondence") for speed in (1, 2)
    }
    assert scope["lifetimes"]["survival"].drop_nulls().is_between(0, 1).all()
    assert "lucas-kanade" in capsys.readouterr().out


def test_every_file_that_the_readme_links_to_exists():
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README.read_text())
    assert links
    for link in links:
        assert (README.parent / link).exists(), link
