"""Every function that docs/architecture.md names is where the page says."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "architecture.md"
NAMED = sorted(set(re.findall(r"`((?:bench|envs|methods|logs)\.[\w.]+)`", PAGE.read_text())))


@pytest.mark.parametrize("name", NAMED)
def test_a_named_function_exists(name):
    parts = ["gripbench", *name.split(".")]
    for length in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for attribute in parts[length:]:
            found = getattr(found, attribute)
        assert callable(found)
        return


def test_the_page_names_the_walk():
    assert len(NAMED) >= 18
