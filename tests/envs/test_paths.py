import math

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from gripbench.envs.roads.paths import (
    DoubleLaneChange,
    PublicRoad,
    Segment,
    Slalom,
    Turns,
    lay_path,
)
from gripbench.envs.roads.road import SPACING

PATHS = [
    DoubleLaneChange(kind="double_lane_change"),
    Slalom(kind="slalom", amplitude=1.75, wavelength=50.0),
    Turns(kind="turns", segments=[Segment(radius=30.0, angle=-2.0, transition=10.0)]),
    PublicRoad(kind="public_road"),
]


@pytest.mark.parametrize("path", PATHS)
def test_tables_are_consistent_and_evenly_spaced(path):
    table = lay_path(path, 12.0, 3)
    x, y, heading, curvature = table.T
    steps = np.hypot(np.diff(x), np.diff(y))
    assert np.allclose(steps, SPACING, rtol=2e-3)
    middle = 0.5 * (heading[1:] + heading[:-1])
    assert np.allclose(np.diff(x), SPACING * np.cos(middle), atol=1e-3)
    assert np.allclose(np.diff(y), SPACING * np.sin(middle), atol=1e-3)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * SPACING)])
    assert np.allclose(heading - heading[0], turned, atol=2e-3)


def test_double_lane_change_keeps_to_the_lanes_of_iso_3888_1():
    table = lay_path(DoubleLaneChange(kind="double_lane_change", lead_in=5.0), 10.0, 0)
    along, across = table[:, 0] - 50.0, table[:, 1]
    assert np.abs(across[(along < 15.0) | (along > 95.0)]).max() < 1e-3
    assert np.abs(across[(along > 45.0) & (along < 70.0)] - 3.5).max() < 1e-3
    assert (np.diff(across[(along > 15.0) & (along < 45.0)]) > -1e-12).all()


def test_slalom_has_its_amplitude_and_number_of_waves():
    table = lay_path(Slalom(kind="slalom", amplitude=1.5, wavelength=40.0, waves=4), 10.0, 0)
    across = table[:, 1]
    assert across.max() == pytest.approx(1.5, rel=0.01)
    assert across.min() == pytest.approx(-1.5, rel=0.01)
    crossings = np.count_nonzero(np.diff(np.sign(across[np.abs(across) > 1e-6])))
    assert crossings == 2 * 4 - 1


@pytest.mark.parametrize("transition", [0.0, 20.0, 60.0])
def test_a_turn_turns_by_its_angle_with_its_radius(transition):
    turn = Segment(radius=100.0, angle=1.5, transition=transition)
    path = Turns(kind="turns", segments=[Segment(length=50.0), turn, Segment(length=10.0)])
    table = lay_path(path, 10.0, 0)
    assert table[-1, 2] == pytest.approx(1.5, abs=1e-3)
    assert table[:, 3].max() == pytest.approx(0.01, rel=1e-6)


def test_public_road_is_drawn_by_the_seed():
    road = PublicRoad(kind="public_road")
    tables = [lay_path(road, 8.0, seed) for seed in (1, 1, 2)]
    assert np.array_equal(tables[0], tables[1])
    assert not np.array_equal(tables[0][:100], tables[2][: len(tables[0])][:400])
    for seed in range(10):
        curvature = lay_path(road, 8.0, seed)[:, 3]
        assert 1.0 / 40.0 <= np.abs(curvature).max() <= 1.0 / 27.0 + 1e-9
        corners = np.count_nonzero(np.diff((np.abs(curvature) > 1e-4).astype(int)) == 1)
        assert corners == 7


def test_ranges_of_a_public_road_are_checked():
    with pytest.raises(ValidationError, match="radius_high is below radius_low"):
        PublicRoad(kind="public_road", radius_low=50.0)
    with pytest.raises(ValidationError, match="does not fit into every corner"):
        PublicRoad(kind="public_road", transition=60.0)
    with pytest.raises(ValidationError, match="any car turns"):
        TypeAdapter(Segment).validate_python({"radius": 1.0, "angle": math.pi})
