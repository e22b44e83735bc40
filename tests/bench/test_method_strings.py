"""What a person writes after --method: its parts, their types, and nothing left over."""

import pytest

from gripbench.bench.catalogue.making import make
from gripbench.bench.catalogue.registry import choose_method, split_choice
from gripbench.bench.catalogue.templates import write_method
from gripbench.errors import InputError


@pytest.mark.parametrize(
    "text",
    [
        "my.py[window=100]",
        "my.pyXYZ",
        "my.py,window=3",
        "my.py:Mine,window=3",
        "my.py:Mine[window=3]",
        "my.py:Mine:fast:slow",
        "my.py:Mine@window",
        "my.py:Mine@",
        "my.py:Mine@=3",
        "my.py:Mine@window=",
        "my.py:Mine@window=3,",
        "my.py:Mine@window=3,window=4",
        "slip_slope[forgetting=.9]",
        "slip_slope,forgetting=.9",
        "slip_slope paper",
    ],
)
def test_what_is_left_over_is_an_error(text):
    with pytest.raises(InputError, match=r"^method '"):
        split_choice(text)


def test_values_have_their_types():
    _, _, found = split_choice("my.py:Mine@window=100,share=1.0,robust=true,form=short,low=-1e3")
    assert found == {"window": 100, "share": 1.0, "robust": True, "form": "short", "low": -1000.0}
    assert [type(value) for value in found.values()] == [int, float, bool, str, float]
    assert split_choice("a/b.c.py:Mine:fast@n=1") == ("a/b.c.py:Mine", "fast", {"n": 1})


class Plain:
    variants = {"fast": {"window": 10}, "slow": {"window": 1000, "share": 0.1}}

    def __init__(self, window=100, share=0.5, robust=False):
        self.settings = (window, share, robust)


def test_a_plain_class_has_variants_and_gets_the_types_of_its_defaults():
    assert make(Plain, "slow", {"share": 1}, "plain").settings == (1000, 1.0, False)
    window, share, robust = make(
        Plain, "", {"window": 7.0, "share": 1, "robust": 1}, "plain"
    ).settings
    assert (type(window), type(share), robust) == (int, float, True)
    with pytest.raises(InputError, match="unknown variant of plain 'fats': did you mean 'fast'"):
        make(Plain, "fats", {}, "plain")
    with pytest.raises(InputError, match="it takes no variant"):
        make(lambda: None, "fast", {}, "plain")


def test_a_parameter_of_a_built_in_method_is_checked_by_its_type():
    with pytest.raises(InputError, match="parameter 'forgetting' is 'x'; allowed is"):
        choose_method("slip_slope@forgetting=x")


def test_the_name_of_a_built_in_method_is_taken(tmp_path):
    with pytest.raises(InputError, match="name 'slip_slope': a built-in method has it"):
        write_method("slip_slope", tmp_path, False)
    assert not list(tmp_path.iterdir())
