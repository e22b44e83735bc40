"""One file a kind of plug-in in `kinds`, each with the row, or the one line, that it must give."""

from pathlib import Path

import psutil
import pytest

import gripbench
from gripbench.bench.catalogue.check import check_estimator, failures
from gripbench.bench.catalogue.registry import choose_method
from gripbench.errors import InputError

KINDS = Path(__file__).parent / "kinds"

ROWS = {
    "sound": ("ok", ""),
    "raises": ("failed", "ValueError: no luck (in update, raises.py:"),
    "raises_unprintable": ("failed", "Unprintable: its message cannot be read"),
    "raises_surrogate": ("failed", "OSError: file \\udc80"),
    "raises_endless": ("failed", "ValueError: xxx"),
    "exits_hard": ("failed", "its process exited with code 0"),
    "exits_soft": ("failed", "SystemExit: 0 (in update"),
    "crashes": ("failed", "its process was killed by SIGSEGV"),
    "aborts": ("failed", "its process was killed by SIGABRT"),
    "kills_itself": ("failed", "its process was killed by SIGKILL"),
    "kills_parent": ("failed", "its process was killed by SIGUSR1"),
    "hoards": ("failed", "out of memory (limit 300 MiB)"),
    "recurses": ("failed", "RecursionError"),
    "nan": ("diverged", "mu_front is nan from t = 0.099 s"),
    "infinite": ("diverged", "mu_front is inf from t = 0.099 s"),
    "too_large": ("diverged", "mu_front is too large"),
    "text": ("failed", "the estimate 'mu_front' is str; return a number"),
    "octets": ("failed", "the estimate 'mu_front' is bytes; return a number"),
    "boolean": ("failed", "the estimate 'mu_front' is bool; return a number"),
    "nothing": ("ok", ""),
    "complex_number": ("failed", "the estimate 'mu_front' is complex; return a number"),
    "date": ("failed", "the estimate 'mu_front' is datetime64; return a number"),
    "masked": ("failed", "the estimate 'mu_front' is masked"),
    "array": ("failed", "the estimate 'mu_front' is ndarray of shape (1,); return a number"),
    "decimal_number": ("failed", "the estimate 'mu_front' is Decimal; return a number"),
    "huge_integer": ("failed", "the estimate 'mu_front' is too large for a float"),
    "numpy_scalar": ("ok", ""),
    "integer": ("ok", ""),
    "no_mapping": ("failed", "update returned float; return a dict with mu_front"),
    "returns_nothing": ("ok", ""),
    "misnames": ("failed", "the estimate 'mu_front' is declared but update does not return it"),
    "adds": ("failed", "update returns the estimate 'mu_rear'"),
    "peeks": ("failed", "peeks reads the channel 'speed_gps', which is not among its sensors"),
    "demands": ("skipped", "the vehicle does not give the parameter 'yaw_inertia_of_nothing'"),
    "forks": ("failed", ""),
    "forks_and_leaves": ("ok", ""),
    "starts_process": ("ok", ""),
    "writes_to_pipes": ("failed", ""),
    "prints": ("ok", ""),
    "closes_everything": ("failed", ""),
    "unpickles_in_parent": ("failed", "the estimate 'mu_front' is Trap; return a number"),
    "state_in_class": ("ok", ""),
    "state_in_module": ("ok", ""),
    "state_in_shared_memory": ("ok", ""),
    "state_in_pipe": ("ok", ""),
    "state_in_parent_memory": ("ok", ""),
    "draws": ("ok", ""),
    "knows_seed": ("ok", ""),
    "looks_ahead": ("ok", ""),
    "reads_parent_memory": ("ok", ""),
    "reads_environment": ("ok", ""),
    "simulates": ("ok", ""),
    "seeks_secret": ("ok", ""),
    "memorises": ("failed", "PermissionError: [Errno 13] Permission denied"),
    "state_in_file": ("ok", ""),
    "state_in_system_v": ("ok", ""),
    "state_in_attribute": ("ok", ""),
    "hangs_at_exit": ("ok", ""),
    "replaces_exit": ("ok", ""),
    "hangs_in_del": ("ok", ""),
    "ignores_signals": ("ok", ""),
    "reads_out_of_bounds": ("ok", ""),
    "batch_looks_ahead": ("ok", ""),
    "batch_of_texts": ("ok", ""),
    "batch_masked": ("ok", ""),
    "batch_exits": ("ok", ""),
    "starts_threads": ("ok", ""),
}
"""Status and beginning of the reason of each in a run."""

SLEEPERS = ("hangs", "hangs_in_reset", "sleeps", "ignores_signals_and_hangs")

REFUSED = {
    "declares_twice": "'sensors' names 'accel_x' twice",
    "declares_time": "'sensors' names 'time', which every sample carries anyway",
    "declares_unknown": "did you mean 'accel_x'",
    "declares_numbers": "set the class attribute 'sensors' to a tuple of signal names",
    "con": "is a name that an operating system keeps for itself",
    "long_name": "has 101 characters; at most 100 are allowed",
    "declares_no_update": "name the class",
    "exits_at_import": "its process exited with code 7",
    "raises_at_import": "cannot be imported: RuntimeError: not today",
}

CHECKS = {
    "exits_hard": ("reads_only_its_channels", "its process exited with code 0"),
    "exits_soft": ("reads_only_its_channels", "SystemExit: 0"),
    "crashes": ("reads_only_its_channels", "its process was killed by SIGSEGV"),
    "text": ("reads_only_its_channels", "is str; return a number"),
    "nan": ("finite_on_every_scenario", "mu_front is nan at t = 0.099 s"),
    "state_in_class": ("reset_equals_fresh", "after reset its estimates differ"),
    "batch_looks_ahead": ("causal", "estimates change when later samples are cut off"),
    "batch_of_texts": ("reads_only_its_channels", "is not of type float64"),
    "batch_masked": ("reads_only_its_channels", "masked"),
    "batch_exits": ("reads_only_its_channels", "its process exited with code 0"),
    "reads_out_of_bounds": ("reads_within_bounds", "IndexError"),
    "exits_at_import": ("declares_its_channels", "its process exited with code 7"),
    "declares_twice": ("declares_its_channels", "twice"),
}


def test_every_kind_is_in_a_table():
    known = {*ROWS, *SLEEPERS, *REFUSED}
    assert {path.stem for path in KINDS.glob("*.py")} == known
    assert len(known) > 40


def _run(names, results, seeds=1, **options):
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
    methods = [str(KINDS / f"{name}.py") for name in names]
    options = {"workers": 1, "memory_limit": 300, **options}
    rows = gripbench.run(
        scenarios=[scenario], methods=methods, seeds=seeds, results=results, **options
    )
    return rows.drop_duplicates(["method", "seed"]).set_index(["method", "seed"])


FAST = ("sound", "exits_hard", "text", "forks", "knows_seed", "looks_ahead", "state_in_class")


def _wrong(rows, names):
    return {
        name: (rows.loc[(name, 0), "status"], rows.loc[(name, 0), "reason"])
        for name in names
        if rows.loc[(name, 0), "status"] != ROWS[name][0]
        or not rows.loc[(name, 0), "reason"].startswith(ROWS[name][1])
    }


def test_some_kinds_give_their_row(tmp_path):
    rows = _run(FAST, tmp_path, seeds=2)
    assert _wrong(rows, FAST) == {}
    scores = rows["rms"].unstack("seed")
    for cheat in ("knows_seed", "looks_ahead"):  # they found nothing, and answer as the sound one
        assert (scores.loc[cheat] == scores.loc["sound"]).all()
    # the second run's count would be 2 in a process that the first one left behind
    assert scores.loc["state_in_class"].nunique() == 1
    assert (rows["checked"] == "missing").all()


@pytest.mark.parametrize(
    "name",
    [
        "state_in_class", "state_in_shared_memory", "state_in_pipe", "state_in_parent_memory",
        "state_in_file", "state_in_system_v", "state_in_attribute",
    ],
)  # fmt: skip
def test_cells_of_one_process_share_nothing(name, tmp_path):
    """Run alone, so that all its cells are forks of the same process."""
    rows = _run([name], tmp_path, seeds=3)
    assert (rows["status"] == "ok").all()
    assert rows["rms"].nunique() == 1


@pytest.mark.slow
def test_every_kind_gives_its_row(tmp_path):
    rows = _run(ROWS, tmp_path, time_limit=20.0)
    assert _wrong(rows, ROWS) == {}
    assert rows["reason"].str.len().max() <= 500
    sound = rows.loc[("sound", 0), "rms"]
    for cheat in ("knows_seed", "looks_ahead", "reads_parent_memory", "reads_environment"):
        assert rows.loc[(cheat, 0), "rms"] == sound, cheat
    assert not Path("/tmp/gripbench_was_here").exists()
    assert not [
        process.pid
        for process in psutil.process_iter(["cmdline"])
        if process.info["cmdline"] == ["sleep", "98765"]
    ]


@pytest.mark.slow
def test_what_never_ends_is_stopped(tmp_path):
    rows = _run(SLEEPERS, tmp_path, time_limit=2.0)
    assert (rows["status"] == "timeout").all()
    assert (rows["reason"] == "stopped after the time limit of 2 s").all()


@pytest.mark.slow
def test_how_a_run_is_split_decides_nothing(tmp_path):
    names = ("state_in_class", "state_in_module", "draws")
    whole = _run(names, tmp_path / "whole", seeds=4)
    _run(names, tmp_path / "parts", seeds="2:4")
    parts = _run(names, tmp_path / "parts", seeds=4, workers=2)
    assert (whole["rms"] == parts["rms"]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_declared_is_one_line(name):
    with pytest.raises(InputError) as caught:
        choose_method(str(KINDS / f"{name}.py"))
    assert REFUSED[name] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_a_check_names_the_kind_once(name):
    check, text = CHECKS[name]
    found = failures(check_estimator(str(KINDS / f"{name}.py"), ("constant_mu",)))
    assert text in found[check]
    assert sum(text in item for item in found.values()) == 1
