from pathlib import Path

from benchmarks.documents.exports import markdown

from tracknoise.estimators.exports import estimators, refused

PAGE = Path(__file__).parents[3] / "docs" / "estimators" / "exports.md"


def test_the_page_is_that_of_the_estimators():
    assert PAGE.read_text() == markdown()


def test_it_has_every_estimator():
    for name, item in {**estimators(), **refused()}.items():
        assert f"`{name}`" in markdown()
        assert item.title in markdown()
