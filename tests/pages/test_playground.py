"""The page of `make playground`: its Python here, and the page in a browser, where this process stands for Pyodide."""

import contextlib
import http.server
import json
import os
import re
import subprocess
import sys
import threading
import time
import zipfile
from functools import partial

import numpy as np
import pytest

from tests.marks import long
from tests.shell import until
from tests.tools.browser import BROWSERS
from tests.tools.playground import PAGE, build

PYTHON = re.search(r'<script type="text/python" id="python">\n(.*?)</script>', PAGE.read_text("utf-8"), re.DOTALL)[1]
STUB = """export const loadPyodide = async () => ({
  loadPackage() {}, unpackArchive() {}, runPython() {}, toPy: x => x,
  globals: { get: () => (args, spec, made) => {
    const asked = new XMLHttpRequest();
    asked.open("POST", new URL("/run", import.meta.url), false);
    asked.send(JSON.stringify([args, spec, made]));
    const [status, output, messages, content] = JSON.parse(asked.responseText);
    return { toJs: () => [status, output, messages, content && Uint8Array.from(content)], destroy() {} };
  } } });"""


@pytest.fixture
def folder(tmp_path):
    build(tmp_path / "playground")
    return tmp_path / "playground"


@long
def test_the_packages_are_enough(folder):
    """Without anything else but numpy, commands give what the page asks for: texts, files, and errors with lines."""
    with zipfile.ZipFile(folder / "packages.zip") as archive:
        archive.extractall(folder / "packages")
    import_numpy = f"import sys; sys.path[:0] = [{os.fspath(folder / 'packages')!r}]; import gtb_cli, click, trimesh; "
    asks = f"""{import_numpy}assert all("playground" in each.__file__ for each in (gtb_cli, click, trimesh))
for name in ("scipy", "matplotlib", "OCP", "pytest"): sys.modules[name] = None
{PYTHON}
status, bowl, _, _ = gtb(["new", "bowl", "5"], "", None)
assert status == 0 and "sides = 5" in bowl
for made, start in (("a.glb", b"glTF"), ("a.stl", b""), ("a.3mf", b"PK")):
    status, _, messages, content = gtb(["mesh", "spec.toml", "-q", "-o", made, "--thickness", "2", "-n8"], bowl, made)
    assert status == 0 and messages == "" and content.startswith(start) and len(content) > 9999
status, _, messages, content = gtb(["--errors", "json", "view", "spec.toml", "-o", "a.html"], bowl + "]", "a.html")
print(__import__("json").dumps([status, messages, content]))"""
    done = subprocess.run([sys.executable, "-c", asks], cwd=folder, capture_output=True, text=True, check=True)
    status, messages, content = json.loads(done.stdout)
    assert (status, content) == (2, None)
    assert json.loads(messages)["errors"][0]["line"] > 1


class Server(http.server.SimpleHTTPRequestHandler):
    """Files, and what Pyodide would do."""

    extensions_map = {".mjs": "text/javascript", ".html": "text/html"}  # noqa: RUF012

    def log_message(self, *_):
        pass

    def do_POST(self):
        *found, content = WORLD["gtb"](*json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        body = json.dumps([*found, content and list(content)]).encode()
        self.send_response(200)
        self.end_headers()
        self.wfile.write(body)


WORLD: dict = {}
exec(PYTHON, WORLD)


@long
@pytest.mark.skipif(not BROWSERS, reason="no browser: see make browser")
def test_browser_shows_edits_and_errors_at_their_lines(folder, tmp_path, monkeypatch):
    page = (folder / "index.html").read_text("utf-8")
    assert len(re.findall("https?://", page)) == 1  # where Pyodide comes from, in one line
    (folder / "index.html").write_text(re.sub('const PYODIDE = "[^"]*"', 'const PYODIDE = "./"', page), "utf-8")
    (folder / "pyodide.mjs").write_text(STUB)
    monkeypatch.chdir(tmp_path)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Server, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with contextlib.closing(server.socket), BROWSERS[0](tmp_path / "profile") as browser:

        def said(text: str) -> str:
            shown = "return document.getElementById('said').textContent"
            until(lambda: text in browser.run(shown))
            return browser.run(shown)

        def typed(old: str, new: str) -> None:
            change = f"t.value = t.value.replace({old!r}, {new!r}); t.oninput()"
            browser.run(f"const t = document.getElementById('text'); {change}")

        browser.open(f"http://127.0.0.1:{server.server_port}/")
        said("triangles")
        time.sleep(1)
        before = browser.picture()
        browser.run("document.getElementById('said').textContent = ''")
        typed("sides = 5", "sides = 9")
        said("triangles")
        assert np.abs(browser.picture().astype(int) - before).max() > 99
        typed("sides = 9", "sides = = 9")
        assert said("line 12: ").startswith("line 12: is not valid TOML")
        assert browser.run("return document.querySelector('#numbers b').textContent") == "12"
        assert browser.complaints() == []
        server.shutdown()
