"""Keys of rows at a level: a change of the population's file, or of a grade, makes them stale."""

import pytest
from typer.testing import CliRunner

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.command_line import application
from gripbench.bench.running.fingerprints import scenario_digest
from gripbench.envs.populations.population import population_files
from gripbench.envs.worlds import at_level, load_scenario, scenario_files
from gripbench.errors import InputError


@pytest.fixture
def scenario(tmp_path):
    """A scenario whose population is a file of the test's own, and that file."""
    path = tmp_path / "mine.toml"
    path.write_text(population_files()["straight_driving"].read_text())
    return load_scenario("friction_step").model_copy(update={"population": str(path)}), path


def test_a_changed_population_changes_the_key_of_its_levels_alone(scenario):
    base, path = scenario
    before = [scenario_digest(at_level(base, level)) for level in (0, 1, 2)]
    assert len(set(before)) == 3
    path.write_text(path.read_text().replace("mass = { std = 0.01,", "mass = { std = 0.011,"))
    after = [scenario_digest(at_level(base, level)) for level in (0, 1, 2)]
    assert after[0] == before[0]
    assert after[1] != before[1]
    assert after[2] != before[2]


def test_suites_of_populations_are_at_level_1_and_hold_every_scenario_of_the_others():
    for name in ("longitudinal", "lateral"):
        plain, drawn = load_suite(name), load_suite(f"{name}_population")
        assert drawn.level == 1
        assert set(plain.scenarios) < set(drawn.scenarios)
        assert all(item.endswith("@1") for item in drawn.names())
        assert find_scenario(drawn.names(2)[0]).level == 2
        assert drawn.names(0) == list(drawn.scenarios)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = { std = 0.01,", "mass = { std = -0.01,", "'car.mass.std'"),
        ("mass = { std = 0.01,", "mass = { std = 0.3,", "'car.mass'"),
        ("cg_place = { std = 0.006,", "cg_place = { std = 0.2,", "the wheelbase"),
        ("mass = { std = 0.01,", "mas = { std = 0.01,", "unknown cause 'mas'"),
    ],
)
def test_a_mistake_in_a_population_stops_a_run_before_it_writes(old, new, said, scenario, tmp_path):
    _, path = scenario
    path.write_text(path.read_text().replace(old, new, 1))
    mine = tmp_path / "my_drive.toml"
    text = scenario_files()["friction_step"].read_text()
    text = text.replace('"friction_step"', '"my_drive"').replace("straight_driving", str(path))
    mine.write_text(text)
    results = tmp_path / "results"
    words = ["run", "--scenario", f"{mine}@1", "--method", "slip_slope", "--results", str(results)]
    done = CliRunner().invoke(application(), words)
    assert isinstance(done.exception, InputError)
    assert str(path) in str(done.exception)
    assert said in str(done.exception)
    assert "\n" not in str(done.exception)
    assert not results.exists()


def test_a_fault_on_a_channel_that_is_not_there_stops_a_run_before_it_writes(tmp_path):
    results = tmp_path / "results"
    words = ["run", "--scenario", "friction_step@1", "--method", "slip_slope"]
    words += ["--faults", "freeze:3:yaw_rate", "--results", str(results)]
    done = CliRunner().invoke(application(), words)
    assert isinstance(done.exception, InputError)
    assert "the instruments give no 'yaw_rate'" in str(done.exception)
    assert not results.exists()
