"""Reading TOML: every mistake is one line that names file, key and remedy."""

import pytest
from pydantic import Field

from gripbench.configuration import Configuration, parse, read_toml
from gripbench.errors import InputError, nearest, unknown


class Inner(Configuration):
    depth: float = Field(default=1.0, gt=0.0, le=10.0)
    count: int = 1


class Outer(Configuration):
    name: str
    inner: Inner = Inner()
    table: dict[str, Inner] = Field(default_factory=dict)
    rows: list[Inner] = Field(default_factory=list)


def test_missing_file(tmp_path):
    path = tmp_path / "none.toml"
    with pytest.raises(InputError, match="no such file"):
        read_toml(path)


@pytest.mark.parametrize("text", ["", "  \n\n", "\t"])
def test_empty_file(tmp_path, text):
    path = tmp_path / "empty.toml"
    path.write_text(text)
    with pytest.raises(InputError, match="the file is empty"):
        read_toml(path)


@pytest.mark.parametrize("content", [b"name = ", b"[a\n", b"a = 1\na = 2", b"\xff\xfe\x00"])
def test_not_toml(tmp_path, content):
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.toml: (not valid TOML|cannot be read as text)"):
        read_toml(path)


def test_a_folder_is_not_a_file(tmp_path):
    with pytest.raises(InputError, match="is no plain file"):
        read_toml(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "missing key 'name'"),
        ({"nme": "a", "name": "a"}, "unknown key 'nme': did you mean 'name'"),
        ({"name": "a", "inner": {"dpth": 1.0}}, r"unknown key 'inner\.dpth': did you mean 'depth'"),
        ({"name": "a", "table": {"x": {"cont": 1}}}, r"'table\.x\.cont': did you mean 'count'"),
        ({"name": "a", "rows": [{}, {"cont": 1}]}, r"'rows\.1\.cont': did you mean 'count'"),
        ({"name": "a", "inner": {"depth": 0.0}}, r"'inner\.depth'.*greater than 0.*\(given 0\.0\)"),
        ({"name": "a", "inner": {"depth": 11}}, r"'inner\.depth'.*less than or equal to 10"),
        ({"name": "a", "inner": {"depth": float("nan")}}, r"'inner\.depth'"),
        ({"name": "a", "inner": {"depth": "deep"}}, r"'inner\.depth'.*valid number"),
        ({"name": "a", "inner": {"count": 1.5}}, r"'inner\.count'.*integer"),
        ({"name": 3}, "'name'.*string"),
        ({"name": "a", "inner": 3}, "key 'inner'"),
    ],
)
def test_mistakes_are_one_line(content, message):
    with pytest.raises(InputError, match=message) as caught:
        parse(Outer, content, "some.toml")
    assert str(caught.value).startswith("some.toml: ")
    assert "\n" not in str(caught.value)


def test_what_was_read_cannot_be_changed():
    read = parse(Outer, {"name": "a"}, "some.toml")
    with pytest.raises(ValueError, match="frozen"):
        read.name = "b"


def test_hints():
    assert nearest("masss", ["mass", "track"]) == "did you mean 'mass'?"
    assert nearest("zzz", ["mass", "track"]) == "known: mass, track"
    assert str(unknown("kind", "zzz", ["a"])) == "unknown kind 'zzz': known: a"
