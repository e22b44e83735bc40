"""The evidence for the errata of Li, Du & Li (2014): what its rows must show."""

import pytest

from gripbench.bench.papers.li2014 import evidence as li2014
from gripbench.bench.papers.li2014.tables import load_paper_tables


@pytest.fixture(scope="module")
def rows():
    paper = load_paper_tables("li2014")
    few = [row.model_copy(update={"seeds": min(row.seeds, 2)}) for row in paper.scenarios]
    table = li2014.evidence(paper.model_copy(update={"scenarios": few}))
    return {(row["item"], row["alternative"]): row for row in table.rows}


def _row(rows, item, start=""):
    found = [row for (name, other), row in rows.items() if name == item and other.startswith(start)]
    assert len(found) == 1
    return found[0]


def test_as_reproduced(rows):
    row = _row(rows, "none")
    assert row["IV_matches"] + row["V_matches"] >= 58


@pytest.mark.parametrize(
    ("item", "start", "column", "at_most"),
    [
        ("Table III: C_r", "0.02", "IV_matches", 27),
        ("solver", "accurate integrator", "IV_matches", 14),
        ("solver", "accurate integrator", "V_matches", 12),
        ("torque", "no ramp", "V_matches", 24),
        ("RLS: lambda", "0.999", "V_matches", 18),
        ("friction", "limited", "V_matches", 24),
        ("Method 2: gains", "natural", "V_matches", 27),
        ("wheel accelerations", "differenced", "IV_matches", 27),
    ],
)
def test_other_settings_lose_cells(rows, item, start, column, at_most):
    assert _row(rows, item, start)[column] <= at_most


def test_direct_figures(rows):
    assert "14.7 m/s^2" in _row(rows, "Table III: C_r", "1.5")["figure"]
    assert "311.0 m^2/s^2" in _row(rows, "eq. 27: convergence")["figure"]
    assert "reads 0.910 at friction 0.9" in _row(rows, "eq. 15: map")["figure"]
    errors = _row(rows, "eq. 24: argument of Sat")["figure"]
    assert float(errors.split()[2]) > 1.0
    assert float(errors.split()[-2]) < 0.2


def test_true_speed_closes_the_open_cell_and_opens_others(rows):
    row = _row(rows, "slip of the observer")
    assert row["V_matches"] == 30
    assert row["IV_matches"] < 30


def test_other_gains_close_the_open_cell_at_the_cost_of_the_forces(rows):
    row, usual = _row(rows, "gains of the observer"), _row(rows, "none")
    assert row["V_matches"] == 30
    assert row["IV_mean"] > usual["IV_mean"]
    assert row["V_mean"] < usual["V_mean"]
