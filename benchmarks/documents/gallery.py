"""The screenshots of the documentation, made again in a headless Chromium.

    python -m benchmarks.documents.gallery FOLDER

The folder holds the runs and pages that they show: `runs/demo`, `runs/7scenes`, `runs/tournament` and
`compare.html`.
"""

import argparse
import base64
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.browser.chromium import Page, browser, tab

IMAGES = Path(__file__).parents[2] / "docs" / "gallery"
_DRAWN = "[...document.querySelectorAll('[data-explorer]')].every(one => one.dataset.shown)"
_QUALITY = 80


@dataclass(frozen=True, slots=True)
class Shot:
    """A screenshot.

    Attributes
    ----------
    name
        Of the image.
    page
        File in the folder of runs.
    place
        Selector of what is at its top; None for the top of the page.
    before
        JavaScript that is run first.
    height
        Of the window, px.
    """

    name: str
    page: str
    place: str | None = None
    before: str = ""
    height: int = 768


DEMO, SEVEN = "runs/demo/report/index.html", "runs/7scenes/report/index.html"
SHOTS = (
    Shot("demo-first-screen", DEMO),
    Shot("demo-explorer", DEMO, "#explorer"),
    Shot("demo-tracks", DEMO, "#looks", before="look('lucas-kanade', 'forward-00', 10)"),
    Shot("7scenes-first-screen", SEVEN),
    Shot("tournament", "runs/tournament/report/index.html", height=900),
    Shot("compare", "compare.html"),
)


def take(page: Page, shot: Shot, folder: Path) -> bytes:
    """A screenshot as WebP, 1366 px wide."""
    page.size(1366, shot.height)
    page.goto(f"file://{(folder / shot.page).resolve()}")
    page.wait(_DRAWN)
    if shot.before:
        page.evaluate(shot.before)
    if shot.place:
        page.evaluate(f"document.querySelector({shot.place!r}).scrollIntoView({{behavior: 'instant'}})")
    page.evaluate("new Promise(done => setTimeout(done, 500))")  # figures below are drawn when they are scrolled to
    return base64.b64decode(page.command("Page.captureScreenshot", format="webp", quality=_QUALITY)["data"])


def main(arguments: Sequence[str] | None = None) -> None:
    """Write all screenshots."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args(arguments).folder
    IMAGES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, browser(Path(profile)) as pipe:
        for shot in SHOTS:
            with tab(pipe) as page:
                (IMAGES / f"{shot.name}.webp").write_bytes(take(page, shot, folder))


if __name__ == "__main__":
    main()
