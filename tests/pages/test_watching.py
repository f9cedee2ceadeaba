"""`gtb view --watch`: a page that follows a file."""

import json
import os
import socket
import struct
import threading
import urllib.error
import urllib.request
from functools import partial
from http.server import ThreadingHTTPServer

import pytest

from gtb_cli.commands.view import content_of_paths
from gtb_cli.pages.page_scene import Content
from gtb_cli.plots.panels import Approach
from gtb_cli.shell.watching import HOST, Watch, handler
from gtb_cli.tessellation.recipe import Recipe
from tests.shell import SPECS, gtb

GOOD = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, {}]]\n"


@pytest.fixture
def spec(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(GOOD.format(0), encoding="utf-8")
    return path


def watch_of(path) -> Watch:
    def see() -> Content:
        return content_of_paths((str(path),), Recipe(3), None, Approach())

    return Watch([str(path)], see)


def test_an_edit_is_news_and_nothing_else(spec):
    watch = watch_of(spec)
    assert watch.state(watch.version) == {"version": 1, "error": ""}
    spec.write_text(GOOD.format(25), encoding="utf-8")
    news = watch.state(1)
    assert news["version"] == 2
    assert news["data"]["box"]["texts"][2] == ("0", "25")


def test_an_error_has_its_line_and_the_last_good_mesh_stays(spec):
    watch = watch_of(spec)
    spec.write_text(GOOD.format('"1 +"'), encoding="utf-8")
    news = watch.state(1)
    assert f"{spec}:2: control_points[2][2]" in news["error"]
    assert "data" not in news
    assert watch.data["name"] == "x"
    spec.unlink()
    assert "No such file" in watch.state(2)["error"]
    spec.write_text(GOOD.format(3), encoding="utf-8")
    assert watch.state(3)["error"] == ""
    assert "data" in watch.state(0)


def test_included_files_are_followed_and_those_that_they_include(spec, tmp_path):
    """One that is not there yet, too."""
    whole = tmp_path / "whole.toml"
    whole.write_text('include = ["inner.toml"]\n')
    seen = watch_of(whole)
    assert "inner.toml: No such file" in seen.error
    (tmp_path / "inner.toml").write_text(f'include = ["{spec.name}"]\n')
    assert (seen.state(0)["error"], seen.version) == ("", 2)
    assert (seen.state(2), seen.version) == ({"version": 2, "error": ""}, 2)
    spec.write_text(spec.read_text() + "\n# more\n")
    assert "data" in seen.state(2)


def test_a_pipe_in_the_place_of_a_spec_is_not_waited_for(spec):
    seen = watch_of(spec)
    spec.unlink()
    os.mkfifo(spec)
    assert seen.state(0)["error"] == f"{spec}: is not a file"
    spec.unlink()
    spec.write_text(GOOD.format(1), encoding="utf-8")
    assert seen.state(0)["error"] == ""


@pytest.mark.parametrize("name", ["sequence.json", "pentagon-limit.obj"])
def test_a_pipe_in_a_sequence_is_not_waited_for(name, tmp_path):
    assert gtb("degenerate", SPECS / "pentagon.toml", "--x", "1", "-n", "2", "-o", tmp_path / "made").status == 0
    file = tmp_path / "made" / name
    see = partial(content_of_paths, (str(file.parent),), None, None, Approach())
    seen = Watch([str(file.parent)], see)
    assert seen.error == ""
    text = file.read_bytes()
    file.unlink()
    os.mkfifo(file)
    assert seen.state(0)["error"] == f"{file}: is not a file"
    file.unlink()
    file.write_bytes(text)
    assert seen.state(0)["error"] == ""


def test_a_file_that_is_wrong_at_first_is_followed(spec):
    spec.write_text("knots = ", encoding="utf-8")
    watch = watch_of(spec)
    assert ":1:" in watch.error
    assert "@" not in watch.page()[:300]
    spec.write_text(GOOD.format(1), encoding="utf-8")
    assert "data" in watch.state(1)


def test_errors_that_are_not_ours_are_not_hidden(spec):
    def see() -> Content:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Watch([str(spec)], see)


@pytest.fixture
def server(spec):
    with ThreadingHTTPServer((HOST, 0), None) as made:
        made.RequestHandlerClass = handler(watch_of(spec), made.server_address[1])
        thread = threading.Thread(target=made.serve_forever, args=(0.02,))
        thread.start()
        yield f"http://{HOST}:{made.server_address[1]}"
        made.shutdown()
        thread.join()


def answer(address: str, **headers: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10) as reply:
            return reply.status, reply.read().decode("utf-8")
    except urllib.error.HTTPError as error:
        with error:
            return error.code, ""


def test_it_serves_a_page_and_news_to_this_machine_only(server):
    status, text = answer(f"{server}/")
    assert status == 200
    assert "<title>x</title>" in text
    status, text = answer(f"{server}/state?have=0")
    assert json.loads(text)["version"] == 1
    assert answer(f"{server}/state?have=x")[0] == 200
    assert answer(f"{server}/etc/passwd")[0] == 404
    assert answer(f"{server}/", Host="example.org")[0] == 403


def test_a_browser_that_has_gone_and_an_odd_address_are_no_errors(server, capfd):
    """Each was a traceback: the first whenever a page is loaded anew before it has come."""
    host, port = server.removeprefix("http://").split(":")
    for line, reset in (("GET /state", True), ("GET http://[", False)):
        with socket.create_connection((host, int(port)), timeout=10) as connection:
            if reset:  # close with a reset, as if in the middle of an answer
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.sendall(f"{line} HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
            if not reset:
                assert connection.recv(100).startswith(b"HTTP/1.0 404")
    assert capfd.readouterr().err == ""
