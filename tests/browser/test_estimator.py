"""The selector of estimators in a browser: it shows and copies what to write."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.browser.chromium import Page

from tracknoise.estimators.run_models import run_models
from tracknoise.report.estimator_exports import exported
from tracknoise.tables.store import RunFolder

Open = Callable[..., Page]
SHOWN = "document.getElementById('exported').dataset.shown"
FILES = "[...document.querySelectorAll('#exported pre')].map(one => one.textContent)"


@pytest.fixture
def page(fitted_report: Path, open_page: Open) -> Page:
    opened = open_page(fitted_report)
    opened.wait(SHOWN)
    return opened


def choose(page: Page, name: str) -> None:
    control = "document.querySelector('#export [name=estimator]')"
    page.evaluate(
        f"{control}.value = {json.dumps(name)}; {control}.dispatchEvent(new Event('change', {{bubbles: true}}))"
    )
    page.wait(f"{SHOWN} === 'oracle {name}'")


def test_the_chosen_export_is_shown_as_it_is(page: Page, fitted_run: RunFolder) -> None:
    fits = run_models(fitted_run)
    content = exported(fits.models["oracle"], fits.paths["oracle"])
    for name, one in content.items():
        choose(page, name)
        files = [text for _, text in one["files"]] if "files" in one else [one["command"]] if "command" in one else []
        assert page.evaluate(FILES) == files
    assert page.errors == []
    assert not [address for address in page.requests if not address.startswith(("file:", "data:"))]


def test_a_file_is_copied(page: Page) -> None:
    choose(page, "openvins")
    page.evaluate("navigator.clipboard.writeText = text => { window.copied = text; return Promise.resolve(); }")
    page.click("#exported .copy")
    page.wait("document.querySelector('#exported .copy').textContent === 'Copied'")
    assert page.evaluate("window.copied") == page.evaluate(FILES)[0]


def test_without_a_clipboard_a_selection_is_copied(page: Page) -> None:
    choose(page, "openvins")
    page.evaluate("navigator.clipboard.writeText = () => Promise.reject(new Error('no'))")
    page.evaluate("document.execCommand = () => { window.copied = getSelection().toString() "
                  "|| document.activeElement.value; return true; }")  # fmt: skip
    page.click("#exported .copy")
    page.wait("document.querySelector('#exported .copy').textContent === 'Copied'")
    assert page.evaluate("window.copied").strip() == page.evaluate(FILES)[0].strip()


def test_the_selector_works_with_the_keyboard_and_is_named(page: Page) -> None:
    page.evaluate("document.querySelector('#export [name=estimator]').focus()")
    before = page.evaluate(SHOWN)
    page.key("ArrowDown")
    page.wait(f"{SHOWN} !== {json.dumps(before)}")
    labels = "[...document.querySelectorAll('#exported button, #exported pre')].map(one => one.ariaLabel)"
    assert all(page.evaluate(labels))


@pytest.mark.parametrize("width", [400, 1366])
def test_long_lines_fit_the_window(fitted_report: Path, open_page: Open, width: int) -> None:
    page = open_page(fitted_report, width=width)
    page.wait(SHOWN)
    for name in ("openvins", "gtsam", "vins"):
        choose(page, name)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")
        wide = "[...document.querySelectorAll('#exported pre')].some(one => one.scrollWidth > one.clientWidth + 1)"
        assert not page.evaluate(wide)
