"""Settings of all tests."""

import os

import pytest
from hypothesis import settings

# An example that compiles a kernel, or a busy machine, says nothing about the property. The same
# examples every time: a change is judged, not the draw. GRIPBENCH_FRESH=1 draws new ones.
settings.register_profile(
    "gripbench",
    deadline=None,
    max_examples=60,
    derandomize=not os.environ.get("GRIPBENCH_FRESH"),
)
settings.load_profile("gripbench")

os.environ.pop("GRIPBENCH_SALT", None)  # what tests expect belongs to public seeds


@pytest.fixture(autouse=True)
def _pipe(monkeypatch):
    """What is printed goes into a pipe, whatever width the runner of the tests sets."""
    monkeypatch.delenv("COLUMNS", raising=False)
