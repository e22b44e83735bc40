"""Everything that a result depends on changes its key; nothing else does."""

import dataclasses

import pytest

from gripbench.bench.catalogue.registry import choose_method, method_digest
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.ranking.ranking import rank
from gripbench.bench.running import cells, fingerprints
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.cells import OtherCodeError, cell_of, run_task
from gripbench.bench.running.fingerprints import world_digest
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store, read_rows
from gripbench.errors import InputError


@pytest.fixture
def plan(short_scenario):
    return Plan((find_scenario(short_scenario),), (choose_method("slip_slope"),), range(2))


def keys(plan):
    return [cell.key for cell in plan.cells()]


def test_a_cell_holds_all_that_names_its_row(plan, tmp_path):
    first, second = plan.cells()
    assert (first.scenario.name, first.seed, first.method.label) == ("short", 0, "slip_slope")
    assert Store(tmp_path).path("short", "slip_slope", 1) == tmp_path / "rows" / second.path
    assert first.key != second.key
    assert first.world == second.world
    assert keys(plan) == keys(plan)
    assert plan.size == 2


def test_the_scoring_is_part_of_the_key_and_of_the_world(plan, monkeypatch):
    before, world = keys(plan), next(plan.cells()).world
    monkeypatch.setattr(fingerprints, "scoring_digest", lambda: "another")
    assert not set(before) & set(keys(plan))
    assert next(plan.cells()).world != world


def test_the_versions_and_switches_are_part_of_the_key(plan, monkeypatch):
    before = keys(plan)
    monkeypatch.setattr(cells, "versions", lambda: {"numba": "0.1"})
    assert not set(before) & set(keys(plan))
    fingerprints.versions.cache_clear()
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    try:
        assert fingerprints.versions()["NUMBA_CPU_NAME"] == "generic"
    finally:
        fingerprints.versions.cache_clear()


def test_the_scenario_is_part_of_the_key(plan):
    changed = dataclasses.replace(
        plan, scenarios=(plan.scenarios[0].model_copy(update={"score_from": 0.5}),)
    )
    assert not set(keys(plan)) & set(keys(changed))


def test_the_settings_are_part_of_the_digest_even_under_one_label():
    spec = choose_method("slip_slope")
    declared = spec.declaration
    for name, value in declared.settings.items():
        if not isinstance(value, float):
            continue
        other = dataclasses.replace(declared, settings={**declared.settings, name: value + 1.0})
        assert method_digest(spec.source, other) != spec.digest
    assert method_digest(spec.source, dataclasses.replace(declared, variant="x")) != spec.digest
    assert method_digest(spec.source, declared) == spec.digest


def test_a_worker_with_other_code_is_found_before_a_row_is_stored(plan, monkeypatch, tmp_path):
    def planned():
        made = list(plan.cells())
        return [dataclasses.replace(cell, key="0" * 32, world="w") for cell in made]

    task = cells.Task(tuple(planned()[:1]), Limits(), timed=False)
    with pytest.raises(OtherCodeError, match="another gripbench or other packages"):
        run_task(task)


def test_rows_of_two_versions_of_a_scenario_share_no_board(plan, tmp_path):
    run_plan(plan, Store(tmp_path), Backend(workers=1))
    changed = Plan(
        (plan.scenarios[0].model_copy(update={"score_from": 0.5}),),
        (choose_method("individual_wheel_torque"),),
        plan.seeds,
    )
    run_plan(changed, Store(tmp_path), Backend(workers=1))
    with pytest.raises(InputError, match="rows of 'short' come from 2 versions of the scenario"):
        rank(read_rows(tmp_path), target="mu_front", sensors="any")
    run_plan(
        dataclasses.replace(changed, methods=plan.methods), Store(tmp_path), Backend(workers=1)
    )
    assert len(rank(read_rows(tmp_path), target="mu_front", sensors="any")) == 2


def test_a_file_of_gripbench_that_changed_after_the_start_is_named(plan, tmp_path, monkeypatch):
    from gripbench import sources

    path, before = next(iter(sources._AT_START.items()))
    other = dataclasses.replace(before, changed=0)
    monkeypatch.setitem(sources._AT_START, path, other)
    with pytest.raises(InputError, match="changed after this Python had loaded it"):
        run_plan(plan, Store(tmp_path), Backend(workers=1))
    assert not list(Store(tmp_path).files())


def test_cells_of_one_world_have_one_digest(plan):
    scenario = plan.scenarios[0]
    made = cell_of(scenario, 0, plan.methods[0], world_digest(scenario))
    assert made.key == keys(plan)[0]
