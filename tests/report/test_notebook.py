"""A run as a notebook shows it."""

import re
from html.parser import HTMLParser

import tracknoise


class Parts(HTMLParser):
    """Names of elements, and the text outside of styles."""

    def __init__(self, page):
        super().__init__()
        self.names, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.names.append(tag)

    def handle_data(self, data):
        self.text += data


def test_a_run_shows_a_card_per_tracker(run):
    shown = Parts(tracknoise.open_run(run.path)._repr_html_())
    for words in ("Which is more accurate?", "Can the truth be trusted?", "lucas-kanade", "correspondence", "lifetime"):
        assert words in shown.text
    assert shown.names.count("svg") >= 8
    assert not {"script", "link", "img", "body"} & set(shown.names)


def test_its_style_touches_nothing_else_in_a_notebook(run):
    (style,) = re.findall(r"<style>(.*?)</style>", tracknoise.open_run(run.path)._repr_html_(), flags=re.DOTALL)
    selectors = re.findall(r"^(.+?) \{", style, flags=re.MULTILINE)
    assert selectors
    assert all(selector.startswith(".tracknoise-run") for selector in selectors)


def test_odd_names_are_harmless(make_run, synthetic):
    folder = make_run(told=True, **synthetic.DEGENERATE["odd names"])
    page = tracknoise.open_run(folder.path)._repr_html_()
    assert '<b>"&' not in page
    assert '<b>"&\\_%' in Parts(page).text
