"""From a class in a file to a leaderboard, and an edit that makes it worse."""

import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.command_line import application

PLUGIN = """
class Guess:
    name = "guess"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {{"mu_front": {value} + 0.01 * obs["accel_x"]}}
"""


@pytest.mark.slow
def test_edited_method_is_run_again_and_compared(tmp_path):
    plugin, results, base = tmp_path / "guess.py", tmp_path / "results", tmp_path / "base"

    def ranked(text):
        plugin.write_text(text)
        rows = gripbench.run(
            scenarios=["noisy_acceleration"],
            methods=[f"{plugin}:Guess", "slip_slope"],
            seeds=3,
            results=results,
            workers=1,
        )
        return gripbench.rank(rows, target="mu_front")

    def leaderboard(*arguments):
        call = ["leaderboard", "--results", results, *arguments]
        return CliRunner().invoke(application(), [str(item) for item in call])

    first = ranked(PLUGIN.format(value=0.5))
    assert set(first["label"]) == {"guess", "slip_slope"}
    assert (first["failures"] == 0).all()
    assert leaderboard("--out", base).exit_code == 0

    ranked(PLUGIN.format(value=0.5) + "# an edit that changes nothing\n")
    same = leaderboard("--compare", base)
    assert same.exit_code == 0, same.output
    assert "No change." in same.output

    ranked(PLUGIN.format(value=0.1))
    worse = leaderboard("--compare", base)
    assert worse.exit_code == 1, worse.output
    changes = worse.output.partition("Verdict")[2].splitlines()[2:]
    assert [line.split()[:4] for line in changes] == [
        ["worse", "guess", "mu_front", "noisy_acceleration"]
    ]
