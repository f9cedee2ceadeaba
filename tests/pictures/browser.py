"""A browser that tests drive: Debian's chromium, by the WebDriver protocol of its chromedriver."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import urllib.error
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from tests.pictures.images import pixels

THERE = bool(shutil.which("chromium") and shutil.which("chromedriver"))

QUIET = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--disable-default-apps", "--window-size=760,560", "--hide-scrollbars"),
)
"""No window, no graphics card, and no connections of its own."""

TIMEOUT = 60


class Browser:
    """One browser with one page."""

    def __init__(self, folder: Path) -> None:
        self._driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, text=True)
        assert self._driver.stdout is not None
        found = None
        while found is None:
            found = re.search(r"successfully on port (\d+)", self._driver.stdout.readline())
        self._address = f"http://127.0.0.1:{found[1]}/session"
        options = {"args": [*QUIET, f"--user-data-dir={folder}"], "binary": shutil.which("chromium")}
        wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
        try:
            session = self._ask("POST", "", {"capabilities": {"alwaysMatch": wanted}})["sessionId"]
        except BaseException:
            self._end()
            raise
        self._address += f"/{session}"

    def _ask(self, method: str, path: str, body: object = None) -> Any:
        data = None if body is None else json.dumps(body).encode("utf-8")
        kind = {"Content-Type": "application/json"}
        request = urllib.request.Request(self._address + path, data, kind, method=method)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as reply:
                return json.load(reply)["value"]
        except urllib.error.HTTPError as error:
            with error:
                raise AssertionError(error.read().decode("utf-8")[:500]) from None

    def open(self, address: str) -> None:
        """Load a page anew, whatever stood after the # before."""
        self._ask("POST", "/url", {"url": "about:blank"})
        self._ask("POST", "/url", {"url": address})

    def run(self, script: str) -> Any:
        """Run a script in the page."""
        return self._ask("POST", "/execute/sync", {"script": script, "args": []})

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        script = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done(1)));"
        self._ask("POST", "/execute/async", {"script": script, "args": []})

    def picture(self) -> np.ndarray:
        """(height, width, 3) pixels of the window."""
        self.settle()
        return pixels(base64.b64decode(self._ask("GET", "/screenshot")))

    def keys(self, text: str) -> None:
        """Press keys."""
        actions = [{"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]
        self._ask("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": actions}]})

    def mouse(self, *steps: tuple[int, int], drag: bool = False) -> None:
        """Move the mouse from place to place, with its button down or not."""
        moves = [{"type": "pointerMove", "duration": 0, "x": x, "y": y} for x, y in steps]
        if drag:
            moves = [moves[0], {"type": "pointerDown", "button": 0}, *moves[1:], {"type": "pointerUp", "button": 0}]
        self._ask("POST", "/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": moves}]})

    def size(self, width: int, height: int) -> None:
        """Make the window larger or smaller."""
        self._ask("POST", "/window/rect", {"width": width, "height": height})

    def complaints(self) -> list[str]:
        """What the page has said of errors since it was asked last."""
        log = self._ask("POST", "/se/log", {"type": "browser"})
        return [entry["message"] for entry in log if entry["level"] == "SEVERE"]

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._ask("DELETE", "")
        finally:
            self._end()

    def _end(self) -> None:
        self._driver.terminate()
        self._driver.communicate(timeout=TIMEOUT)
