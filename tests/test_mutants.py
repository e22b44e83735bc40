"""The lines that matter most: whoever spoils one is told by a test."""

import mutants
import pytest


def test_every_mutant_is_a_line_that_is_there_once():
    assert len(mutants.MUTANTS) == 20
    for one in mutants.MUTANTS:
        text = (mutants.ROOT / "gripbench" / one.file).read_text(encoding="utf-8")
        assert text.count(one.old) == 1, one
        assert one.new != one.old
        assert (mutants.ROOT / one.tests).exists()


def test_a_line_that_is_gone_is_an_error():
    gone = mutants.MUTANTS[0]._replace(old="a line that nobody has written")
    with pytest.raises(ValueError, match="0 times: a line that nobody"):
        list(mutants.survivors([gone]))


@pytest.mark.slow
@pytest.mark.parametrize("mutant", mutants.MUTANTS, ids=lambda one: f"{one.file}: {one.new}")
def test_every_mutant_is_noticed(mutant):
    assert not list(mutants.survivors([mutant]))
