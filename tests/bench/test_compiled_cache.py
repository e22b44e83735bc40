"""Compiled code is kept where it can be, by this user only."""

import tempfile
from pathlib import Path

import pytest

from gripbench import compiled_cache
from gripbench.errors import InputError
from gripbench.methods import slip_slope
from gripbench.sources import source_digest


@pytest.fixture
def step():
    return slip_slope.SlipSlope.step.py_func


def test_a_temporary_folder_of_this_user_is_the_last_resort(step, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    found = compiled_cache.InTemporaryFolder.from_function(step, slip_slope.__file__)
    assert found.get_cache_path().startswith(str(tmp_path))
    (folder,) = tmp_path.iterdir()
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)  # others could have put code there
    with pytest.raises(InputError, match="set NUMBA_CACHE_DIR to a folder that can be written"):
        compiled_cache.InTemporaryFolder.from_function(step, slip_slope.__file__)


def test_the_folder_that_the_user_names_comes_first(step, tmp_path, monkeypatch):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    found = compiled_cache.InGivenFolder.from_function(step, slip_slope.__file__)
    assert found.get_cache_path().startswith(str(tmp_path))
    assert found.get_source_stamp() == source_digest(Path(slip_slope.__file__))
