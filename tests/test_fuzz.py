"""A little of what `make fuzz` does at length; and what was found earlier is found no more."""

import pytest

from tests.marks import mostly_long
from tests.tools.fuzz import foreign_files, imports, kill, models, mutate, overwriting
from tests.tools.judge import CORPUS, READERS, judge, seeds


@pytest.mark.parametrize(("count", "seed"), mostly_long([(100, 1), (200, 2)]))
def test_mutated_specs_give_a_mesh_or_a_message(count, seed):
    assert mutate(count, seed) is None


@pytest.mark.parametrize(("judged", "count"), mostly_long([(overwriting, 30), (models, 20)]))
def test_what_is_made_by_rules_gives_what_it_should(judged, count):
    assert judged(count, seed=1) is None


FOREIGN = [name for name in sorted(foreign_files()) if name != "part.igs"]
LONG = [("part.igs", 8, 1), *((name, 160, 2) for name in FOREIGN)]


@pytest.mark.parametrize(("name", "count", "seed"), [(name, 40, 1) for name in FOREIGN] + mostly_long(LONG, 0))
@pytest.mark.usefixtures("probed_here")
def test_mutated_files_of_other_programs_are_read_or_refused(name, count, seed):
    assert imports(count, seed, names=[name]) is None


@pytest.mark.parametrize("victim", mostly_long(["mesh.ply", "degenerate"], 0))
def test_a_killed_process_leaves_what_was_there_or_what_is_new(victim):
    assert kill(2, seed=1, victims=[victim]) is None


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
