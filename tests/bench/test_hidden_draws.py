"""A secret gives every seed other draws, reaches no method, and keeps boards apart."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gripbench
from gripbench.bench.publishing.board_tables import board_table, one_table
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.isolation import processes
from gripbench.bench.running.store import Store
from gripbench.envs.hidden_draws import VARIABLE, entropy, salt_digest
from gripbench.envs.populations.draws import BLOCK, quantiles
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

SECRET, OTHER = "0123456789abcdef", "fedcba9876543210"
KINDS = Path(__file__).parents[1] / "plugins" / "kinds"


@pytest.fixture
def secret(monkeypatch):
    """Sets the secret; the empty text: none."""
    return lambda text: monkeypatch.setenv(VARIABLE, text)


def _short(level=1):
    name = f"constant_mu@{level}" if level else "constant_mu"
    return load_scenario(name).model_copy(update={"horizon": 0.2})


def _bytes(level):
    run = record(_short(level), 3)
    return run.observations.tobytes(), run.truth.tobytes()


def test_without_a_secret_a_stream_starts_from_its_words(secret):
    secret("")  # as a job that was given no secret sets it
    assert entropy(3, 5) == [3, 5]
    assert salt_digest() == ""


def test_a_secret_changes_car_road_and_noise_and_repeats_itself(secret):
    public = {level: _bytes(level) for level in (0, 1)}
    found = {}
    for name in (SECRET, OTHER, SECRET):
        secret(name)
        drawn = {level: _bytes(level) for level in (0, 1)}
        assert found.setdefault(name, drawn) == drawn
        for level in (0, 1):
            assert drawn[level][0] != public[level][0]
        assert drawn[1][1] != public[1][1]
    assert found[SECRET][1][1] != found[OTHER][1][1]
    secret("")
    assert {level: _bytes(level) for level in (0, 1)} == public


def test_hidden_draws_cover_each_spread_as_evenly_and_tell_nothing_of_the_public_ones(secret):
    public = np.array([quantiles(seed) for seed in range(40 * BLOCK)])
    secret(SECRET)
    hidden = np.array([quantiles(seed) for seed in range(40 * BLOCK)])
    twentieths = np.sort(np.floor(hidden[:BLOCK] * BLOCK), axis=0)
    assert (twentieths == np.arange(BLOCK)[:, None]).all()
    related = [np.corrcoef(one, other)[0, 1] for one, other in zip(public.T, hidden.T, strict=True)]
    assert np.abs(related).max() < 4.5 / np.sqrt(len(public))  # 128 of them, each N(0, 1/n)


def test_a_short_secret_is_refused(secret):
    secret("short")
    with pytest.raises(InputError, match="GRIPBENCH_SALT has 5 characters; give at least 16"):
        record(_short(), 0)


def _run(results, *names, **options):
    methods = [str(KINDS / f"{name}.py") for name in names]
    options = {"workers": 1, "seeds": 1, **options}
    rows = gripbench.run(scenarios=[_short()], methods=methods, results=results, **options)
    return rows[rows["target"] == "mu_front"].set_index(["label", "seed"])


@pytest.mark.slow
def test_who_simulates_public_seeds_finds_no_hidden_one(secret, tmp_path):
    public = _run(tmp_path / "public", "sound", "simulates")
    assert (public.loc["simulates", "rms"] == 0.0).all()  # the hole: status ok, rank 1
    assert (public["status"] == "ok").all()
    secret(SECRET)
    hidden = _run(tmp_path / "hidden", "sound", "simulates")
    assert (hidden["status"] == "ok").all()
    # until a reading tells that it is no drive that it knows
    assert (hidden.loc["simulates", "rms"] > 0.5 * hidden.loc["sound", "rms"]).all()
    assert set(hidden["salt"]) == {salt_digest()}
    text = "".join(path.read_text() for path in (tmp_path / "hidden").rglob("*.json"))
    assert salt_digest() in text
    assert SECRET not in text
    assert '"salt"' not in next((tmp_path / "public").rglob("0.json")).read_text()
    # the same secret goes on from what is stored; another one, or none, never takes it
    before = {row.key for row in Store(tmp_path / "hidden").read_all()}
    assert set(_run(tmp_path / "hidden", "sound")["key"]) <= before
    for other in (OTHER, ""):
        secret(other)
        with pytest.raises(InputError, match="drawn with another secret; choose another --results"):
            _run(tmp_path / "hidden", "sound")


SEEKS = """
import gripbench, sys
scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
rows = gripbench.run(scenarios=[scenario], methods=sys.argv[2:], results=sys.argv[1], workers=1)
print(rows["rms"].nunique(), *sorted(set(rows["status"])))
"""


def test_no_method_finds_the_secret_where_it_was_given(tmp_path):
    """In the environment with which the run was started, as a shell or a job gives it."""
    methods = [str(KINDS / f"{name}.py") for name in ("sound", "seeks_secret")]
    done = subprocess.run(
        [sys.executable, "-c", SEEKS, str(tmp_path / "results"), *methods],
        env={**os.environ, VARIABLE: SECRET}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["1", "ok"]  # one that finds it answers otherwise


def test_boards_say_whether_seeds_were_hidden_and_never_mix_them(secret, tmp_path):
    names = ["force_of_acceleration", "slip_slope"]
    frames = {}
    for text in ("", SECRET, OTHER):
        secret(text)
        frames[text] = gripbench.run(
            scenarios=[_short()], methods=names, seeds=2, results=tmp_path / f"r{text}", workers=1
        )
    public, hidden = (boards(frames[text], "force_x_front", "any")[0] for text in ("", SECRET))
    assert public.hiding.startswith("Public seeds: anybody can simulate")
    assert hidden.hiding.startswith(f"Hidden seeds: drawn with a secret (digest {hidden.salt[:8]}")
    assert {row["drawn"] for row in one_table([hidden]).rows} == {"from hidden seeds"}
    pandas = pytest.importorskip("pandas")
    for one, other in (("", SECRET), (SECRET, OTHER)):
        mixed = [frames[one].query("label == @names[0]"), frames[other].query("label == @names[1]")]
        with pytest.raises(InputError, match="were not drawn with the same secret"):
            boards(pandas.concat(mixed), "force_x_front", "any")


def test_a_board_of_level_0_is_for_reproduction(tmp_path):
    rows = gripbench.run(
        scenarios=[_short(0)], methods=["slip_slope", "force_of_acceleration"], seeds=2,
        results=tmp_path, workers=1,
    )  # fmt: skip
    (board,) = boards(rows, "force_x_front", "any")
    assert board.hiding.startswith("Level 0, for reproduction only")
    assert board.hiding in board_table(board).notes


def test_where_nothing_guards_the_secret_no_method_of_others_starts(secret, monkeypatch):
    secret(SECRET)
    monkeypatch.setattr(processes, "landlock_version", lambda: 0)
    with pytest.raises(InputError, match="GRIPBENCH_SALT is set, and this system cannot keep"):
        processes.start_plugin()


def test_papers_are_reproduced_with_public_seeds_only(secret, tmp_path):
    from gripbench.bench.papers.comparison import reproduce_paper

    secret(SECRET)
    with pytest.raises(InputError, match="li2014: its numbers are of public seeds"):
        reproduce_paper("li2014", tmp_path / "out")
    assert not (tmp_path / "out").exists()
