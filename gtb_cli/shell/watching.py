"""`gtb view --watch`: a page on this machine that follows its files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs

from gtb_cli.errors import ExportError, GtbError
from gtb_cli.process.memory import shortage
from gtb_cli.shell.console import Console
from gtb_cli.shell.faults import in_options
from gtb_cli.shell.streams import is_device

if TYPE_CHECKING:
    from gtb_cli.pages.page_scene import Content

HOST = "127.0.0.1"


class Watch:
    """The content of files as it is now: made anew when a file has changed; after an error, the last good one.

    `see` reads the files at `paths`; its errors are shown.
    """

    def __init__(self, paths: Sequence[str], see: Callable[[], Content]) -> None:
        self._paths, self._see, self._lock = paths, see, Lock()
        self._stamps: dict[str, object] = {}  # of the files, and of those that they include
        self.version = self.changed = 0  # states that were seen; the last of them that was good
        self.error, self.data = "", dict[str, Any]()
        self.look()

    def look(self) -> None:
        """Read the files again if they have changed."""
        with self._lock:
            if self._stamps and all(_stamp(file) == stamp for file, stamp in self._stamps.items()):
                return
            from gtb_cli.language.includes import sources
            from gtb_cli.pages.page import page_data

            files = [file for path in self._paths for file in (sources(path) if os.path.isfile(path) else [path])]
            self._stamps = {file: _stamp(file) for file in files}
            self.version += 1
            try:
                for path in self._paths:
                    if is_device(path):  # reading a pipe would wait for its writer
                        raise GtbError(f"{path}: is not a file")
                self.data, self.error = page_data(self._see()), ""
                self.changed = self.version
            except GtbError as error:
                self.error = in_options(str(error))
            except MemoryError:
                self.error = shortage()

    def state(self, have: int) -> dict[str, Any]:
        """Return what a page with version `have` needs."""
        self.look()
        news: dict[str, Any] = {"version": self.version, "error": self.error}
        return news | {"data": self.data} if have < self.changed else news

    def page(self) -> str:
        """Return the page as it is now."""
        self.look()
        from gtb_cli.pages.page import page_with

        return page_with({**self.data, "watch": self.version, "error": self.error}, self.data.get("name", "gtb view"))


def _stamp(path: str) -> object:
    """Return a value that changes when a file, or a file in a folder, changes."""
    try:
        inner = [os.path.join(path, name) for name in sorted(os.listdir(path))] if os.path.isdir(path) else [path]
        return [
            (name, status.st_mtime_ns, status.st_size, status.st_ino) for name in inner for status in [os.stat(name)]
        ]
    except OSError as error:
        return str(error)


def handler(watch: Watch, port: int) -> type[BaseHTTPRequestHandler]:
    """Return the class that answers a browser on this machine."""
    headers = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

    class Handler(BaseHTTPRequestHandler):
        server_version, sys_version = "gtb", ""

        def handle(self) -> None:
            """Answer, but for a browser that has gone."""
            with suppress(ConnectionError):
                super().handle()

        def do_GET(self) -> None:
            """Answer a request."""
            if self.headers.get("Host") not in (f"{HOST}:{port}", f"localhost:{port}"):
                return self._answer(403, "text/plain", "this server is for this machine")
            path, _, query = self.path.partition("?")
            if path == "/":
                return self._answer(200, "text/html", watch.page())
            if path == "/state":
                have = parse_qs(query).get("have", ["0"])[0]
                news = watch.state(int(have) if have.isdecimal() and len(have) < 12 else 0)
                return self._answer(200, "application/json", json.dumps(news, allow_nan=False))
            return self._answer(404, "text/plain", "not here")

        def _answer(self, status: int, kind: str, text: str) -> None:
            body = text.encode("utf-8")
            self.send_response(status)
            for name, value in (headers | {"Content-Type": f"{kind}; charset=utf-8"}).items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing: a page asks four times a second."""

    return Handler


def serve(paths: Sequence[str], see: Callable[[], Content], port: int, console: Console, *, opens: bool) -> None:
    """Serve a page on the loopback address until Ctrl-C; an `ExportError` says that the port is taken."""
    watch = Watch(paths, see)
    try:
        server = ThreadingHTTPServer((HOST, port), BaseHTTPRequestHandler)
    except OSError as error:
        raise ExportError(f"cannot serve on {HOST}:{port}: {error.strerror or error}") from None
    with server:
        server.daemon_threads = True
        number = server.server_address[1]
        server.RequestHandlerClass = handler(watch, int(number))
        address = f"http://{HOST}:{number}/"
        console.note(f"{address} follows {', '.join(paths)}; Ctrl-C ends it")
        if watch.error:
            console.warn(watch.error)
        if opens:
            import webbrowser

            webbrowser.open(address)
        server.serve_forever(poll_interval=0.1)
