"""`gtb eval`: numbers that read back exactly."""

import json

import numpy as np

import gtb_cli
from gtb_cli.commands.evaluate import BATCH_LINES
from tests.shell import BICUBIC, PENTAGON, gtb


def rows(text: bytes) -> np.ndarray:
    return np.array([line.split() for line in text.decode().splitlines()], dtype=float)


def test_eval_gives_digits_that_read_back_exactly():
    u = np.array([[0.5, 1.5], [2, 0], [0, 0.1], [1 / 3, 2 / 3]])
    text = "".join(f"{a!r} {b!r}\n" for a, b in u.tolist()).encode()
    patch = gtb_cli.load(PENTAGON)
    assert (rows(gtb("eval", PENTAGON, stdin=text).out) == patch.evaluate(u)).all()
    assert (rows(gtb("eval", PENTAGON, "--basis", stdin=text).out) == patch.basis(u)).all()
    found = json.loads(gtb("eval", PENTAGON, "--json", "--basis", stdin=text).out)
    assert found == {"schema": 1, "basis": patch.basis(u).tolist(), "parameters": u.tolist()}


def test_eval_adds_derivatives_normals_and_curvature():
    patch, u = gtb_cli.load_patch(PENTAGON), np.array([[0.5, 1.5], [1.1, 0.2]])
    text = b"0.5 1.5\n1.1 0.2\n"
    for options, parametrization in (([], "toric"), (["--parametrization", "linear"], "linear")):
        first, second = (patch.basis_derivatives(u, order, parametrization) for order in (1, 2))
        found = rows(gtb("eval", PENTAGON, "--basis", "--derivatives", "2", *options, stdin=text).out)
        expected = [patch.basis(u, parametrization), first[:, :, 0], first[:, :, 1]]
        expected += [second[:, :, 0, 0], second[:, :, 0, 1], second[:, :, 1, 1]]
        assert (found == np.concatenate(expected, axis=1)).all()
        found = rows(gtb("eval", PENTAGON, "--normals", "--curvature", *options, stdin=text).out)
        expected = [patch.evaluate(u, parametrization), patch.normals(u, parametrization)]
        assert (found == np.column_stack([*expected, *patch.curvature(u, parametrization)])).all()


def test_eval_of_many_lines():
    u = np.random.default_rng(5).uniform(0, 3, (2 * BATCH_LINES + 3, 2))
    text = b"".join(b"%r %r\n" % tuple(row) for row in u.tolist())
    found = rows(gtb("eval", BICUBIC, stdin=text).out)
    np.testing.assert_allclose(found, gtb_cli.load(BICUBIC).evaluate(u), rtol=0, atol=1e-14)
