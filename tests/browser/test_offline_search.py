"""The site of the documentation searches without a server: what replaces a worker in a page of a folder."""

import shutil
from collections.abc import Callable
from pathlib import Path

from tests.browser.chromium import Page

SCRIPT = Path(__file__).parents[2] / "docs" / "javascripts" / "iframe-worker.js"
PAGE = """<!doctype html><title>page</title><script src="iframe-worker.js"></script><body><script>
window.got = []
const worker = new Worker("workers/double.js")
worker.addEventListener("message", message => window.got.push(message.data))
for (const number of [1, 20]) worker.postMessage({ numbers: [number] })
</script>"""
WORKER = """addEventListener("message", async message => {
  await importScripts("factor.js")
  postMessage({ isFrame: "IFrameWorker" in parent, numbers: message.data.numbers.map(one => one * self.factor) })
})"""


def test_a_worker_answers_in_a_page_of_a_folder(tmp_path: Path, open_page: Callable[..., Page]) -> None:
    shutil.copy(SCRIPT, tmp_path)
    (tmp_path / "workers").mkdir()
    (tmp_path / "page.html").write_text(PAGE)
    (tmp_path / "workers" / "double.js").write_text(WORKER)
    (tmp_path / "workers" / "factor.js").write_text("self.factor = 2")
    page = open_page(tmp_path / "page.html")
    page.wait("window.got.length === 2")
    answers = sorted(page.evaluate("window.got"), key=lambda one: one["numbers"])  # scripts load in any order
    assert answers == [{"isFrame": True, "numbers": [2]}, {"isFrame": True, "numbers": [40]}]
    assert page.errors == []
