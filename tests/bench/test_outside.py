"""Drives out, estimates back: nothing tells which drive is which, and every mistake is one line."""

import shutil
import subprocess
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyarrow import csv
from scipy.io import savemat
from typer.testing import CliRunner

import gripbench
from gripbench.bench.command_line import application
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.publishing.tables import plain
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.exporting import drive_name, export_suite, new_secret, read_records
from gripbench.bench.running.rows import Row, row_from
from gripbench.bench.running.submissions import submit
from gripbench.configuration import CONFIGS
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

EXAMPLES = Path(__file__).parents[2] / "examples"
PYTHON_TWIN = """
class SmoothedForce:
    name = "smoothed_force"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)

    def reset(self, vehicle, dt):
        self.mass, self.smooth, self.before = vehicle["mass"], 0.0, 0.0

    def update(self, obs):
        elapsed = obs["time"] - self.before
        self.before = obs["time"]
        self.smooth += elapsed / (0.05 + elapsed) * (obs["accel_x"] - self.smooth)
        return {"force_x_front": 0.5 * self.mass * self.smooth}
"""


def _scenario(folder, name, of):
    text = (CONFIGS / "scenarios" / f"{of}.toml").read_text(encoding="utf-8")
    lines = [
        f'name = "{name}"' if line.startswith("name =")
        else "horizon = 1.0" if line.startswith("horizon =")
        else line
        for line in text.splitlines()
    ]  # fmt: skip
    path = folder / f"{name}.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A suite of two scenarios of a second with two seeds each."""
    folder = tmp_path_factory.mktemp("suite")
    paths = [_scenario(folder, name, "constant_mu") for name in ("one", "two")]
    path = folder / "pair.toml"
    path.write_text(
        'name = "pair"\ndescription = "Two."\nmethods = ["slip_slope"]\nseeds = 2\n'
        f"scenarios = {[str(item) for item in paths]}\ntargets = ['force_x_front']\n"
    )
    return path


@pytest.fixture(scope="module")
def export(suite, tmp_path_factory):
    """The drives of the suite, and the results folder that knows them, as they were written."""
    folder = tmp_path_factory.mktemp("export")
    assert export_suite(str(suite), None, folder / "drives", folder / "results") == 4
    return folder


@pytest.fixture
def exported(export, tmp_path):
    """A copy of `export`."""
    shutil.copytree(export, tmp_path, dirs_exist_ok=True)
    return tmp_path / "drives", tmp_path / "results"


def _read(path):
    return csv.read_csv(path).to_pandas()


def _folders(drives):
    return sorted(path for path in drives.iterdir() if path.is_dir())


def _estimates(folder):
    seen = _read(folder / "observations.csv")
    force = 0.5 * 1298.9 * seen["accel_x"]
    return pd.DataFrame({"time": seen["time"], "force_x_front": force})


def _fill(drives):
    for folder in _folders(drives):
        _estimates(folder).to_csv(folder / "estimates.csv", index=False)


def test_an_export_holds_every_observation_to_the_bit_and_no_truth(exported, suite):
    drives, results = exported
    (kept,) = read_records(results)
    for name, drive in kept.drives.items():
        recording = record(load_scenario(drive.scenario), drive.seed)
        seen = _read(drives / name / "observations.csv")
        assert tuple(seen.columns) == recording.observations.dtype.names
        for column in seen:
            assert np.array_equal(seen[column], recording.observations[column], equal_nan=True)
        paper = _read(drives / name / "vehicle.csv")
        assert dict(paper.to_numpy().tolist()) == dict(recording.vehicle)


def test_nothing_that_is_written_names_a_scenario_or_seed(exported):
    drives, results = exported
    (kept,) = read_records(results)
    names = {"one", "two"}
    for path in drives.rglob("*"):
        assert not names & set(path.stem.split("_"))
        if path.suffix == ".md":
            words = set(path.read_text(encoding="utf-8").replace(".", " ").split())
            assert not words & {"one.toml", "seed", "two"}
            assert kept.secret not in words
    times = [(path / "observations.csv").stat().st_mtime_ns for path in _folders(drives)]
    assert times == sorted(times)  # written in the order of the names, which the secret makes


def test_names_and_order_are_another_draw_with_every_secret():
    cells = list(product(("one", "two", "three"), range(5)))
    orders = set()
    for _ in range(20):
        secret = new_secret()
        names = [drive_name(secret, *cell) for cell in cells]
        assert len(set(names)) == len(cells)
        orders.add(tuple(np.argsort(names)))
    assert len(orders) == 20
    first = [order[0] for order in orders]
    assert len(set(first)) > 5


def test_estimates_become_rows_like_those_of_the_same_method_run_here(exported, suite, tmp_path):
    drives, results = exported
    for folder in _folders(drives):
        seen = _estimates(folder)
        seen.to_csv(folder / "estimates.csv", index=False)
    rows = submit(drives, "elsewhere", ["accel_x"], results)
    assert [(row.scenario, row.seed, row.status) for row in rows] == [
        (name, seed, "ok") for name in ("one", "two") for seed in (0, 1)
    ]
    file = tmp_path / "twin.py"
    file.write_text(
        "class Twin:\n"
        "    name = 'twin'\n    sensors = ('accel_x',)\n    estimates = ('force_x_front',)\n"
        "    def reset(self, vehicle, dt):\n        pass\n"
        "    def update(self, obs):\n"
        "        return {'force_x_front': 0.5 * 1298.9 * obs['accel_x']}\n"
    )
    here = gripbench.run(suite=str(suite), methods=[str(file)], results=results, workers=1)
    all_rows = gripbench.read_rows(results)
    pair = {name: part.set_index(["scenario", "seed"]) for name, part in all_rows.groupby("label")}
    assert pair["twin"]["rms"].equals(pair["elsewhere"]["rms"])
    assert pair["elsewhere"]["computed_outside"].all()
    assert not here["computed_outside"].any()
    assert pair["elsewhere"]["step_batch"].isna().all()
    (board,) = boards(all_rows, "force_x_front", "any")
    text = plain(board_table(board))
    assert "elsewhere‡" in text
    assert "twin‡" not in text
    assert "computed outside: neither causality nor runtime checked" in text


@pytest.mark.parametrize("kind", ["parquet", "mat"])
def test_other_formats_give_the_same_scores(suite, tmp_path, kind):
    results, drives = tmp_path / "results", tmp_path / "drives"
    export_suite(str(suite), range(1), drives, results, kind)
    for folder in _folders(drives):
        assert (folder / f"observations.{kind}").is_file()
        if kind == "parquet":
            seen = pd.read_parquet(folder / "observations.parquet")
            frame = pd.DataFrame({"time": seen["time"], "force_x_front": seen["accel_x"]})
            frame.to_parquet(folder / "estimates.parquet")
        else:
            from scipy.io import loadmat

            seen = loadmat(folder / "observations.mat")
            assert float(seen["vehicle"]["mass"][0, 0].item()) == 1298.9
            savemat(
                folder / "estimates.mat", {"time": seen["time"], "force_x_front": seen["accel_x"]}
            )
    (one, two) = submit(drives, "elsewhere", ["accel_x"], results)
    truth = record(load_scenario(str(suite.parent / "one.toml")), 0)
    inside = truth.truth["time"] >= truth.score_from
    error = (truth.observations["accel_x"] - truth.truth["force_x_front"])[inside]
    assert one.scores["force_x_front"]["rms"].value == pytest.approx(np.sqrt(np.mean(error**2)))
    assert two.status == "ok"


def test_variances_are_scored_and_a_nan_is_a_diverged_row(exported):
    drives, results = exported
    for k, folder in enumerate(_folders(drives)):
        frame = _estimates(folder)
        frame["force_x_front_variance"] = 1e4
        if not k:
            frame.loc[700, "force_x_front"] = np.nan
        frame.to_csv(folder / "estimates.csv", index=False, na_rep="NaN")
    rows = submit(drives, "elsewhere", ["accel_x"], results)
    assert sorted(row.status for row in rows) == ["diverged", "ok", "ok", "ok"]
    assert all("mean_nees" in row.scores["force_x_front"] for row in rows if row.status == "ok")
    assert "force_x_front is nan from t = 0.7 s" in {row.reason for row in rows}


def test_quantiles_and_innovations_are_scored_and_what_cannot_be_is_refused(exported):
    drives, results = exported
    for folder in _folders(drives):
        frame = _estimates(folder)
        for level, offset in (("05", -500.0), ("50", 0.0), ("95", 500.0)):
            frame[f"force_x_front_q{level}"] = frame["force_x_front"] + offset
        frame["accel_x_innovation"] = np.arange(len(frame))
        frame["accel_x_innovation_variance"] = 1.0
        frame.to_csv(folder / "estimates.csv", index=False)
    rows = submit(drives, "elsewhere", ["accel_x"], results)
    for row in rows:
        assert row.scores["force_x_front"]["sharpness"].value == pytest.approx(1000.0)
        assert {"crps", "coverage_90", "mean_nees", "mean_nis"} <= set(row.scores["force_x_front"])
    first, *others = sorted(_folders(drives))
    last = first / "estimates.csv"
    whole = pd.read_csv(last)
    for change, message in (
        ({"force_x_front_q95": -1e9}, "force_x_front_q50 is above force_x_front_q95 at t = 0 s"),
        ({"force_x_front_variance": -1.0}, "which has a variance: state one of the two"),
        ({"mu_q50": 1.0}, r"column 'mu_q50' \(Quantile of mu, level .50\) stands without"),
    ):
        whole.assign(**change).to_csv(last, index=False)
        with pytest.raises(InputError, match=message):
            submit(drives, "again", ["accel_x"], results)
    whole[["time", "force_x_front"]].assign(force_x_front_variance=-1.0).to_csv(last, index=False)
    for folder in others:
        frame = pd.read_csv(folder / "estimates.csv")[["time", "force_x_front"]]
        frame.assign(force_x_front_variance=1.0).to_csv(folder / "estimates.csv", index=False)
    with pytest.raises(InputError, match=r"estimates.csv: force_x_front_variance is -1 at t = 0 s"):
        submit(drives, "again", ["accel_x"], results)
    assert "again" not in set(gripbench.read_rows(results)["label"])


def test_a_drive_without_the_channels_needs_no_estimates_and_is_skipped(suite, tmp_path):
    folder = tmp_path / "mixed"
    folder.mkdir()
    (folder / "one.toml").write_text((suite.parent / "one.toml").read_text())
    other = CONFIGS / "scenarios" / "mu_jump_lane_change.toml"
    mixed = folder / "mixed.toml"
    mixed.write_text(
        'name = "mixed"\ndescription = "Two."\nmethods = ["slip_slope"]\nseeds = 1\n'
        f"scenarios = ['{folder / 'one.toml'}', '{other}']\n"
    )
    drives, results = tmp_path / "drives", tmp_path / "results"
    export_suite(str(mixed), None, drives, results)
    (longitudinal, lateral) = sorted(
        _folders(drives), key=lambda place: "yaw_rate" in (place / "README.md").read_text()
    )
    seen = _read(lateral / "observations.csv")
    frame = pd.DataFrame({"time": seen["time"], "sideslip": 0.0 * seen["yaw_rate"]})
    frame.to_csv(lateral / "estimates.csv", index=False)
    rows = submit(drives, "elsewhere", ["yaw_rate"], results)
    assert {row.scenario: row.status for row in rows} == {
        "one": "skipped",
        "mu_jump_lane_change": "ok",
    }
    assert not (longitudinal / "estimates.csv").exists()


def _spoil_missing(folder):
    (folder / "estimates.csv").unlink()


def _spoil(change):
    def spoil(folder):
        path = folder / "estimates.csv"
        path.write_text(change(path.read_text()))

    return spoil


def _spoil_twice(folder):
    savemat(folder / "estimates.mat", {"time": [0.0]})


SPOILT = {
    "missing": (_spoil_missing, "holds no file 'estimates'"),
    "twice": (_spoil_twice, "leave one of them"),
    "short": (_spoil(lambda text: text[: len(text) // 2].rpartition("\n")[0] + "\n"), "samples"),
    "word": (_spoil(lambda text: text.replace("\n0.001,", "\n0.001,x", 1)), "cannot be read"),
    "ragged": (_spoil(lambda text: text.replace("\n0.002,", "\n", 1)), "cannot be read"),
    "column": (_spoil(lambda text: text.replace("force_x_front", "force_front", 1)), "did you"),
    "no time": (_spoil(lambda text: text.replace("time", "yaw", 1)), "no column 'time'"),
    "drift": (_spoil(lambda text: text.replace("\n0.5,", "\n0.6,", 1)), "sample 501"),
    "again": (_spoil(lambda text: text.replace("time,", "time,time,", 1)), ""),
    "empty": (_spoil(lambda text: ""), "cannot be read"),
    "binary": (_spoil(lambda text: "\0\1\2"), "estimates.csv"),
}


@pytest.mark.parametrize("what", SPOILT)
def test_a_mistake_is_one_line_and_stores_nothing(exported, what):
    drives, results = exported
    _fill(drives)
    spoil, words = SPOILT[what]
    spoil(_folders(drives)[-1])
    with pytest.raises(InputError) as error:
        submit(drives, "elsewhere", ["accel_x"], results)
    text = str(error.value)
    assert words in text
    assert "\n" not in text
    assert _folders(drives)[-1].name in text
    assert not (results / "rows").exists()


@pytest.mark.parametrize(
    ("name", "reads", "words"),
    [
        ("slip_slope", ["accel_x"], "known here"),
        ("My Observer", ["accel_x"], "lower case"),
        ("elsewhere", ["acel_x"], "did you mean 'accel_x'?"),
        ("elsewhere", ["time"], "time"),
        ("elsewhere", ["wheel_acceleration_front", "yaw_rate"], "no drive gives all of"),
    ],
)
def test_names_that_do_not_fit_are_one_line(exported, name, reads, words):
    drives, results = exported
    _fill(drives)
    with pytest.raises(InputError, match=words.replace("?", r"\?")):
        submit(drives, name, reads, results)
    assert not (results / "rows").exists()


def test_drives_of_nobody_of_part_or_of_another_state_are_refused(exported, tmp_path, suite):
    drives, results = exported
    _fill(drives)
    with pytest.raises(InputError, match="give the --results"):
        submit(drives, "elsewhere", ["accel_x"], tmp_path / "other")
    with pytest.raises(InputError, match="no such folder"):
        submit(tmp_path / "nothing", "elsewhere", ["accel_x"], results)
    with pytest.raises(InputError, match="not an empty folder"):
        export_suite(str(suite), None, drives, results)
    (path,) = (results / "exports").glob("*.json")
    before = path.read_text()
    path.write_text(before.replace('"world": "', '"world": "0', 1))
    with pytest.raises(InputError, match="export again"):
        submit(drives, "elsewhere", ["accel_x"], results)
    path.write_text(before)
    shutil.rmtree(_folders(drives)[0])
    with pytest.raises(InputError, match="1 of 4 drives are missing"):
        submit(drives, "elsewhere", ["accel_x"], results)


def test_commands_say_what_they_wrote(suite, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runner = CliRunner()
    answer = runner.invoke(application(), ["export", str(suite), "--seeds", "1", "--to", "out"])
    assert answer.exit_code == 0
    assert "wrote 2 drives to out" in answer.stdout
    _fill(tmp_path / "out")
    answer = runner.invoke(
        application(), ["submit", "out", "--name", "elsewhere", "--reads", "accel_x"]
    )
    assert answer.exit_code == 0, answer.output
    assert "elsewhere‡" in answer.stdout
    assert "2 rows of elsewhere" in answer.stdout


def test_a_row_of_before_was_not_computed_outside(exported):
    drives, results = exported
    _fill(drives)
    content = submit(drives, "elsewhere", ["accel_x"], results)[0].model_dump(mode="json")
    assert row_from(content, "here").computed_outside
    del content["computed_outside"]
    old = row_from({**content, "schema_version": 4}, "here")
    assert isinstance(old, Row)
    assert not old.computed_outside


def _twin(suite, results, tmp_path):
    file = tmp_path / "smoothed_force.py"
    file.write_text(PYTHON_TWIN)
    frame = gripbench.run(suite=str(suite), methods=[str(file)], results=results, workers=1)
    return frame[frame["label"] == "smoothed_force"].set_index(["scenario", "seed"])["rms"]


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_the_example_in_cpp_scores_as_its_twin_in_python(exported, suite, tmp_path):
    drives, results = exported
    source = EXAMPLES / "cpp" / "smoothed_force.cpp"
    program = tmp_path / "smoothed_force"
    subprocess.run(["g++", "-std=c++17", source, "-o", program], check=True)
    subprocess.run([program, drives], check=True)
    submit(drives, "smoothed_force_cpp", ["accel_x"], results)
    rows = gripbench.read_rows(results, labels=("smoothed_force_cpp",))
    rms = rows.set_index(["scenario", "seed"])["rms"]
    np.testing.assert_allclose(rms, _twin(suite, results, tmp_path).loc[rms.index], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_the_example_in_octave_scores_as_its_twin_in_python(exported, suite, tmp_path):
    drives, results = exported
    source = EXAMPLES / "matlab" / "smoothed_force.m"
    subprocess.run(["octave-cli", source, drives], check=True)
    submit(drives, "smoothed_force_m", ["accel_x"], results)
    rows = gripbench.read_rows(results, labels=("smoothed_force_m",))
    rms = rows.set_index(["scenario", "seed"])["rms"]
    np.testing.assert_allclose(rms, _twin(suite, results, tmp_path).loc[rms.index], rtol=1e-12)
