"""Browsers that tests drive: Chromium by the WebDriver protocol of its chromedriver, Firefox by its own Marionette."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.plots.images import pixels

WINDOW = (760, 560)  # width and height of a window, with what the browser itself shows

# No window, no graphics card, and no connections of its own
CHROMIUM = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--disable-default-apps", f"--window-size={WINDOW[0]},{WINDOW[1]}", "--hide-scrollbars"),
)

# Preferences: pages are drawn without a graphics card, and it has no connections of its own
FIREFOX = {
    "webgl.force-enabled": True,  # its list of drivers to avoid has the one that draws in software
    "marionette.port": 0,
    "app.update.disabledForTesting": True,
    "browser.shell.checkDefaultBrowser": False,
    "browser.startup.page": 0,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "services.settings.server": "data:,",
    "toolkit.telemetry.server": "data:,",
    "dom.w3c_touch_events.enabled": 1,
}

TIMEOUT = 300


class Browser(AbstractContextManager["Browser"]):
    """One browser with one page. Each kind sends commands of WebDriver, by the names that Marionette has for them."""

    def open(self, address: str) -> None:
        """Load a page anew, whatever stood after the # before."""
        self._ask("Navigate", url="about:blank")
        self._ask("Navigate", url=address)

    def run(self, script: str) -> Any:
        """Run a script in the page, as one of its own: what Marionette runs does not see the page's constants."""
        own = f"document.documentElement.dataset.answer = JSON.stringify((() => {{ {script} }})() ?? null);"
        outer = (
            "const made = document.createElement('script'), root = document.documentElement;"
            "delete root.dataset.answer; made.textContent = arguments[0]; document.body.append(made); made.remove();"
            "return root.dataset.answer;"
        )
        answer = self._ask("ExecuteScript", script=outer, args=[own])
        assert answer is not None, script
        return json.loads(answer)

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        script = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done(1)));"
        self._ask("ExecuteAsyncScript", script=script, args=[])

    def picture(self) -> np.ndarray:
        """(height, width, 3) pixels of the window."""
        self.settle()
        return pixels(base64.b64decode(self._ask("TakeScreenshot")))

    def keys(self, text: str) -> None:
        """Press keys."""
        actions = [{"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]
        self._ask("PerformActions", actions=[{"type": "key", "id": "keys", "actions": actions}])

    def mouse(self, *steps: tuple[int, int], drag: bool = False) -> None:
        """Move the mouse from place to place, with its button down or not."""
        self._ask("PerformActions", actions=[_pointer("mouse", steps, pressed=drag)])

    def wheel(self, place: tuple[int, int], turned: int) -> None:
        """Turn the mouse's wheel at a place."""
        x, y = place
        scroll = {"type": "scroll", "x": x, "y": y, "deltaX": 0, "deltaY": turned, "duration": 0}
        self._ask("PerformActions", actions=[{"type": "wheel", "id": "wheel", "actions": [scroll]}])

    def fingers(self, *paths: list[tuple[int, int]]) -> None:
        """Let fingers touch the screen, each moving from place to place, all in the same time."""
        touches = [_pointer(f"finger {k}", path, pressed=True, kind="touch") for k, path in enumerate(paths)]
        self._ask("PerformActions", actions=touches)

    def size(self, width: int, height: int) -> None:
        """Make the window larger or smaller."""
        self._ask("SetWindowRect", width=width, height=height)

    def __exit__(self, *error: object) -> None:
        self.close()


def _pointer(
    name: str, steps: tuple[tuple[int, int], ...] | list[tuple[int, int]], *, pressed: bool, kind: str = "mouse"
) -> Any:
    moves: list[dict[str, Any]] = [{"type": "pointerMove", "duration": 0, "x": x, "y": y} for x, y in steps]
    if pressed:
        moves = [moves[0], {"type": "pointerDown", "button": 0}, *moves[1:], {"type": "pointerUp", "button": 0}]
    return {"type": "pointer", "id": name, "parameters": {"pointerType": kind}, "actions": moves}


# What chromedriver has for the commands' names
PATHS = {
    "Navigate": "url",
    "ExecuteScript": "execute/sync",
    "ExecuteAsyncScript": "execute/async",
    "PerformActions": "actions",
    "SetWindowRect": "window/rect",
}


class Chromium(Browser):
    """Debian's chromium and chromium-driver."""

    THERE = bool(shutil.which("chromium") and shutil.which("chromedriver"))

    def __init__(self, folder: Path) -> None:
        self._driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, text=True)
        assert self._driver.stdout is not None
        found = None
        while found is None:
            found = re.search(r"successfully on port (\d+)", self._driver.stdout.readline())
        self._address = f"http://127.0.0.1:{found[1]}/session"
        options = {"args": [*CHROMIUM, f"--user-data-dir={folder}"], "binary": shutil.which("chromium")}
        wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
        try:
            session = self._request("POST", "", {"capabilities": {"alwaysMatch": wanted}})["sessionId"]
        except BaseException:
            self._end()
            raise
        self._address += f"/{session}"

    def _request(self, method: str, path: str, body: object = None) -> Any:
        data = None if body is None else json.dumps(body).encode("utf-8")
        kind = {"Content-Type": "application/json"}
        request = urllib.request.Request(self._address + path, data, kind, method=method)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as reply:
                return json.load(reply)["value"]
        except urllib.error.HTTPError as error:
            with error:
                raise AssertionError(error.read().decode("utf-8")[:500]) from None

    def _ask(self, command: str, **parameters: Any) -> Any:
        if command == "TakeScreenshot":
            return self._request("GET", "/screenshot")
        return self._request("POST", f"/{PATHS[command]}", parameters)

    def complaints(self) -> list[str]:
        """What the page has said of errors since it was asked last."""
        log = self._request("POST", "/se/log", {"type": "browser"})
        return [entry["message"] for entry in log if entry["level"] == "SEVERE"]

    def prefer(self, colours: str) -> None:
        """Tell pages that the system is "dark" or "light"."""
        features = [{"name": "prefers-color-scheme", "value": colours}]
        command = {"cmd": "Emulation.setEmulatedMedia", "params": {"features": features}}
        self._request("POST", "/goog/cdp/execute", command)

    def close(self) -> None:
        try:
            self._request("DELETE", "")
        finally:
            self._end()

    def _end(self) -> None:
        self._driver.terminate()
        self._driver.communicate(timeout=TIMEOUT)


class Firefox(Browser):
    """Debian's firefox-esr, on a screen of its own: without a screen it has no WebGL."""

    PROGRAM = shutil.which("firefox-esr") or shutil.which("firefox")
    THERE = bool(PROGRAM and shutil.which("Xvfb"))

    def __init__(self, folder: Path) -> None:
        with ExitStack() as opened:
            screen = opened.enter_context(_ended(["Xvfb", "-displayfd", "1", "-screen", "0", "1280x1024x24"]))
            number = screen.stdout.readline().strip()
            lines = [f'user_pref("{name}", {json.dumps(value)});\n' for name, value in FIREFOX.items()]
            (folder / "user.js").write_text("".join(lines), encoding="utf-8")
            command = [
                *(str(self.PROGRAM), "--marionette", "--no-remote", "--profile", str(folder)),
                *("--remote-allow-system-access", "about:blank"),
            ]
            opened.enter_context(_ended(command, {**os.environ, "DISPLAY": f":{number}"}))
            self._socket = opened.enter_context(socket.create_connection(("127.0.0.1", _port(folder)), TIMEOUT))
            self._count = 0
            self._message()  # it says who it is
            self._ask("NewSession")
            self.size(*WINDOW)
            self._opened = opened.pop_all()

    def _message(self) -> Any:
        with self._socket.makefile("rb", buffering=0) as stream:
            length = b""
            while not length.endswith(b":"):
                length += stream.read(1) or _gone()
            text = b""
            while len(text) < int(length[:-1]):
                text += stream.read(int(length[:-1]) - len(text)) or _gone()
        return json.loads(text)

    def _ask(self, command: str, **parameters: Any) -> Any:
        name = command if ":" in command else f"WebDriver:{command}"
        if command == "TakeScreenshot":
            parameters["full"] = False  # the window, not all of the page
        self._count += 1
        text = json.dumps([0, self._count, name, parameters]).encode("utf-8")
        self._socket.sendall(b"%d:%b" % (len(text), text))
        _, _, error, result = self._message()
        assert error is None, error
        return result.get("value") if isinstance(result, dict) else result

    def _own(self, script: str) -> Any:
        """Run a script in the browser itself."""
        self._ask("Marionette:SetContext", value="chrome")
        try:
            return self._ask("ExecuteScript", script=script, args=[])
        finally:
            self._ask("Marionette:SetContext", value="content")

    def complaints(self) -> list[str]:
        """What pages have said of errors since it was asked last."""
        return self._own(
            "const all = Services.console.getMessageArray(); Services.console.reset(); return all"
            ".filter(m => m instanceof Ci.nsIScriptError && !(m.flags & m.warningFlag))"
            ".filter(m => /^(file|http)/.test(m.sourceName)).map(m => m.errorMessage)"
        )

    def prefer(self, colours: str) -> None:
        dark = {"dark": 0, "light": 1}  # values of Firefox's preference for what pages are told of the system's colours
        name = "layout.css.prefers-color-scheme.content-override"
        self._own(f"Services.prefs.setIntPref('{name}', {dark[colours]})")

    def close(self) -> None:
        self._opened.close()


class _ended(subprocess.Popen[str]):
    """A process that ends with a `with` block."""

    def __init__(self, command: list[str], environment: dict[str, str] | None = None) -> None:
        super().__init__(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)

    def __exit__(self, *error: object) -> None:
        self.terminate()
        self.communicate(timeout=TIMEOUT)


def _port(folder: Path) -> int:
    """Where Firefox listens, once it does."""
    place, end = folder / "MarionetteActivePort", time.monotonic() + TIMEOUT
    while not (place.exists() and place.read_text()):
        assert time.monotonic() < end, "Firefox has not started"
        time.sleep(0.05)
    return int(place.read_text())


def _gone() -> bytes:
    raise AssertionError("Firefox has ended")


BROWSERS = [browser for browser in (Chromium, Firefox) if browser.THERE]  # those that are installed here


@pytest.fixture(scope="module", params=BROWSERS, ids=lambda kind: kind.__name__)
def browser(request, tmp_path_factory):
    with request.param(tmp_path_factory.mktemp("profile")) as made:
        yield made
