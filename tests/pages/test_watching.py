"""`gtb view --watch`: a page that follows a file."""

import json
import os
import socket
import struct
import threading
import urllib.error
import urllib.request
from http.server import ThreadingHTTPServer

import pytest

from gtb_cli.commands.view import content_of_paths
from gtb_cli.errors import GtbError
from gtb_cli.language.reading import AS_SEEN, Numbers, Reading
from gtb_cli.pages.page_scene import Content
from gtb_cli.plots.panels import Approach
from gtb_cli.shell.view_server import HOST, Pages, handler
from gtb_cli.tessellation.recipe import Recipe
from tests.shell import SPECS, gtb

GOOD = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, {}]]\n"


@pytest.fixture
def spec(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(GOOD.format(0), encoding="utf-8")
    return path


def watch_of(path, reading=AS_SEEN) -> Pages:
    def see(numbers: Numbers, quick: bool) -> Content:
        return content_of_paths((str(path),), Recipe(3), Reading(None, numbers), Approach(), quick)

    (pages := Pages([str(path)], reading, see)).first()  # a quick picture has version 1
    return pages


def news(pages: Pages, have: int = 0, *given: str, **more: str) -> dict:
    query = {"have": [str(have)], "set": list(given)} | {name: [text] for name, text in more.items()}
    found = pages.news(query)
    return pages.news(query) if "quick" not in more and found.get("data", {}).get("quick") else found


def test_an_edit_is_news_and_nothing_else(spec):
    watch = watch_of(spec)
    assert news(watch, 2) == {"version": 2, "error": ""}
    spec.write_text(GOOD.format(25), encoding="utf-8")
    assert watch.news({})["data"]["quick"] == "a quick picture, 16 segments an edge"
    made = news(watch, 1)
    assert (made["version"], made["data"]["quick"]) == (4, "")
    assert made["data"]["box"]["texts"][2] == ("0", "25")


def test_an_error_has_its_line_and_the_last_good_mesh_stays(spec):
    watch = watch_of(spec)
    spec.write_text(GOOD.format('"1 +"'), encoding="utf-8")
    found = news(watch, 1)
    assert f"{spec}:2: control_points[2][2]" in found["error"]
    assert "data" not in found
    assert "<title>x</title>" in watch.page()
    spec.unlink()
    assert "No such file" in news(watch, 2)["error"]
    spec.write_text(GOOD.format(3), encoding="utf-8")
    assert news(watch, 3)["error"] == ""
    assert "data" in news(watch)


NUMBERS = """let = {sides = 3, height = 2}
[[patches]]
name = "a"
knots = [[0, 0], [1, 0], [0, 1]]
control_points = [[0, 0, 0], [1, 0, 0], [0, 1, "height"]]
[[patches]]
copy = "a"
repeat = "sides-1"
translate = [0, 0, "k"]
"""


def test_sliders_ask_for_other_numbers_and_the_file_stays(spec):
    spec.write_text(NUMBERS, encoding="utf-8")
    watch = watch_of(spec, Reading(None, (("sides", "2+2"),)))
    sliders = [(each["name"], each["value"], each["step"]) for each in news(watch)["data"]["numbers"]]
    assert sliders == [("sides", 3.0, 1.0), ("height", 2.0, 0.01)]
    assert '"given":{"sides":4.0}' in watch.page()
    assert max(map(watch.page().rindex, ("\nconst ", "\nlet ", ".onclick = "))) < watch.page().index("\nstart();")
    places = [watch.page().index(f'id="{name}"') for name in ("sliders", "remarks", "mode")]
    assert places == sorted(places)  # what is wrong is said below the sliders, where it is seen while they move
    heights = {}
    for given in ((), ("sides=5",), ("height=9", "sides=2"), ("height=9", "sides=2")):
        made = news(watch, 0, *given, **({} if given else {"quick": "1"}))
        heights[given] = float(made["data"]["box"]["texts"][2][1]), made["version"]
        assert bool(made["data"]["quick"]) == (not given)
    assert [height for height, _ in heights.values()] == [4, 6, 10]  # 2 + (sides - 1), and so on
    version = heights["height=9", "sides=2"][1]
    assert news(watch, version, "height=9", "sides=2") == {"version": version, "error": ""}
    assert "--set size: the spec has no number" in news(watch, 0, "size=1")["error"]
    assert "expected NAME=EXPRESSION" in news(watch, 0, "size")["error"]
    assert spec.read_text(encoding="utf-8") == NUMBERS


def test_a_quick_picture_leaves_holes_open(spec):
    spec.write_text(GOOD.replace("knots", "[[patches]]\nknots", 1).format(0), encoding="utf-8")
    reading = Reading(None, (), (("0.3,0.3,0", "g0"),))
    solid = Recipe(3, thickness=0.1)
    quick, whole = (content_of_paths((str(spec),), solid, reading, Approach(), q) for q in (True, False))
    assert len(whole.groups) == 2 * len(quick.groups) == 2
    assert quick.quick == "a quick picture, 8 segments an edge, without fills"
    assert len(quick.cells) == 2 * 8 * 8 + 2 * 3 * 8  # both sides, and a rim


def test_included_files_are_followed_and_those_that_they_include(spec, tmp_path):
    """One that is not there yet, too."""
    whole = tmp_path / "whole.toml"
    whole.write_text('include = ["inner.toml"]\n')
    seen = watch_of(whole)
    assert "inner.toml: No such file" in seen.first().error
    (tmp_path / "inner.toml").write_text(f'include = ["{spec.name}"]\n')
    assert (news(seen)["error"], news(seen)["version"]) == ("", 4)
    assert news(seen, 4) == {"version": 4, "error": ""}
    spec.write_text(spec.read_text() + "\n# more\n")
    assert "data" in news(seen, 4)


def test_a_pipe_in_the_place_of_a_spec_is_not_waited_for(spec):
    seen = watch_of(spec)
    spec.unlink()
    os.mkfifo(spec)
    assert news(seen)["error"] == f"{spec}: is not a file"
    spec.unlink()
    spec.write_text(GOOD.format(1), encoding="utf-8")
    assert news(seen)["error"] == ""


@pytest.mark.parametrize("name", ["sequence.json", "pentagon-limit.obj"])
def test_a_pipe_in_a_sequence_is_not_waited_for(name, tmp_path):
    assert gtb("degenerate", SPECS / "pentagon.toml", "--x", "1", "-n", "2", "-o", tmp_path / "made").status == 0
    file = tmp_path / "made" / name
    seen = watch_of(file.parent)
    assert seen.first().error == ""
    text = file.read_bytes()
    file.unlink()
    os.mkfifo(file)
    assert news(seen)["error"] == f"{file}: is not a file"
    file.unlink()
    file.write_bytes(text)
    assert news(seen)["error"] == ""


def test_a_file_that_is_wrong_at_first_is_followed(spec):
    spec.write_text("knots = ", encoding="utf-8")
    watch = watch_of(spec)
    assert ":1:" in watch.first().error
    assert "@" not in watch.page()[:300]
    spec.write_text(GOOD.format(1), encoding="utf-8")
    assert "data" in news(watch, 1)


def test_errors_that_are_not_ours_are_not_hidden(spec):
    def see(numbers: Numbers, quick: bool) -> Content:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Pages([str(spec)], AS_SEEN, see).first()


def test_a_whole_picture_with_an_error_has_no_quick_one_until_the_next_edit(spec):
    def see(numbers: Numbers, quick: bool) -> Content:
        if not quick:
            raise GtbError("no solid")
        return content_of_paths((str(spec),), Recipe(3), AS_SEEN, Approach(), quick)

    pages = Pages([str(spec)], AS_SEEN, see)
    assert pages.first().error == "no solid"
    assert news(pages, 0, quick="1") == {"version": 2, "error": "no solid"}
    spec.write_text(GOOD.format(25), encoding="utf-8")
    assert news(pages, 1, quick="1")["error"] == ""


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
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=120) as reply:
            return reply.status, reply.read().decode("utf-8")
    except urllib.error.HTTPError as error:
        with error:
            return error.code, ""


def test_it_serves_a_page_and_news_to_this_machine_only(server):
    status, text = answer(f"{server}/")
    assert status == 200
    assert "<title>x</title>" in text
    status, text = answer(f"{server}/state?have=0")
    assert json.loads(text)["version"] == 2
    assert answer(f"{server}/state?have=x")[0] == 200
    assert answer(f"{server}/etc/passwd")[0] == 404
    assert answer(f"{server}/", Host="example.org")[0] == 403


def test_a_browser_that_has_gone_and_an_odd_address_are_no_errors(server, capfd):
    """Each was a traceback: the first whenever a page is loaded anew before it has come."""
    host, port = server.removeprefix("http://").split(":")
    for line, reset in (("GET /state", True), ("GET http://[", False)):
        with socket.create_connection((host, int(port)), timeout=120) as connection:
            if reset:  # close with a reset, as if in the middle of an answer
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.sendall(f"{line} HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
            if not reset:
                assert connection.recv(100).startswith(b"HTTP/1.0 404")
    assert capfd.readouterr().err == ""


def test_only_one_request_at_a_time_looks_at_the_files(spec, monkeypatch):
    watch = watch_of(spec)
    held = []
    monkeypatch.setattr(watch._files, "changed", lambda: held.append(watch._lock.locked()))
    news(watch, 1)
    assert set(held) == {True}
