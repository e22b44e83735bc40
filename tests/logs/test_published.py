"""The maps of published recordings, and the recordings themselves where their files are."""

import numpy as np
import pytest

from gripbench.errors import InputError
from gripbench.logs.channels.derivation import slope
from gripbench.logs.locations import data_folder
from gripbench.logs.mapping.channel_map import load_channel_map, vehicle_values
from gripbench.logs.published import AbsentDataError, load_recording, recording_files

NAMES = sorted(recording_files())


def _imported(name):
    try:
        return load_recording(name)
    except AbsentDataError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("name", NAMES)
def test_map_is_complete(name):
    channel_map = load_channel_map(recording_files()[name])
    assert channel_map.name == name
    assert channel_map.licence
    assert channel_map.source.startswith("https://")
    assert all(len(file.sha256) == 64 for file in channel_map.files.values())
    assert vehicle_values(channel_map, None)


def test_absent_data_says_where_to_get_it(tmp_path):
    with pytest.raises(AbsentDataError, match=r"get it from https://.*GRIPBENCH_DATA"):
        load_recording("f1tenth_optitrack", tmp_path)


def test_unknown_recording_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'f1tenth_optitrack'"):
        load_recording("f1tenth")


def test_folder_setting_comes_before_variable_before_default(tmp_path, monkeypatch):
    monkeypatch.setenv("GRIPBENCH_DATA", "/somewhere")
    assert data_folder(tmp_path) == tmp_path
    assert str(data_folder()) == "/somewhere"
    monkeypatch.delenv("GRIPBENCH_DATA")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert data_folder() == tmp_path / "gripbench" / "data"


@pytest.mark.parametrize("name", NAMES)
def test_recording_has_no_wrong_sign_or_unit(name):
    imported = _imported(name)
    assert not imported.report.of("wrong"), imported.report.text()
    for recording in imported.recordings:
        for channel in recording.observations.dtype.names:
            assert np.isfinite(recording.observations[channel]).all(), channel
        assert np.all(np.diff(recording.observations["time"]) > 0.0)


def test_slope_is_exact_for_a_parabola_inside():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 10.0, 2000))
    assert slope(time, 3.0 * time - 1.0, 0.1) == pytest.approx(3.0, rel=1e-6)
    even = np.arange(0.0, 10.0, 0.01)
    np.testing.assert_allclose(slope(even, even**2, 0.11)[10:-10], 2.0 * even[10:-10], atol=1e-9)
