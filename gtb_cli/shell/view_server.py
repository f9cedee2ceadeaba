"""`gtb view --watch`: a page on this machine that follows its files, with sliders for their numbers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import parse_qs

from gtb_cli.errors import ExportError, GtbError
from gtb_cli.language.reading import Numbers, Reading, assignment
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.messages import Console
from gtb_cli.shell.streams import is_device, read_bytes
from gtb_cli.shell.watching import Files

if TYPE_CHECKING:
    from gtb_cli.pages.page_scene import Content

HOST = "127.0.0.1"


class Seen(NamedTuple):
    """One state of the files for some numbers, by a number of its own: the data of a page, or an error."""

    version: int
    error: str
    data: dict[str, Any] | None


class Pages:
    """The pages of files as they are now, for numbers that their sliders ask for.

    ``see(numbers, quick)`` reads the files at `paths`, quickly for a slider that still moves, and for what is not seen
    yet. The numbers of a single spec have sliders.
    """

    MOST = 12  # states that are kept, as several pages may show different states

    def __init__(self, paths: Sequence[str], reading: Reading, see: Callable[[Numbers, bool], Content]) -> None:
        self._paths, self._reading, self._see = paths, reading, see
        self._files, self._lock, self._turns = Files(lambda: paths), Lock(), (Lock(), Lock())
        self._seen: dict[tuple[Numbers, bool], Seen] = {}
        self._edits = self._versions = 0
        self._last: dict[str, Any] = {}

    def first(self) -> Seen:
        """Return the state for the numbers of the command line; the quick one is there before it."""
        self.state(self._reading.let, True)
        return self.state(self._reading.let)

    def state(self, numbers: Numbers, quick: bool = False) -> Seen:
        """Return what there is now; a quick state is made even while another one is."""
        key = numbers, quick
        if known := self._known(key):
            return known
        with self._turns[quick]:
            if known := self._known(key):  # another page has asked for it, too
                return known
            edits = self._edits
            data, error = self._made(numbers, quick)
            with self._lock:
                self._versions += 1
                found = Seen(self._versions, error, data)
                self._last = data or self._last
                if edits == self._edits:  # otherwise the files have changed meanwhile
                    self._seen[key] = found
                    if data and not data["quick"] and not self._reading.fills:  # as of a mesh, which is what it is
                        self._seen[numbers, False] = found
                    while len(self._seen) > self.MOST:
                        del self._seen[next(iter(self._seen))]
            return found

    def _known(self, key: tuple[Numbers, bool]) -> Seen | None:
        """Return a state that was made of the files as they are now: a quick one has the error of a whole one."""
        with self._lock:
            if self._files.changed():
                self._seen.clear()
                self._edits += 1
            whole = self._seen.get((key[0], False))
            return whole if whole and whole.error else self._seen.get(key)

    def _made(self, numbers: Numbers, quick: bool) -> tuple[dict[str, Any] | None, str]:
        from gtb_cli.language.document import spec_format_of
        from gtb_cli.language.sliders import sliders
        from gtb_cli.pages.page import page_data

        try:
            for path in self._paths:
                if is_device(path):  # reading a pipe would wait for its writer
                    raise GtbError(f"{path}: is not a file")
            data = page_data(content := self._see(numbers, quick)) | {"quick": content.quick}
            format = self._reading.spec_format or spec_format_of(path)
            if len(self._paths) == 1 and format is not None:
                data["numbers"] = [each._asdict() for each in sliders(read_bytes(path), path, format)]
            return data, ""
        except (GtbError, MemoryError) as error:
            return None, "\n".join(map(str, faults_about(error)))

    def page(self) -> str:
        """Return the page for the numbers of the command line: at once, with what there is to see."""
        seen = self._known((self._reading.let, False)) or self._known((self._reading.let, True)) or Seen(0, "", None)
        from gtb_cli.language.sliders import plain_value
        from gtb_cli.pages.page import page_with

        given = {name: value if (number := plain_value(value)) is None else number for name, value in self._reading.let}
        data = {**self._last, **(seen.data or {}), "watch": seen.version, "error": seen.error}
        return page_with(data | {"given": given}, data.get("name", "gtb view"))

    def news(self, query: dict[str, list[str]]) -> dict[str, Any]:
        """Return what a page needs that has the version `have` and asks for the numbers `set`."""
        try:
            numbers = tuple(map(assignment, query.get("set", ())))
        except ValueError as error:
            return {"version": 0, "error": str(error)}
        quick = "quick" in query
        if not quick and not self._known((numbers, False)):  # a quick picture, and one that is there, wait for none
            quick = self._turns[False].locked() or not self._known((numbers, True))
        if (seen := self.state(numbers, quick)).error and quick:  # which the whole one need not have
            seen = self.state(numbers)
        news: dict[str, Any] = {"version": seen.version, "error": seen.error}
        return news if seen.data is None or query.get("have") == [str(seen.version)] else news | {"data": seen.data}


def handler(pages: Pages, port: int) -> type[BaseHTTPRequestHandler]:
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
                return self._answer(200, "text/html", pages.page())
            if path == "/state":
                return self._answer(200, "application/json", json.dumps(pages.news(parse_qs(query)), allow_nan=False))
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


def serve(pages: Pages, paths: Sequence[str], port: int, console: Console, *, opens: bool) -> None:
    """Serve pages on the loopback address until Ctrl-C; an `ExportError` says that the port is taken."""
    try:
        server = ThreadingHTTPServer((HOST, port), BaseHTTPRequestHandler)
    except OSError as error:
        raise ExportError(f"cannot serve on {HOST}:{port}: {error.strerror or error}") from None
    with server:
        server.daemon_threads = True
        number = server.server_address[1]
        server.RequestHandlerClass = handler(pages, int(number))
        address = f"http://{HOST}:{number}/"
        console.note(f"{address} follows {', '.join(paths)}; Ctrl-C ends it")
        Thread(target=server.serve_forever, args=(0.1,), daemon=True).start()
        if opens:
            import webbrowser

            webbrowser.open(address)
        if fault := pages.first().error:
            console.warn(fault)
        while True:
            time.sleep(60)
