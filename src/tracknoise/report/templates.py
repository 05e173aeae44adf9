"""The HTML templates of the package."""

import re

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from tracknoise.report.figures.figure import Figure
from tracknoise.text import printable
from tracknoise.topics.sentences import sentences_of

_RAW = {
    "css": "page.css",
    "first_css": "first.css",
    "script": "page.js",
    "looks": "looks.js",
    "bars": "bars.js",
    "explorer": "explorer.js",
    "film": "film.js",
    "board_script": "board.js",
    "terms": "terms.js",
    "estimator": "estimator.js",
    "estimator_css": "estimator.css",
}
"""Files that stand in a page as they are, by their names in templates."""


def template(name: str) -> Template:
    """A template. It has the styles and scripts of `_RAW` by name, and the filters `code` and `first_sentence`."""
    loader = PackageLoader("tracknoise.report", "template")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.finalize = _shown
    environment.tests["figure"] = lambda item: isinstance(item, Figure)
    environment.filters["code"] = _code
    environment.filters["first_sentence"] = lambda text: next(iter(sentences_of(text)), "")
    environment.globals |= {key: loader.get_source(environment, file)[0] for key, file in _RAW.items()}
    return environment.get_template(name)


def _shown(value: object) -> object:
    """A value of a template as it is inserted: control characters are escaped, but line breaks are kept."""
    return value if isinstance(value, Markup) or not isinstance(value, str) else printable(value, keep="\n\t")


def _code(text: str) -> Markup:
    """Text as HTML, with the parts between backticks as code."""
    return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(printable(text)))))
