"""Specs with something wrong or odd about them, made from good ones by changing bytes, numbers or structure."""

import copy
import json
import random
import tomllib

from tests.specs import GOOD_SPECS

# Texts put in place of a number
ODD_NUMBERS = [
    "0", "-1", "1e400", "-0.0", "nan", "inf", "1e-320", "1e308", "-1e308", "true", '"sqrt(2)"', '"1/0"', '"2**9999"',
    '"("', "9" * 400, "0x10", "1_000", '""', "[]", "{}", "null", '"nan"', '"1e9/3"', "1e7", "1e-9",
    "0.30000000000000004",
]  # fmt: skip

ODD_BYTES = [*(bytes([byte]) for byte in b"\x00\xff[]\"'=,\n\r#{}-e"), b"\xef\xbb\xbf"]

KEYS = [
    "knots", "weights", "control_points", "coefficients", "lifting", "edge_normals", "edge_scale", "name", "patches",
    "wieghts", "let", "include", "weld", "copy", "repeat", "rotate",
]  # fmt: skip

VALUES = [
    None, True, 0, -1, 1.5, "x", "binomial", "partition-of-unity", "unit", "primitive", [], [[]], {}, [1, 2],
    [[0, 0], [1, 1]], float("nan"), 1e300, 1e-300, "sqrt(2)/4", [[0, 0, 0, 0]],
    {"a": 1, "b": "a + c", "c": "b"}, {"axis": "z", "degrees": "72*k"}, "1%", 10**9, ["spec.toml"],
    ["../x", "/dev/zero"],
]  # fmt: skip


# A model with all that models have, but for the file that it includes
COPIES = b"""
include = ["other.toml"]
weld = "0.01%"
let = {R = 2, turn = "360*deg/5", h = "R*sin(turn)"}
[[patches]]
name = "wall"
knots = [[0, 0], [1, 0], [0, 1], [1, 1]]
control_points = [["R", 0, 0], [1, "h", 0], ["R", 0, 1], [1, "h", 1]]
[[patches]]
copy = "wall"
name = "other"
mirror = "y"
scale = ["R", 1, "1/R"]
[[patches]]
copy = "other"
repeat = 3
rotate = {axis = "z", degrees = "72*k", about = [0, 0, "k"]}
translate = ["k/R", 0]
"""


def mutation(rng: random.Random) -> tuple[bytes, str]:
    """A changed spec, and the suffix of its file."""
    source = rng.choice(GOOD_SPECS[:-1]).read_bytes()
    if len(source) > 20_000:
        source = GOOD_SPECS[0].read_bytes()
    if rng.random() < 0.2:
        source = COPIES if rng.random() < 0.2 else COPIES.replace(b'include = ["other.toml"]\n', b"")
    if rng.random() < 0.5:
        return _changed_bytes(rng, source), ".toml"
    data = tomllib.loads(source.decode())
    for _ in range(rng.randint(1, 3)):
        _change(rng, data)
    return json.dumps(data).encode(), ".json"


def _changed_bytes(rng: random.Random, text: bytes) -> bytes:
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text) + 1)
        kind = rng.randrange(6)
        if kind == 0:
            text = text[:at] + rng.choice(ODD_BYTES) + text[at:]
        elif kind == 1:
            text = text[:at] + text[at + rng.randint(1, 30) :]
        elif kind == 2:
            end = min(len(text), at + rng.randint(1, 80))
            text = text[:end] + text[at:end] + text[end:]
        elif kind == 3:
            text = text[:at]
        elif kind == 4:
            text = text[:at] + bytes([rng.randrange(256)]) + text[at + 1 :]
        else:
            numbers = [i for i, byte in enumerate(text) if 48 <= byte < 58]
            if numbers:
                start = end = rng.choice(numbers)
                while end < len(text) and text[end : end + 1] in b"0123456789.":
                    end += 1
                text = text[:start] + rng.choice(ODD_NUMBERS).encode() + text[end:]
    return text


def _change(rng: random.Random, data: dict) -> None:
    """Change one value somewhere inside, or the keys."""
    place: object = data
    path = []
    while isinstance(place, dict | list) and place and (not path or rng.random() < 0.8):
        key = rng.choice(list(place)) if isinstance(place, dict) else rng.randrange(len(place))
        path.append((place, key))
        place = place[key]  # type: ignore[index]
    if not path:
        data[rng.choice(KEYS)] = copy.deepcopy(rng.choice(VALUES))
        return
    holder, key = path[-1]
    kind = rng.randrange(5)
    if kind == 0:
        del holder[key]  # type: ignore[attr-defined]
    elif kind == 1 and isinstance(holder, list):
        holder.insert(key, copy.deepcopy(rng.choice(VALUES)))
    elif kind == 2:
        data[rng.choice(KEYS)] = copy.deepcopy(rng.choice(VALUES))
    elif kind == 3 and isinstance(place, int | float):
        holder[key] = place * rng.choice([0, -1, 1e-9, 1e9, 1e30, 1 + 1e-15]) + rng.choice([0, 0, 1e7])  # type: ignore[index]
    else:
        holder[key] = copy.deepcopy(rng.choice(VALUES))  # type: ignore[index]


# What files of other programs get in some place: words of text, and whole and real numbers of binary files
ODD_WORDS = [
    b"0", b"-1", b"1e400", b"nan", b"1e99", b"99999", b"\xff", b"\x00", b"\n", b"Group", b",", b";", b"{", b'"',
    b"1e-99", b"3D", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80", b"\xff\xff\xff\xff\xff\xff\xef\x7f", b"\x00\x00\x10\x00",
]  # fmt: skip


def mutated(rng: random.Random, data: bytes) -> bytes:
    """A file of any format with some bytes changed, left out or repeated; half of them keep its length."""
    steady = rng.random() < 0.5
    for _ in range(rng.randint(1, 4)):
        at, length = rng.randrange(len(data) + 1), rng.randint(1, 12)
        match rng.randrange(3 if steady else 6):
            case 0:
                data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
            case 1:
                word = rng.choice(ODD_WORDS)
                data = data[:at] + word + data[at + len(word) :]
            case 2:
                part = data[rng.randrange(len(data) + 1) :][:length]
                data = data[:at] + part + data[at + len(part) :]
            case 3:
                data = data[:at] + rng.choice(ODD_WORDS) + data[at + length :]
            case 4:
                data = data[:at] + (data[at : at + 40] + data[at:] if rng.random() < 0.7 else data[at + length :])
            case 5:
                data = data[: at or 1]
    return data
