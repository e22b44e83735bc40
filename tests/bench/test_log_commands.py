"""The commands for logs, as a user calls them."""

import tomllib

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.errors import InputError
from gripbench.logs.storing import load


def _run(*arguments):
    result = CliRunner().invoke(application(), [str(argument) for argument in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture
def log(tmp_path):
    time = np.arange(0.0, 5.0, 0.01)
    path = tmp_path / "drive.csv"
    pd.DataFrame(
        {"t_s": time, "gyro_down": -np.sin(time), "acc_right_g": -0.1 * np.sin(time)}
    ).to_csv(path, index=False)
    return path


def test_inspect_then_import_with_the_proposed_map(log, tmp_path):
    proposal = _run("import", log, "--inspect").stdout
    assert tomllib.loads(proposal)["channels"]["yaw_rate"]["sign"] == -1
    (tmp_path / "map.toml").write_text(proposal)
    result = _run("import", log, "--map", tmp_path / "map.toml", "--out", tmp_path / "kept")
    assert result.exit_code == 0
    assert "500 rows over 4.990 s, 2 channels" in result.stdout
    recording = load(tmp_path / "kept" / "drive").recordings[0]
    np.testing.assert_allclose(recording.observations["yaw_rate"], np.sin(np.arange(500) * 0.01))


def test_import_without_a_map_says_what_to_do(log):
    with pytest.raises(InputError, match=r"--map.*--inspect"):
        _run("import", log)


def test_nothing_is_written_when_the_map_is_wrong(log, tmp_path):
    text = 'name = "x"\n[time]\ncolumn = "t"\n[channels.yaw_rate]\ncolumn = "g"\nunit = "rad/s"\n'
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(InputError, match=r"drive\.csv"):
        _run("import", log, "--map", tmp_path / "map.toml", "--out", tmp_path / "kept")
    assert not (tmp_path / "kept").exists()


def test_data_path(tmp_path, monkeypatch):
    monkeypatch.setenv("GRIPBENCH_DATA", str(tmp_path))
    assert _run("data", "path").stdout.strip() == str(tmp_path)
    missing = tmp_path / "none"
    assert "no such folder" in _run("data", "path", "--folder", missing).stdout


def test_recordings_without_data_say_where_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setenv("GRIPBENCH_DATA", "")  # --data sets it
    monkeypatch.chdir(tmp_path)
    result = _run("recordings", "f1tenth_optitrack", "--data", tmp_path)
    assert result.exit_code == 0
    assert "get it from" in result.output


def test_own_log_from_import_to_scores(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = _run("import", log, "--inspect").stdout
    text += '\n[reference.sideslip]\ncolumn = "acc_right_g"\nunit = "deg"\n'
    (tmp_path / "map.toml").write_text(text)
    _run("import", log, "--map", tmp_path / "map.toml", "--out", tmp_path / "kept")
    methods = ("--method", "kinematic_kalman_filter", "--method", "zero_sideslip")
    result = _run("recordings", tmp_path / "kept" / "drive", *methods, "--workers", 1)
    assert "zero_sideslip" in result.output
    assert "no sensor for 'course'" in result.output
