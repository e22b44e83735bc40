"""Populations: moments and correlations of draws, physics of their causes, levels, bad files."""

import hashlib
import json
import tomllib
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from gripbench.configuration import CONFIGS
from gripbench.envs.populations.cars import car_on_road
from gripbench.envs.populations.causes import CAUSES, DIMENSION, PROCESSES
from gripbench.envs.populations.draws import (
    DIMENSIONS,
    deviations_of,
    draw,
    paper_of,
    quantiles,
    scaled,
)
from gripbench.envs.populations.drives import GRIPPIEST, SLIPPERIEST, friction_of
from gripbench.envs.populations.population import load_population, population_files
from gripbench.envs.signals import signal
from gripbench.envs.vehicles import CarOnPaper, CarOnRoad, load_vehicle, vehicle_files
from gripbench.envs.worlds import at_level, load_scenario, record, scenario_files
from gripbench.errors import InputError

SEEDS = range(1000)
NAMES = sorted(population_files())


@pytest.fixture(scope="module")
def drawn():
    """Deviations at level 1 by population and cause, one value a seed."""
    found = {}
    for name in NAMES:
        population = load_population(name)
        lines = [deviations_of(population, seed) for seed in SEEDS]
        found[name] = {cause: np.array([line[cause] for line in lines]) for cause in lines[0]}
    return found


@pytest.mark.parametrize("name", NAMES)
def test_draws_have_the_declared_moments_and_stay_within_their_support(name, drawn):
    for cause, spread in load_population(name).spreads.items():
        values = drawn[name][cause]
        mean, std = spread.moments
        low, high = spread.support
        assert values.mean() == pytest.approx(mean, abs=0.04 * std), cause
        assert values.std() == pytest.approx(std, rel=0.04), cause
        assert low <= values.min(), cause
        assert values.max() <= high, cause


@pytest.mark.parametrize("name", NAMES)
def test_draws_have_the_declared_correlations_and_no_others(name, drawn):
    declared = load_population(name).correlation_matrix()
    causes = list(drawn[name])
    found = np.corrcoef([drawn[name][cause] for cause in causes])
    places = [DIMENSION[cause] for cause in causes]
    # A uniform's correlation is a little below that of its normal score.
    np.testing.assert_allclose(found, declared[np.ix_(places, places)], atol=0.13)


def test_twenty_seeds_cover_every_dimension():
    points = np.array([quantiles(seed) for seed in range(20)])
    for dimension in range(DIMENSIONS):
        assert (np.histogram(points[:, dimension], bins=20, range=(0.0, 1.0))[0] == 1).all()
    assert len(CAUSES) <= DIMENSIONS
    assert np.unique(points).size == points.size


def test_the_same_draw_is_scaled_by_the_level():
    for name in NAMES:
        population = load_population(name)
        deviations = deviations_of(population, 7)
        one, two = (scaled(population, deviations, level) for level in (1.0, 2.0))
        for cause, spread in population.spreads.items():
            if cause == "drive.side":
                assert one[cause] == two[cause]
            else:
                ratio = two[cause] - spread.centre, 2.0 * (one[cause] - spread.centre)
                assert ratio[0] == pytest.approx(ratio[1], rel=1e-12), cause
        nothing = scaled(population, deviations, 0.0)
        assert all(nothing[cause] == spread.centre for cause, spread in population.spreads.items())


def test_draws_do_not_depend_on_the_scenario_or_its_level():
    first = draw(at_level(load_scenario("two_turns"), 1), 5).deviations
    second = draw(at_level(load_scenario("slalom_ice"), 1), 5).deviations
    assert first == second
    assert first["car.payload"] * 2.0 == pytest.approx(
        draw(at_level(load_scenario("two_turns"), 2), 5).deviations["car.payload"]
    )


STRUCTURE = {"drive_share_front", "steer_limit", "steer_rate_limit", "longitudinal_stiffness"}
"""What no cause moves: which axle is driven, how far it can be steered; and, of a car with the
Magic Formula's own stiffness, the other figure of its paper."""


@pytest.mark.parametrize("vehicle", ["li2014", "yoon2015_pickup", "dakhlallah2008"])
def test_no_value_on_paper_is_the_one_on_the_road(vehicle):
    paper = load_vehicle(vehicle).values()
    names = {"li2014": "friction_step", "yoon2015_pickup": "slalom_ice"}
    scenario = at_level(load_scenario(names.get(vehicle, "dakhlallah_hard")), 1)
    for seed in range(64):
        road = draw(scenario, seed).road
        for name in paper.keys() - STRUCTURE:
            if (name, vehicle) == ("cornering_stiffness_front", "li2014"):
                continue
            assert road.parameters[name] != paper[name], (name, seed)
        for name in ("radius_front", "radius_rear", "peak_front", "peak_rear"):
            assert getattr(road, name) != 1.0


def test_a_payload_moves_mass_centre_and_inertia_as_mechanics_says():
    paper = load_vehicle("dakhlallah2008").values()
    effects = load_population("cornering").effects
    drawn = {"car.payload": 0.2, "car.payload_place": 0.9, "car.payload_height": 0.1}
    car = car_on_road(paper, drawn, effects).parameters
    load, kerb = 0.2 * paper["mass"], paper["mass"]
    base = paper["cg_to_front"] + paper["cg_to_rear"]
    assert car["mass"] == pytest.approx(kerb + load)
    centre = (kerb * paper["cg_to_front"] + load * 0.9 * base) / (kerb + load)
    assert car["cg_to_front"] == pytest.approx(centre)
    assert car["cg_to_front"] + car["cg_to_rear"] == pytest.approx(base)
    inertia = paper["yaw_inertia"] + kerb * (centre - paper["cg_to_front"]) ** 2
    inertia += load * (0.9 * base - centre) ** 2  # Huygens and Steiner
    assert car["yaw_inertia"] == pytest.approx(inertia)
    height = (kerb * paper["cg_height"] + load * (paper["cg_height"] + 0.1)) / (kerb + load)
    assert car["cg_height"] == pytest.approx(height)
    moment = car["mass"] * car["cg_height"] / (paper["mass"] * paper["cg_height"])
    assert car["roll_gradient"] == pytest.approx(paper["roll_gradient"] * moment)


def test_a_worn_tyre_is_smaller_and_stiffer_and_grips_less():
    paper = load_vehicle("dakhlallah2008").values()
    effects = load_population("cornering").effects
    car = car_on_road(paper, {"tyre.wear_front": 3.0}, effects)
    assert car.radius_front * paper["wheel_radius"] == pytest.approx(paper["wheel_radius"] - 3e-3)
    assert car.radius_rear == 1.0
    assert car.parameters["cornering_stiffness_front"] > paper["cornering_stiffness_front"]
    assert car.parameters["cornering_stiffness_rear"] == paper["cornering_stiffness_rear"]
    assert car.peak_front < 1.0 == car.peak_rear


def test_without_deviations_the_car_is_that_on_paper_to_the_last_bit():
    effects = load_population("cornering").effects
    for name in vehicle_files():
        paper = load_vehicle(name).values()
        assert car_on_road(paper, {}, effects) == CarOnRoad(paper)
        centred = {"car.payload_place": 0.6, "car.payload_height": 0.1}
        assert car_on_road(paper, centred, effects) == CarOnRoad(paper)


def _without_spread(folder, name):
    """Return the path of a population as the one that ships, with every spread at zero."""
    given = tomllib.loads(population_files()[name].read_text())
    lines = [f'name = "{name}"', 'description = "no spread"']
    prior = given["friction_prior"]
    lines += ["[friction_prior]", *(f"{key} = {json.dumps(value)}" for key, value in prior.items())]
    for table in ("car", "tyre", "road", "drive"):
        lines += [f"[{table}]"]
        for key, spread in given[table].items():
            centre = f", centre = {spread['centre']}" if "centre" in spread else ""
            lines.append(f'{key} = {{ source = "none"{centre} }}')
    lines += ["[effects]"]
    for key, value in given["effects"].items():
        lines.append(f'{key} = {{ value = {value["value"]}, source = "as the one that ships" }}')
    lines += ["[instruments]", 'level_1 = "ideal"', 'level_2 = "ideal"']
    path = folder / f"{name}.toml"
    path.write_text("\n".join(lines))
    return str(path)


@pytest.mark.parametrize("name", ["friction_step", "mixed_surfaces", "slalom_ice", "parking_lot"])
def test_zero_spread_is_level_0_to_the_last_bit(name, tmp_path):
    scenario = load_scenario(name)
    nothing = scenario.model_copy(
        update={"population": _without_spread(tmp_path, scenario.population)}
    )
    expected = record(scenario, 3)
    for level in (1, 2):
        found = record(at_level(nothing, level), 3)
        assert found.truth.tobytes() == expected.truth.tobytes()
        assert found.observations.tobytes() == expected.observations.tobytes()


# Digests of truth and observations of seed 3: level 0 stays what it was, bit by bit.
LEVEL_0 = {
    "constant_mu": "45d5773a6ee37cfd",
    "friction_step": "b044431d7bac84fe",
    "noisy_acceleration": "3f50b3600fe33767",
    "split_mu_braking": "d326bb44ed927795",
    "slalom_snow": "1585a024f883cf72",
    "public_road": "354caeb8a7ef2c70",
    "two_turns_bicycle": "2caae38792b5cfef",
    "mu_jump_lane_change": "bf6dff92f26e401b",
    "li2014_friction_step": "dab7977416715e98",
    "li2014_noisy_acceleration": "b31224cd8ba28a9c",
}


@pytest.mark.parametrize("name", LEVEL_0)
def test_level_0_is_unchanged(name):
    run = record(load_scenario(name), 3)
    seen = hashlib.sha256(run.truth.tobytes() + run.observations.tobytes()).hexdigest()
    assert seen[:16] == LEVEL_0[name]


@pytest.mark.parametrize("name", sorted(scenario_files()))
def test_every_scenario_takes_part_and_its_draws_can_be_driven(name):
    for level in (1, 2):
        scenario = at_level(load_scenario(name), level)
        assert scenario.name == f"{name}@{level}"
        for seed in range(48):
            found = draw(scenario, seed)
            assert type(found.road) is CarOnRoad
            assert type(found.paper) is CarOnPaper
            assert found.sensors
            assert not any(signal(channel).idealised for channel in found.sensors)


def test_whatever_is_drawn_is_a_road():
    assert friction_of(0.3, 0.0) == 0.3
    deviations = np.linspace(-12.0, 12.0, 101)
    for nominal in (0.03, 0.15, 0.25, 0.9, 1.4):
        drawn = np.array([friction_of(nominal, one) for one in deviations])
        assert (np.diff(drawn) > 0.0).all()
        low, high = min(SLIPPERIEST, nominal / 1.1), max(GRIPPIEST, 1.1 * nominal)
        assert low < drawn.min() < 1.01 * low
        assert 0.99 * high < drawn.max() < high
        odds = np.log(drawn / low) / np.log(high / drawn)
        np.testing.assert_allclose(np.diff(np.log(odds)), np.diff(deviations), rtol=1e-6)


def test_the_demand_on_a_slippery_road_is_its_share_whichever_way_the_driver_answers():
    """Lateral acceleration over friction: by a lower speed, by wider turns, or by both."""
    scenario = load_scenario("two_turns")
    nominal = scenario.speed**2 / scenario.path.segments[1].radius / scenario.road.mu
    for held in (0.0, 0.4, 1.0):
        changes = {"road.friction": -2.0, "drive.held_speed": held}
        found = draw(scenario, 0, changes=changes).scenario
        demand = found.speed**2 / found.path.segments[1].radius / found.road.mu
        assert demand == pytest.approx(nominal)
        assert (found.speed == scenario.speed) == (held == 1.0)


def _frictions(found):
    """Return what the tyres find in a drawn run: a friction and its share of the time, each."""
    driven, road = found.scenario, found.road
    tyres = 0.5 * (road.peak_front + road.peak_rear)
    if hasattr(driven, "friction"):
        starts = [piece.start for piece in driven.friction]
        shares = np.diff([*starts, max(driven.horizon, starts[-1] + 1e-3)])
        return tyres * np.array([piece.first for piece in driven.friction]), shares
    plain, length = driven.road.mu, driven.speed * driven.horizon
    if driven.road.mu_right:
        plain = 0.5 * (plain + driven.road.mu_right)
    values, shares = [driven.road.mu_after or plain], [max(length - driven.road.mu_jump_at, 0.0)]
    for surface in driven.road.surfaces:
        values.append(surface.mu)
        shares.append(min(surface.length, max(length - surface.start, 0.0)))
    if driven.road.mu_after:
        return tyres * np.array([plain, *values]), [length - shares[0], *shares]
    shares[0] -= sum(shares[1:])
    return tyres * np.array(values), shares


@pytest.mark.parametrize("suite", ["longitudinal_population", "lateral_population"])
def test_the_prior_is_the_moments_of_the_draws_of_its_suite(suite):
    names = tomllib.loads((CONFIGS / "suites" / f"{suite}.toml").read_text())["scenarios"]
    means, squares = [], []
    for name in names:
        scenario = at_level(load_scenario(name), 1)
        frictions = [_frictions(draw(scenario, seed)) for seed in range(20)]
        means.append([np.average(value, weights=share) for value, share in frictions])
        squares.append([np.average(value**2, weights=share) for value, share in frictions])
        assert np.std(means[-1]) > 0.6 * np.mean(means[-1])  # from seed to seed
    prior = load_population(scenario.population).friction_prior
    std = np.sqrt(np.mean(squares) - np.mean(means) ** 2)
    assert np.mean(means) == pytest.approx(prior.mean, abs=0.015)
    assert std == pytest.approx(prior.std, abs=0.015)


def test_no_scenario_says_what_road_it_is_on():
    """The friction of a seed's road is the same in all scenarios, whatever their own is."""
    for name in ("slalom_ice", "two_turns", "dakhlallah_mild", "constant_mu"):
        roads = [draw(at_level(load_scenario(name), 1), seed).scenario for seed in range(20)]
        drawn = [
            road.road.mu if hasattr(road, "road") else road.friction[0].first for road in roads
        ]
        if name == "slalom_ice":
            first = drawn
        assert drawn == pytest.approx(first)


@pytest.mark.parametrize("name", ["friction_step@1", "slalom_ice@1"])
def test_methods_are_told_of_the_car_on_paper_everywhere(name):
    scenario = load_scenario(name)
    population = load_population(scenario.population)
    paper = {
        **load_vehicle(scenario.vehicle).values(),
        "friction_prior": population.friction_prior.mean,
        "friction_prior_std": population.friction_prior.std,
    }
    run = record(scenario, 2)
    assert run.vehicle == paper == paper_of(scenario)
    assert draw(scenario, 2).road.values()["mass"] != paper["mass"]
    base, _, level = name.partition("@")
    identity = load_scenario(base).environment
    kwargs = {"scenario": f"{base}@{level}"}
    environment = gymnasium.make(identity, **kwargs).unwrapped
    vector = gymnasium.make_vec(
        identity, num_envs=2, vectorization_mode="vector_entry_point", **kwargs
    )
    assert environment.vehicle == paper == vector.unwrapped.vehicle
    environment.close()
    vector.close()


@pytest.mark.parametrize("name", ["combined_traction_braking@2", "dakhlallah_hard@1"])
def test_an_environment_gives_the_bytes_of_the_recording(name):
    scenario = load_scenario(name)
    expected = record(scenario, 3)
    identity = load_scenario(name.partition("@")[0]).environment
    environment = gymnasium.make(identity, scenario=name).unwrapped
    seen, info = environment.reset(seed=3)
    for k in range(400):
        assert info["truth"]["time"] == expected.truth["time"][k]
        for channel, value in seen.items():
            assert value == expected.observations[channel][k], (channel, k)
        seen, _, _, _, info = environment.step(environment.driver_action())
    environment.close()


def test_recordings_of_two_seeds_share_neither_car_nor_friction_nor_drive():
    scenario = load_scenario("slalom_snow@1")
    first, second = record(scenario, 0), record(scenario, 1)
    shared = min(len(first.truth), len(second.truth))
    for name in ("mu", "sideslip", "speed_x", "steer_angle"):
        assert not np.allclose(first.truth[name][:shared], second.truth[name][:shared], atol=1e-3)
    again = record(scenario, 0)
    assert again.truth.tobytes() == first.truth.tobytes()
    assert again.observations.tobytes() == first.observations.tobytes()


GOOD = """
name = "mine"
description = "mine"
[friction_prior]
mean = 0.6
std = 0.2
source = "s"
[effects]
radius_per_pressure = { value = 0.01, source = "s" }
stiffness_per_wear = { value = 0.03, source = "s" }
stiffness_per_pressure = { value = 0.15, source = "s" }
stiffness_per_kelvin = { value = -0.004, source = "s" }
peak_per_wear = { value = -0.008, source = "s" }
peak_per_kelvin = { value = -0.001, source = "s" }
"""


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        ('[car]\nmass = { std = -0.1, source = "s" }', "'car.mass.std'"),
        ('[car]\nmass = { low = 0.1, high = -0.1, source = "s" }', "'car.mass'.*negative spread"),
        ('[car]\nmass = { std = 0.2, source = "s" }', "'car.mass'.*mass is above 0"),
        (
            '[car]\npayload = { low = 0.0, high = 2.0, source = "s" }\n'
            'payload_place = { low = -2.0, high = 0.0, source = "s" }',
            "'car.payload'.*outside the wheelbase",
        ),
        ('[car]\ncg_place = { std = 0.1, source = "s" }', "'car.cg_place'.*the wheelbase"),
        (
            '[car]\nmas = { std = 0.1, source = "s" }',
            "unknown cause 'mas': did you mean 'car.mass'",
        ),
        ('[tyre]\nradius = { std = 0.2, source = "s" }', "'tyre.radius'.*wheel_radius"),
        ("[car]\nmass = { std = 0.01 }", "missing key 'car.mass.source'"),
        ('[instruments]\nlevel_1 = "goood"', "'instruments.level_1': unknown instrument grade"),
        ('[shape]\nbrush = 0.4\nsource = "s"', "sum up to 0.4"),
        (
            '[[correlations]]\ncauses = ["car.mass", "car.drag"]\nvalue = 0.5\nsource = "s"',
            "unknown cause 'car.mass'",
        ),
    ],
)
def test_a_mistake_in_a_population_is_one_line_with_file_and_key(addition, message, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD + addition)
    with pytest.raises(InputError, match=message) as error:
        load_population(str(path))
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_unknown_populations_levels_and_causes_are_named():
    scenario = load_scenario("constant_mu")
    with pytest.raises(InputError, match="unknown population 'straight': did you mean"):
        at_level(scenario.model_copy(update={"population": "straight"}), 1)
    with pytest.raises(InputError, match="unknown level 7: known: 0, 1, 2"):
        load_scenario("constant_mu@7")
    with pytest.raises(InputError, match="key 'population' is missing"):
        at_level(scenario.model_copy(update={"population": ""}), 1)
    with pytest.raises(InputError, match=r"unknown cause 'car\.mas': did you mean"):
        draw(at_level(scenario, 1), 0, changes={"car.mas": 0.1})
    with pytest.raises(InputError, match="such as constant_mu@1"):
        load_scenario("constant_mu@x")


def test_one_cause_can_be_set_while_all_others_stay_on_paper():
    scenario = load_scenario("friction_step")
    changed = draw(scenario, 0, changes={"tyre.radius": 0.002})
    paper = changed.paper["wheel_radius"]
    assert changed.road.parameters["wheel_radius"] == pytest.approx(1.002 * paper)
    same = replace(changed.road, parameters={**changed.road.parameters, "wheel_radius": paper})
    assert same == draw(scenario, 0).road


def test_every_spread_of_a_population_that_ships_has_its_source():
    for path in (CONFIGS / "populations").glob("*.toml"):
        population = load_population(path.stem)
        for cause, spread in population.spreads.items():
            assert len(spread.source) > 4, cause
            assert spread.std > 0.0 or spread.high > spread.low, cause
        assert set(PROCESSES) & set(population.spreads)
