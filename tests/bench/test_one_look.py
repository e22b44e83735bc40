"""How tables and pictures look is said in one place each."""

import re
from pathlib import Path

import gripbench

ROOT = Path(gripbench.__file__).parent / "bench"


def modules_with(pattern):
    found = re.compile(pattern)
    return {
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        if found.search(path.read_text(encoding="utf-8"))
    }


def test_tables_of_a_terminal_are_made_in_one_module():
    assert modules_with(r"rich\.table|rich\.box|rich import box") == {"publishing/tables.py"}


def test_colours_of_pictures_are_named_in_one_module():
    assert modules_with(r"#[0-9a-fA-F]{6}") == {"publishing/figures/style.py"}
