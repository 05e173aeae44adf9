"""The site of the documentation: mkdocs.yml names every page once, and every link leads to something.

`make docs` checks the same with mkdocs. These tests need neither mkdocs nor time.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

import tracknoise

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
OUTSIDE: dict[str, str] = SITE["extra"]["repository_pages"]
PAGES = [*(ROOT / path for path in OUTSIDE), *sorted(DOCS.glob("**/*.md"))]
LINK = re.compile(r"(?<!`)\]\((?!\w+:)([^)\s]+)\)")
BLOCK = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
LARGEST = {"figures": 300_000, "gallery": 200_000}
"""Sizes of images, bytes, by their folder."""


def entries(nav: list) -> Iterator[str]:
    """Pages of a navigation, with those below its headings."""
    for entry in nav:
        value = next(iter(entry.values())) if isinstance(entry, dict) else entry
        yield from [value] if isinstance(value, str) else entries(value)


def anchors(page: Path) -> set[str]:
    """What can follow a # in a link to a page."""
    headings = re.findall(r"^#+ (.+)$", BLOCK.sub("", page.read_text()), re.MULTILINE)
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip()) for heading in plain}


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """File and anchor of every link of a page within the repository."""
    for link in LINK.findall(BLOCK.sub("", page.read_text())):
        path, _, anchor = link.partition("#")
        yield (page.parent / path).resolve() if path else page, anchor


def test_the_navigation_has_every_page_once():
    besides = [line.strip("/ ") for line in SITE["not_in_nav"].splitlines()]
    shown = [*entries(SITE["nav"]), *besides]
    expected = [*OUTSIDE.values(), *(path.relative_to(DOCS).as_posix() for path in DOCS.glob("**/*.md"))]
    assert sorted(shown) == sorted(expected)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    for path, anchor in links(page):
        assert path.is_file(), path
        assert not anchor or anchor in anchors(path), f"{path.name}#{anchor}"


def test_every_page_is_linked_from_another():
    linked = {path for page in PAGES for path, _ in links(page) if path != page}
    assert [path.name for path in PAGES if path not in linked and path.name not in OUTSIDE] == []


def test_the_reference_has_every_public_name_once():
    assert sorted(re.findall(r"^::: tracknoise\.(\w+)$", (DOCS / "api.md").read_text(), re.MULTILINE)) == sorted(
        tracknoise.__all__
    )


@pytest.mark.parametrize("folder", LARGEST)
def test_images_are_small_and_each_is_shown(folder):
    shown = {path for page in PAGES for path, _ in links(page)}
    images = [path for path in sorted((DOCS / folder).iterdir()) if path.is_file()]
    assert images
    assert [path.name for path in images if path not in shown] == []
    assert [path.name for path in images if path.stat().st_size > LARGEST[folder]] == []


def test_nothing_is_loaded_from_the_network():
    assert SITE["theme"]["font"] is False
    assert not {"extra_javascript", "extra_css"} & set(SITE)


def test_the_search_needs_no_server():
    assert "offline" in SITE["plugins"]
    assert all((DOCS / path).is_file() for path in SITE["extra"]["polyfills"])
    assert any("iframe-worker" in path for path in SITE["extra"]["polyfills"])


def test_the_site_is_small():
    """A newcomer reads it; numbers of validation trials belong on one page, docs/testing.md."""
    in_navigation = [ROOT / "README.md", *DOCS.glob("**/*.md")]
    assert len(in_navigation) <= 25
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in in_navigation) <= 30_000


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
