"""A short scenario and plug-ins that fail in every way there is."""

from pathlib import Path

import pytest

from gripbench.configuration import CONFIGS

PLUGINS = Path(__file__).parent / "plugins"


@pytest.fixture
def short_scenario(tmp_path):
    """Path of a scenario of one second, `short`."""
    text = (CONFIGS / "scenarios" / "constant_mu.toml").read_text(encoding="utf-8")
    text = text.replace('name = "constant_mu"', 'name = "short"', 1)
    text = text.replace("horizon = 30.0", "horizon = 1.0", 1)
    path = tmp_path / "short.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="session")
def plugins():
    """Folder with the files of plug-ins."""
    return PLUGINS
