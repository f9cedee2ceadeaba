"""What coverage-guided fuzzing found is found no more, and its seeds are read as they should be."""

from __future__ import annotations

import pytest

from tests.tools.guided import CORPUS, READERS, judge, seeds


def test_the_corpus_has_folders_for_what_is_read():
    assert {path.name for path in CORPUS.iterdir() if path.is_dir()} <= set(READERS)


@pytest.mark.parametrize("kind", READERS)
def test_nothing_is_found_in_the_corpus_and_the_seeds(kind):
    texts = seeds(kind)
    assert len(texts) > 5
    for data in texts:
        assert judge(kind, data) is None, data


@pytest.mark.parametrize(
    ("kind", "data"), [("spec", b"knots = 1"), ("expression", b"2 + 2"), ("mesh", b"v 0 0 0\nf 1 1 1\n")]
)
def test_the_judge_sees_what_is_wrong(kind, data, monkeypatch):
    def broken(*_):
        raise KeyError("oh")

    for place in (
        "gtb_cli.language.loading.parse",
        "gtb_cli.language.expression.evaluate_expression",
        "gtb_cli.formats.meshfiles.decode_mesh",
    ):
        monkeypatch.setattr(place, broken)
    name, text = judge(kind, data) or ("", "")
    assert name.startswith("KeyError")
    assert "oh" in text
