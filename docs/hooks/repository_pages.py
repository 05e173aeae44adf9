"""Files outside of docs/ as pages of the site: the README is its start page, and a source file that is linked is shown.

Links stay as they are in the repository, where they work too. Here they are rewritten to the pages of the site. The
pages are `repository_pages` in mkdocs.yml.
"""

import posixpath
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

_ROOT = Path(__file__).parents[2]
_LINK = re.compile(r"(?<=\]\()(?!\w+:|#)(?P<path>[^)#\s]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of files outside of docs/."""
    pages: Mapping[str, str] = config.extra["repository_pages"]
    texts = {f"docs/{file.src_uri}": file.content_string for file in files.documentation_pages()}
    texts |= {path: _text(path) for path in pages}
    for path, page in pages.items():
        files.append(File.generated(config, page, content=texts[path]))
    targets = {target for path, text in texts.items() for target in _linked(text, path)}
    for path in sorted(targets - pages.keys()):
        if not path.startswith("docs/"):
            files.append(_source_page(config, path))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite the links of a page."""
    pages: Mapping[str, str] = config.extra["repository_pages"]
    shown = {uri: path for path, uri in pages.items()}
    path = shown.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    here = posixpath.dirname(page.file.src_uri) or "."
    return _LINK.sub(lambda link: posixpath.relpath(_page_of(_target(link, path), pages), here), markdown)


def _page_of(path: str, pages: Mapping[str, str]) -> str:
    """Page of the site that shows a file of the repository."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return pages.get(path, f"repository/{path}.md")


def _linked(markdown: str, path: str) -> Iterator[str]:
    return (_target(link, path) for link in _LINK.finditer(markdown))


def _target(link: re.Match[str], path: str) -> str:
    """File of the repository that a link in another file of it leads to."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), link["path"]))


def _source_page(config: MkDocsConfig, path: str) -> File:
    head = "---\nsearch:\n  exclude: true\n---\n\n"  # source code is not what a reader searches for
    content = f"{head}# {path}\n\n````{Path(path).suffix.removeprefix('.')}\n{_text(path)}````\n"
    return File.generated(config, _page_of(path, {}), content=content, inclusion=InclusionLevel.NOT_IN_NAV)


def _text(path: str) -> str:
    return (_ROOT / path).read_text(encoding="utf-8")
