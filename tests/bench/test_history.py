import math
import subprocess

import pytest
from synthetic_rows import GPS, noisy_rows, row
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.publishing import history, tables
from gripbench.bench.publishing.history import Commit, HistoryRow
from gripbench.bench.publishing.leaderboard import build, write
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.running.rows import frame_of
from gripbench.errors import InputError

RUNTIMES = {"a": {"batch": RelativeRuntime(relative=1.5, step=1e-8)}}


def made(factor=1.0, **more):
    rows = noisy_rows({"a": factor, "b": 2.0}, seeds=3, spread=0.0, **more)
    rows += noisy_rows({"g": 0.5}, seeds=3, g={"sensors": GPS})
    rows += [row("c", seed, None, scenario) for seed in range(3) for scenario in ("step", "hill")]
    return build(frame_of(rows), RUNTIMES)


def commit(number):
    return Commit(name=f"{number:040x}", time=f"2026-01-0{number}T12:00:00+01:00")


def test_one_line_a_commit_and_method(tmp_path):
    path = tmp_path / history.FILE
    for number in (2, 1):
        leaderboard, _ = made(factor=number)
        assert len(history.history_of(leaderboard, commit(number))) == 4
        history.add(path, history.history_of(leaderboard, commit(number)))
    assert len(path.read_text().splitlines()) == 8
    frame = history.frame_of(history.read_rows(path))
    assert list(frame["label"]) == ["a", "b", "c", "g"] * 2
    assert list(frame["commit"].unique()) == [commit(1).name, commit(2).name]
    of_a = frame[frame["label"] == "a"]
    assert of_a["geometric_rms"].iloc[1] / of_a["geometric_rms"].iloc[0] == pytest.approx(2.0)
    assert list(of_a["relative_runtime"]) == [1.5, 1.5]
    assert frame[frame["label"] != "a"]["relative_runtime"].isna().all()


def test_figures_are_those_of_the_runs():
    leaderboard, boards = made()
    rows = {item.label: item.targets["mu_front"] for item in history.history_of(
        leaderboard, commit(1))}  # fmt: skip
    by_scenario = [
        math.sqrt(sum(runs.sums_of_squares) / sum(runs.counts))
        for runs in leaderboard.runs
        if runs.label == "a"
    ]
    assert rows["a"].geometric_rms == pytest.approx(math.sqrt(math.prod(by_scenario)), rel=1e-12)
    line = boards[0].lines.set_index("label").loc["a"]
    assert rows["a"].rms == line["rms"]
    assert rows["a"].rms_from is None  # too few runs for an interval
    assert math.isnan(line["rms_from"])
    # ranks are those of the board with just what the method reads
    assert (rows["a"].rank, rows["a"].methods) == (1, 3)
    assert (rows["g"].rank, rows["g"].methods) == (1, 4)
    assert rows["c"].failures == 6
    assert rows["c"].rms is None
    assert rows["c"].geometric_rms is None


def test_adding_a_commit_again_replaces_it(tmp_path):
    path = tmp_path / history.FILE
    for factor in (1.0, 3.0):
        total = history.add(path, history.history_of(made(factor)[0], commit(1)))
    assert total == 4
    frame = history.frame_of(history.read_rows(path))
    assert frame.set_index("label").loc["a", "rank"] == 2


def test_damaged_lines_are_named(tmp_path):
    path = tmp_path / "history.jsonl"
    history.add(path, history.history_of(made()[0], commit(1)))
    good = path.read_text()
    for tail, message in [("{", "line 5: not valid JSON"), ("[]", "line 5: not a line"),
                          ('{"commit": "x"}', "line 5")]:  # fmt: skip
        path.write_text(good + tail + "\n")
        with pytest.raises(InputError, match=message):
            history.read_rows(path)
    with pytest.raises(InputError, match="not ISO 8601"):
        history.history_of(made()[0], Commit(name="x", time="yesterday"))


def test_stored_line_still_loads():
    line = {
        "commit": "abc", "time": "2026-01-01T00:00:00+00:00", "modified": False,
        "gripbench": "0.1.0", "label": "a", "relative_runtime": None,
        "targets": {"mu": {"geometric_rms": 0.1, "rms": 0.2, "rms_from": None, "rms_to": None,
                           "rank": 1, "rank_from": 1, "rank_to": 2, "methods": 2, "failures": 0}},
    }  # fmt: skip
    assert HistoryRow.model_validate(line).model_dump() == line


def test_picture_has_a_panel_for_each_target_and_the_runtime():
    rows = history.history_of(made()[0], commit(1)) + history.history_of(made(2.0)[0], commit(2))
    figure = history.plot(history.frame_of(rows))
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "RMS of mu_front", "step [reference kernels]",
    ]  # fmt: skip
    drawn = {line.get_label(): line for line in figure.axes[0].lines}
    low, high = drawn["a"].get_ydata()
    assert high / low == pytest.approx(2.0)
    assert len({(line.get_color(), line.get_marker()) for line in drawn.values()}) == 4
    with pytest.raises(InputError, match="history is empty"):
        history.plot(history.frame_of([]))


@pytest.fixture
def repository(tmp_path, monkeypatch):
    write(tmp_path / "results", *made())
    monkeypatch.chdir(tmp_path)
    for arguments in (
        ("init", "-q"),
        ("add", "-A"),
        ("-c", "user.name=n", "-c", "user.email=e", "commit", "-q", "-m", "first"),
    ):
        subprocess.run(["git", *arguments], check=True)
    return tmp_path


def command(*arguments):
    return CliRunner().invoke(application(), [str(item) for item in arguments])


def test_commands_add_show_and_plot(repository):
    added = command("history", "add")
    assert added.exit_code == 0, added.output
    head = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True).stdout
    assert f"4 lines of {head[:8]}, 4 in all" in added.output
    frame = history.frame_of(history.read_rows(repository / "results" / history.FILE))
    assert set(frame["commit"]) == {head.strip()}
    assert not frame["modified"].any()
    assert command("history", "plot", "picture.png").exit_code == 0
    assert (repository / "picture.png").read_bytes().startswith(b"\x89PNG")
    shown = command("history", "show", "--method", "a", "--format", "markdown")
    assert "| mu_front | a |" in shown.output
    assert f"| {head[:8]} |" in shown.output
    (repository / "results" / "leaderboard.md").write_text("changed")
    assert command("history", "add").exit_code == 0
    assert history.read_rows(repository / "results" / history.FILE)[0].modified
    assert f"{head[:8]}+" in command("history", "show").output


def test_commands_name_what_is_wrong(repository, tmp_path_factory, monkeypatch):
    for arguments, message in [
        (("plot", "x.jpeg"), "cannot draw '.jpeg'"),
        (("plot", "x.png"), "history is empty"),
        (("show", "--target", "mu"), "unknown target in the history 'mu'"),
        (("add", "--commit", "x"), "--commit and --time go together"),
    ]:
        failed = command("history", *arguments)
        assert isinstance(failed.exception, InputError), failed.output
        assert message in str(failed.exception)
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    failed = command("history", "add", "--leaderboard", repository / "results")
    assert "give --commit and --time" in str(failed.exception)


def test_empty_history_is_an_empty_table():
    assert tables.csv(history.table_of(history.frame_of([]))).count("\n") == 1
