"""A headless Chromium that tests drive through its debugging pipe: no driver, no port and no network."""

import base64
import fcntl
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-pipe"),
    *("--no-first-run", "--disable-extensions", "--disable-background-networking", "--disable-component-update"),
    *("--font-render-hinting=none", "--force-color-profile=srgb", "--disable-dev-shm-usage"),
    "--force-prefers-reduced-motion",
)
_READ, _WRITE = 3, 4
"""Where the browser reads commands, and where it writes answers."""
_PATIENCE_S = 60.0


def installed() -> str | None:
    """Path of a browser of this system; None where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


@dataclass
class Page:
    """A tab, and what happened in it since it was opened.

    Attributes
    ----------
    requests
        Addresses that it asked for.
    errors
        Errors and warnings of its console, and exceptions of its scripts.
    """

    _pipe: "_Pipe"
    _session: str
    requests: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def command(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol and wait for its answer."""
        return self._pipe.command(method, parameters, self._session, self._note)

    def goto(self, address: str) -> None:
        """Open an address and wait until it is loaded."""
        self.command("Page.navigate", url=address)
        self.wait("document.readyState === 'complete'")

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        """Set the size of the window, px, and the colour scheme that the reader prefers."""
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[scheme])

    def evaluate(self, expression: str) -> Any:
        """Value of an expression of JavaScript; of what a promise gives."""
        answer = self.command("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(json.dumps(answer["exceptionDetails"])[:2000])
        return answer["result"].get("value")

    def wait(self, condition: str, *, seconds: float = 120.0) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + seconds
        while not self.evaluate(condition):
            assert time.monotonic() < until, f"still not true after {seconds} s: {condition}"
            time.sleep(0.05)

    def click(self, selector: str) -> None:
        """Scroll to the first element that a selector finds, and click its middle with the mouse."""
        place = f"document.querySelector({json.dumps(selector)})"
        self.evaluate(f"{place}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
        box = self.evaluate(
            f"(() => {{ const b = {place}.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()"
        )
        at = {"x": box[0] + box[2] / 2, "y": box[1] + box[3] / 2, "button": "left", "clickCount": 1}
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.command("Input.dispatchMouseEvent", type=kind, **at)

    def key(self, name: str) -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            self.command("Input.dispatchKeyEvent", type=kind, key=name, code=name)

    def screenshot(self) -> bytes:
        """The visible part, as PNG."""
        return base64.b64decode(self.command("Page.captureScreenshot", format="png")["data"])

    def _note(self, event: dict[str, Any]) -> None:
        method, found = event.get("method"), event.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(found["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(found["exceptionDetails"])[:2000])
        elif method == "Runtime.consoleAPICalled" and found["type"] in ("error", "assert", "warning"):
            self.errors.append(" ".join(str(part.get("value", part)) for part in found["args"]))
        elif method == "Log.entryAdded" and found["entry"]["level"] == "error":
            self.errors.append(found["entry"]["text"])


class _Pipe:
    """Commands to a browser and its answers: JSON, each with a zero byte at its end."""

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers = commands, answers
        self._rest = b""
        self._number = 0

    def command(self, method: str, parameters: dict[str, Any], session: str | None, note: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        message |= {} if session is None else {"sessionId": session}
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            note(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            part = os.read(self._answers, 1 << 20)
            assert part, "the browser ended"
            self._rest += part
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)


@contextmanager
def browser(profile: Path) -> Iterator[_Pipe]:
    """Start a browser with a profile folder of its own, and end it.

    Parameters
    ----------
    profile
        An empty folder.
    """
    path = installed()
    assert path is not None, "no browser is installed"
    (theirs_in, commands), (answers, theirs_out) = os.pipe(), os.pipe()
    high = [os.dup(theirs_in), os.dup(theirs_out)]

    def placed() -> None:
        for number, wanted in zip(_apart(high), (_READ, _WRITE), strict=True):
            os.dup2(number, wanted)

    process = subprocess.Popen(
        [path, *_FLAGS, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=placed,
        pass_fds=(_READ, _WRITE),
    )
    for number in (theirs_in, theirs_out, *high):
        os.close(number)
    try:
        yield _Pipe(commands, answers)
    finally:
        process.kill()
        process.wait(_PATIENCE_S)
        os.close(commands)
        os.close(answers)


def _apart(numbers: list[int]) -> list[int]:
    """Copies of file numbers that are none of those which the browser reads and writes."""
    return [fcntl.fcntl(number, fcntl.F_DUPFD, 10) for number in numbers]


@contextmanager
def tab(pipe: _Pipe) -> Iterator[Page]:
    """Open a tab, and close it."""
    target = pipe.command("Target.createTarget", {"url": "about:blank"}, None, _ignore)["targetId"]
    attached = pipe.command("Target.attachToTarget", {"targetId": target, "flatten": True}, None, _ignore)
    page = Page(pipe, attached["sessionId"])
    for domain in ("Page", "Runtime", "Network", "Log"):
        page.command(f"{domain}.enable")
    try:
        yield page
    finally:
        pipe.command("Target.closeTarget", {"targetId": target}, None, _ignore)


def _ignore(_event: dict[str, Any]) -> None:
    """Events between tabs are of no interest."""
