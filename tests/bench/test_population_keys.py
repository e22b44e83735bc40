"""Keys of rows at a level: a change of the population's file, or of a grade, makes them stale."""

import pytest

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.running.fingerprints import scenario_digest
from gripbench.envs.populations.population import population_files
from gripbench.envs.worlds import at_level, load_scenario


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
