import csv
import json

import numpy as np
import pytest
from synthetic_rows import GPS, noisy_frame, noisy_rows, row, score
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.publishing import leaderboard, timings
from gripbench.bench.publishing.leaderboard import build, read, write
from gripbench.bench.publishing.timings import REFERENCE, read_timings, reference_kernel
from gripbench.bench.running.rows import frame_of
from gripbench.bench.running.store import Store
from gripbench.errors import InputError


def benchmark(name, times, steps, **info):
    return {"name": name, "extra_info": {"steps": steps, **info}, "stats": {"data": list(times)}}


def benchmark_file(path, speed=1.0, slower=1.0, rounds=50):
    """A file of pytest-benchmark from a machine of some speed; method `a` slower by a factor."""
    rng = np.random.default_rng(1)
    noise = rng.uniform(0.99, 1.01, (3, rounds)) * speed
    path.write_text(json.dumps({"benchmarks": [
        benchmark("test_batch_step[a]", noise[0] * 4e-3 * slower, 1000, label="a", form="batch"),
        benchmark(REFERENCE, noise[1] * 2e-3, 1000),
        benchmark("test_online_step[a]", noise[2] * 8e-3, 100, label="a", form="online"),
        {"name": "something_else", "stats": {"data": [1.0]}},
    ]}))  # fmt: skip
    return path


def test_runtimes_relate_to_the_kernel_of_the_same_run(tmp_path):
    fast = read_timings(benchmark_file(tmp_path / "fast.json"))["a"]
    slow = read_timings(benchmark_file(tmp_path / "slow.json", speed=7.0))["a"]
    assert fast["batch"].relative == pytest.approx(2.0, rel=0.01)
    assert fast["online"].relative == pytest.approx(40.0, rel=0.01)
    assert slow["batch"].relative == pytest.approx(fast["batch"].relative, rel=1e-9)
    assert slow["batch"].step == pytest.approx(7.0 * fast["batch"].step, rel=1e-9)
    assert fast["batch"].low < fast["batch"].relative < fast["batch"].high


def test_a_machine_that_is_busy_half_of_the_time_changes_little(tmp_path):
    path = benchmark_file(tmp_path / "b.json")
    content = json.loads(path.read_text())
    for index, time in enumerate(content["benchmarks"][0]["stats"]["data"]):
        content["benchmarks"][0]["stats"]["data"][index] = time * (5.0 if index % 2 else 1.0)
    calm = read_timings(path)["a"]["batch"].relative
    path.write_text(json.dumps(content))
    assert read_timings(path)["a"]["batch"].relative == pytest.approx(calm, rel=0.02)


def test_too_few_rounds_give_no_range(tmp_path):
    found = read_timings(benchmark_file(tmp_path / "few.json", rounds=3))["a"]["batch"]
    assert found.low is None
    assert found.high is None


def test_files_that_are_no_benchmarks_say_so(tmp_path):
    path = tmp_path / "x.json"
    for text, message in [
        ("{", "not a file of pytest-benchmark"),
        ("[1]", "not a file of pytest-benchmark"),
        ('{"benchmarks": []}', f"lacks the benchmark '{REFERENCE}'"),
        (json.dumps({"benchmarks": [{"name": REFERENCE}]}), "lacks its times or steps"),
    ]:
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_timings(path)
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_timings(tmp_path / "none.json")


def test_reference_kernel_is_what_it_says():
    angle, rate = 1.0, 0.0
    for _ in range(50):
        drag = 0.1 * rate * np.sqrt(1.0 + rate**2) / (1.0 + 0.5 * angle**2)
        rate += 1e-3 * (-9.81 * np.sin(angle) - drag + 0.5)
        angle += 1e-3 * rate
    assert reference_kernel(50) == pytest.approx(angle, rel=1e-12)


@pytest.fixture
def rows():
    rows = noisy_rows({"a": 1.0, "b:paper": 2.0}, seeds=6)
    rows += noisy_rows({"g": 0.5}, seeds=6, g={"sensors": GPS})
    return rows + [row("c", seed, None, scenario) for seed in range(6)
                   for scenario in ("step", "hill")]  # fmt: skip


def test_written_leaderboard_reads_back_and_is_the_same_bytes_again(rows, tmp_path):
    runtimes = read_timings(benchmark_file(tmp_path / "b.json"))
    for folder in ("one", "two"):
        frame = frame_of(rows if folder == "one" else rows[::-1])
        made, found = build(frame, runtimes)
        paths = write(tmp_path / folder, made, found)
    assert [path.name for path in paths] == [
        "leaderboard.md", "leaderboard.csv", "leaderboard.json",
    ]  # fmt: skip
    for path in paths:
        assert path.read_bytes() == (tmp_path / "one" / path.name).read_bytes()
    assert read(tmp_path / "one") == read(tmp_path / "two" / "leaderboard.json")
    again = read(tmp_path / "one")
    assert again.runtimes == runtimes
    assert again.runs == made.runs
    methods = [[line["label"] for line in board["methods"]] for board in again.boards]
    assert methods == [["a", "b:paper", "c"], *[["g", "a", "b:paper", "c"]] * 2]


def test_markdown_and_csv_hold_every_board_and_the_failures(rows, tmp_path):
    made, found = build(frame_of(rows), read_timings(benchmark_file(tmp_path / "b.json")))
    write(tmp_path, made, found)
    text = (tmp_path / "leaderboard.md").read_text()
    titles = [line for line in text.splitlines() if line.startswith("## ")]
    assert len(titles) == 3
    assert titles[2] == "## mu_front with any sensors"
    assert "GPS receiver" in titles[1]
    assert "GPS receiver" not in titles[0]
    assert "failed: ValueError: no" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert max(line.count("|") - 1 for line in tables) <= 9
    assert text.index("Which method for which road and sensors") < text.index(titles[0])
    with (tmp_path / "leaderboard.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["label"] for line in lines] == [
        "a", "b:paper", "c", "g", "a", "b:paper", "c", "g", "a", "b:paper", "c",
    ]  # fmt: skip
    assert float(lines[0]["relative_batch"]) == made.runtimes["a"]["batch"].relative
    assert lines[2]["score"] == ""
    assert lines[2]["failures"] == "12"


def test_damaged_and_newer_leaderboards_are_one_clear_error(rows, tmp_path):
    write(tmp_path, *build(frame_of(rows)))
    file = tmp_path / "leaderboard.json"
    content = json.loads(file.read_text())
    for text, message in [
        (file.read_text()[:500], "not valid JSON"),
        ("[]", "not a leaderboard"),
        (json.dumps(content | {"schema_version": 99}), "written by a newer gripbench"),
        (json.dumps(content | {"mistake": 1}), "mistake"),
    ]:
        file.write_text(text)
        with pytest.raises(InputError, match=message):
            read(tmp_path)
    with pytest.raises(InputError, match="'gripbench leaderboard' writes one"):
        read(tmp_path / "nowhere")


def test_stored_leaderboard_of_schema_version_1_still_loads():
    stored = {
        "schema_version": 1, "gripbench": "0.1.0", "confidence": 0.95, "boards": [],
        "runtimes": {"a": {"batch": {"relative": 2.0, "low": None, "high": 2.1, "step": 1e-8}}},
        "runs": [{"scenario": "s", "target": "mu", "label": "a", "seeds": [0],
                  "sums_of_squares": [1.0], "counts": [3], "failed": {"1": "timeout: 5 s"}}],
    }  # fmt: skip
    loaded = leaderboard.parse(leaderboard.Leaderboard, stored, "sample")
    assert loaded.runs[0].failed == {1: "timeout: 5 s"}
    assert loaded.runtimes["a"]["batch"] == timings.RelativeRuntime(relative=2, high=2.1, step=1e-8)


@pytest.fixture
def stored(rows, tmp_path):
    store = Store(tmp_path / "results")
    for item in rows:
        store.write(item)
    return tmp_path / "results"


def command(*arguments):
    return CliRunner().invoke(application(), [str(item) for item in arguments])


def test_command_builds_and_compares(stored, tmp_path):
    built = command("leaderboard", "--results", stored, "--out", tmp_path / "base")
    assert built.exit_code == 0, built.output
    same = command("leaderboard", "--results", stored, "--compare", tmp_path / "base")
    assert same.exit_code == 0, same.output
    assert "No change." in same.output
    store = Store(stored)
    for item in noisy_rows({"a": 1.2}, seeds=6):
        store.write(item)
    worse = command("leaderboard", "--results", stored, "--compare", tmp_path / "base",
                    "--report", tmp_path / "report.md")  # fmt: skip
    assert worse.exit_code == 1
    report = (tmp_path / "report.md").read_text()
    assert report.startswith("Regressions: 2;")
    assert "| worse | a | mu_front | hill | 1.2000 |" in report


def test_command_compares_with_the_leaderboard_it_replaces(stored):
    assert command("leaderboard", "--results", stored).exit_code == 0
    for item in noisy_rows({"a": 1.2}, seeds=6):
        Store(stored).write(item)
    arguments = ("leaderboard", "--results", stored, "--compare", stored)
    assert command(*arguments).exit_code == 1
    assert command(*arguments).exit_code == 0


def test_rank_command_prints_boards_and_wins(stored):
    shown = command("rank", "--results", stored, "--wide", "--wins", "--target", "mu_front")
    assert shown.exit_code == 0, shown.output
    assert "mu_front with GPS receiver, accelerometer" in shown.output
    assert "wins in 12 runs" in shown.output
    lines = command("rank", "--results", stored, "--sensors", "any", "--format", "csv").output
    table = list(csv.DictReader(lines.splitlines()))
    assert [line["Rank"] for line in table] == ["1", "2", "3", "4"]
    assert {line["Target"] for line in table} == {"mu_front"}


def test_commands_rank_by_the_targets_of_the_suites_unless_told_otherwise(tmp_path):
    store = Store(tmp_path)
    for target in ("mu_front", "roll"):
        for label in ("a", "b"):
            for seed in (0, 1):
                item = row(label, seed, 1.0 + seed, target=target)
                path = tmp_path / target
                Store(path).write(item)
                both = {name: score(1.0 + seed) for name in ("mu_front", "roll")}
                store.write(item.model_copy(update={"scores": both, "targets": tuple(both)}))
    for folder, options, shown in [
        (tmp_path, (), {"mu_front"}),
        (tmp_path, ("--target", "roll"), {"roll"}),
        (tmp_path / "roll", (), {"roll"}),  # no suite names it, but there is nothing else
    ]:
        assert command("leaderboard", "--results", folder, *options).exit_code == 0
        made = read(folder)
        assert {board["target"] for board in made.boards} == shown
        assert {runs.target for runs in made.runs} == shown
        output = command("rank", "--results", folder, *options).output
        assert {name for name in ("mu_front", "roll") if f"{name} with" in output} == shown
    failed = command("leaderboard", "--results", tmp_path, "--target", "rol")
    assert "did you mean 'roll'" in str(failed.exception)


def test_commands_without_rows_say_what_to_do(tmp_path):
    for name in ("rank", "leaderboard"):
        failed = command(name, "--results", tmp_path)
        assert isinstance(failed.exception, InputError)
        assert "'gripbench run' makes them" in str(failed.exception)


def test_idealised_methods_are_marked():
    frame = noisy_frame({"a": 1.0}, seeds=2, a={"idealised": ("speed_x_rate",)})
    text = leaderboard.text_of(*build(frame))
    assert "a†" in text
    assert "† reads an idealised channel" in text
