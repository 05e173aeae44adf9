"""Pictures of the report are those that were looked at: the first screen and one section, in light and dark.

The pictures in ``golden`` are grey and of half size. They are compared by the brightness of blocks, so that small
differences in the drawing of letters do not matter. Another browser or other fonts set the text differently: there the
test is skipped. After a change that is meant, write the pictures again with ``TRACKNOISE_WRITE_GOLDEN=1`` and look at
them.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.browser.chromium import Page
from tests.browser.test_report import DRAWN, EVERY

GOLDEN = Path(__file__).parent / "golden"
MADE_WITH = GOLDEN / "made-with.json"
SIZE, HALF = (1366, 768), (683, 384)
BLOCK = 4
"""Side of a block, px of a picture of half size."""
MOST_MEAN, MOST_BLOCK, MOST_SHARE = 0.5, 16.0, 0.003
"""Largest mean difference in brightness; a block differs above the second; the largest share of such blocks."""
PLACES = {"first": "#answer", "section": "#lifetimes"}
_FONTS = """(() => {
  const canvas = document.createElement("canvas").getContext("2d");
  const width = (font) => {
    canvas.font = `16px ${font}`;
    return canvas.measureText("Errors of 0.122 px, Qgjy").width;
  };
  return [getComputedStyle(document.body).fontFamily, "Helvetica, Arial, sans-serif"].map(width);
})()"""


def machine(page: Page) -> dict[str, object]:
    """What decides how text is set."""
    browser = page.evaluate("navigator.userAgent.match(/Chrome\\/(\\d+)/)[1]")
    return {"browser": browser, "fonts": page.evaluate(_FONTS)}


def picture(page: Page, place: str) -> NDArray[np.uint8]:
    """A place of the page at the top of the window, grey and of half size."""
    page.wait(EVERY)
    page.wait(DRAWN)
    page.evaluate(f"document.querySelector('{place}').scrollIntoView({{behavior: 'instant'}})")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    taken = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
    return np.asarray(cv2.resize(taken, HALF, interpolation=cv2.INTER_AREA), np.uint8)


def differs(found: NDArray[np.uint8], golden: NDArray[np.uint8]) -> bool:
    """Whether two pictures differ by more than the drawing of letters."""
    width, height = HALF[0] // BLOCK, HALF[1] // BLOCK
    blocks = [
        cv2.resize(
            one[: height * BLOCK, : width * BLOCK].astype(np.float32), (width, height), interpolation=cv2.INTER_AREA
        )
        for one in (found, golden)
    ]
    difference = np.abs(blocks[0] - blocks[1])
    return bool(difference.mean() > MOST_MEAN or (difference > MOST_BLOCK).mean() > MOST_SHARE)


def golden(page: Page, name: str, found: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture of a name; skips where the browser or the fonts are others."""
    path = GOLDEN / f"{name}.png"
    if os.environ.get("TRACKNOISE_WRITE_GOLDEN"):
        cv2.imwrite(str(path), found, [cv2.IMWRITE_PNG_COMPRESSION, 9])
        MADE_WITH.write_text(json.dumps(machine(page), indent=1) + "\n")
    made_with = json.loads(MADE_WITH.read_text())
    if machine(page) != made_with:
        pytest.skip(f"the pictures were made with {made_with}, this machine has {machine(page)}")
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_looks_as_it_did(scheme: str, report: Path, open_page: Callable[..., Page]) -> None:
    page = open_page(report, width=SIZE[0], height=SIZE[1], dark=scheme == "dark")
    for place, selector in PLACES.items():
        found = picture(page, selector)
        assert not differs(found, golden(page, f"{place}-{scheme}", found)), place


def test_a_card_or_a_curve_that_is_missing_is_noticed(report: Path, open_page: Callable[..., Page]) -> None:
    page = open_page(report, width=SIZE[0], height=SIZE[1])
    whole = picture(page, PLACES["first"])
    page.evaluate(
        "document.querySelector('.first svg.picture, .first .settings, .first .question').style.visibility = 'hidden'"
    )
    assert differs(picture(page, PLACES["first"]), whole)
    section = picture(page, PLACES["section"])
    page.evaluate("document.querySelector('[data-figure=lifetimes] .mark-line').style.visibility = 'hidden'")
    assert differs(picture(page, PLACES["section"]), section)
