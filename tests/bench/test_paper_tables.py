"""The reproduction of Tables IV and V, its verdicts, and the command that prints them."""

import json
import math

import pytest
from typer.testing import CliRunner

from gripbench.bench import command_line
from gripbench.bench.command_line import application
from gripbench.bench.papers.li2014 import tables as paper_tables
from gripbench.bench.papers.li2014.tables import Cell, Outcome, load_paper_tables, reproduce
from gripbench.configuration import parse, read_toml
from gripbench.errors import InputError


@pytest.fixture(scope="module")
def paper():
    return load_paper_tables("li2014")


@pytest.fixture(scope="module")
def outcome(paper):
    return reproduce(paper)


@pytest.fixture
def quick(monkeypatch, paper):
    """The reproduction of two scenarios with one seed, through the command."""
    rows = [0, 4]
    small = paper.model_copy(
        update={
            "scenarios": [paper.scenarios[i] for i in rows],
            "tables": [
                table.model_copy(
                    update={
                        "values": [table.values[i] for i in rows],
                        "reached": [table.reached[i] for i in rows],
                    }
                )
                for table in paper.tables
            ],
        }
    )
    monkeypatch.setattr(paper_tables, "load_paper_tables", lambda name: small)
    return small


def test_at_least_58_of_60_cells_match(outcome):
    assert len(outcome.cells) == 60
    assert outcome.matching() >= 58
    assert outcome.mean_log_ratio("IV") <= 0.16
    assert outcome.mean_log_ratio("V") <= 0.32


def test_no_cell_has_left_its_stored_tolerance(outcome):
    assert paper_tables.changed_cells(outcome) == []


def test_all_forces_match_and_the_open_cell_is_the_known_one(outcome):
    assert all(cell.matches for cell in outcome.of_table("IV"))
    open_cells = [cell for cell in outcome.of_table("V") if not cell.matches]
    assert [(cell.scenario, cell.method) for cell in open_cells] == [
        ("li2014_gradient", "Proposed")
    ]


def test_published_values_are_those_of_the_paper(paper):
    """A few cells, copied by hand a second time."""
    columns = [column.title for column in paper.methods]
    rows = [row.scenario for row in paper.scenarios]
    known = {
        ("IV", "li2014_constant_mu", "Proposed"): 8.738,
        ("IV", "li2014_large_torque", "Proposed"): 1305,
        ("IV", "li2014_combined_traction_braking", "EKF"): 58.28,
        ("V", "li2014_noisy_acceleration", "Method 3"): 2.703,
        ("V", "li2014_gradient", "Proposed"): 0.0233,
        ("V", "li2014_friction_step", "Method 1"): 0.028,
    }
    for (label, scenario, method), value in known.items():
        table = next(t for t in paper.tables if t.label == label)
        assert table.values[rows.index(scenario)][columns.index(method)] == value


def test_order_of_the_methods_agrees(outcome, paper):
    for row in paper.scenarios:
        for label in ("IV", "V"):
            assert outcome.order_agreement(label, row.scenario) > 0.3
    assert outcome.order_agreement("IV", "li2014_constant_mu") == pytest.approx(1.0)


def _outcome(paper, values):
    """Return an outcome of one row of table IV with these values of ours and the published."""
    cells = [
        Cell("IV", "s", f"m{i}", published, ours, 2.0, 1.0, 1.1)
        for i, (ours, published) in enumerate(values)
    ]
    return Outcome(paper, tuple(cells))


def test_kendall_of_known_orders(paper):
    same = _outcome(paper, [(1, 10), (2, 20), (3, 30), (4, 40)])
    assert same.order_agreement("IV", "s") == pytest.approx(1.0)
    turned = _outcome(paper, [(4, 10), (3, 20), (2, 30), (1, 40)])
    assert turned.order_agreement("IV", "s") == pytest.approx(-1.0)
    one_swap = _outcome(paper, [(2, 10), (1, 20), (3, 30), (4, 40)])
    assert one_swap.order_agreement("IV", "s") == pytest.approx(4 / 6)


@pytest.mark.parametrize(
    ("ours", "matches"), [(0.51, True), (0.49, False), (1.99, True), (2.01, False)]
)
def test_match(ours, matches):
    assert Cell("IV", "s", "m", 1.0, ours, 2.0, 1.0, 1.1).matches is matches


@pytest.mark.parametrize(
    ("ours", "changed"), [(1.09, False), (1.11, True), (0.92, False), (0.9, True), (math.nan, True)]
)
def test_changed(ours, changed):
    assert Cell("IV", "s", "m", 1.0, ours, 2.0, 1.0, 1.1).changed is changed


def test_pooling_is_the_mean_of_squares(paper, outcome):
    """Two seeds of a row: the pooled RMS lies between, as root mean square, not as mean."""
    noisy = paper.scenarios[2]
    assert noisy.seeds == 20
    single = []
    for seed in (0, 1):
        found = reproduce(
            _only(paper, 2, 1),
            recorder=lambda scenario, _, seed=seed: paper_tables.record(scenario, seed),
        )
        single.append(found.of_table("IV")[0].ours)
    both = reproduce(_only(paper, 2, 2)).of_table("IV")[0].ours
    assert both == pytest.approx(math.sqrt((single[0] ** 2 + single[1] ** 2) / 2), rel=1e-3)


def _only(paper, row, seeds):
    scenario = paper.scenarios[row].model_copy(update={"seeds": seeds})
    tables = [
        t.model_copy(update={"values": [t.values[row]], "reached": [t.reached[row]]})
        for t in paper.tables
    ]
    return paper.model_copy(update={"scenarios": [scenario], "tables": tables})


def test_command_prints_and_writes(quick, tmp_path):
    done = CliRunner().invoke(
        application(), ["reproduce", "li2014", "--results", str(tmp_path / "out")]
    )
    assert done.exit_code == 0, done.output
    assert "cells lie within a factor of 2" in done.output
    assert "Kendall's tau" in done.output
    assert "EKF †" in done.output
    assert "Proposed †" in done.output
    assert "Method 1 †" not in done.output
    assert "wheel_acceleration_front" in done.output
    assert "mismatch" in done.output
    folder = tmp_path / "out" / "li2014"
    written = {path.name for path in folder.iterdir()}
    expected = {f"{table}.{kind}" for table in ("table_iv", "table_v") for kind in ("csv", "tex")}
    assert written >= expected | {"README.md", "manifest.json"}
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["seeds"] == {"li2014_constant_mu": [0], "li2014_gradient": [0]}
    assert {"configuration", "versions", "commit", "machine", "date"} <= set(manifest)
    assert "†" in (folder / "README.md").read_text()
    assert "* best of its group" in done.output


def test_a_rerun_that_changes_nothing_changes_no_file(quick, tmp_path, monkeypatch):
    arguments = ["reproduce", "li2014", "--results", str(tmp_path)]
    folder = tmp_path / "li2014"

    def content():
        assert CliRunner().invoke(application(), arguments).exit_code == 0
        return {path.name: path.read_bytes() for path in folder.iterdir()}

    first = content()
    monkeypatch.setattr("gripbench.bench.publishing.manifest.commit", lambda: "another")
    assert content() == first
    (folder / "table_iv.csv").write_text("edited by hand")
    assert content() == first
    known = json.loads(first["manifest.json"])
    known["files"]["table_iv.csv"] = "of other figures"
    (folder / "manifest.json").write_text(json.dumps(known))
    last = content()
    assert json.loads(last.pop("manifest.json"))["commit"] == "another"
    first.pop("manifest.json")
    assert last == first
    (folder / "manifest.json").write_text("[")
    assert json.loads(content()["manifest.json"])["commit"] == "another"


def test_a_changed_cell_is_exit_code_1(quick, tmp_path, monkeypatch):
    table = quick.tables[0]
    reached = [list(row) for row in table.reached]
    reached[0][0] *= 1.3
    changed = quick.model_copy(
        update={"tables": [table.model_copy(update={"reached": reached}), quick.tables[1]]}
    )
    monkeypatch.setattr(paper_tables, "load_paper_tables", lambda name: changed)
    done = CliRunner().invoke(application(), ["reproduce", "li2014", "--results", str(tmp_path)])
    assert done.exit_code == 1
    assert "changed: table IV, li2014_constant_mu, Method 1" in done.output


def test_a_mismatch_alone_is_no_failure(outcome):
    assert outcome.matching() < 60
    assert paper_tables.changed_cells(outcome) == []


def _main(monkeypatch, capsys, *arguments):
    monkeypatch.setattr("sys.argv", ["gripbench", *arguments])
    with pytest.raises(SystemExit) as stop:
        command_line.main()
    return stop.value.code, capsys.readouterr().err


@pytest.mark.parametrize("name", ["reproduce", "evidence"])
def test_unknown_paper_is_one_line_and_exit_code_2(name, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, err = _main(monkeypatch, capsys, name, "li2041")
    assert code == 2
    assert err.count("\n") == 1
    assert "did you mean 'li2014'" in err
    assert list(tmp_path.iterdir()) == []


def test_a_file_with_a_mistake_writes_nothing(monkeypatch, capsys, tmp_path):
    source = paper_tables.paper_path("li2014").read_text()
    broken = tmp_path / "li2014.toml"
    broken.write_text(source.replace("tolerance = 1.15", "tolerance = 0.5"))
    monkeypatch.setattr(paper_tables, "paper_path", lambda name: broken)
    out = tmp_path / "out"
    code, err = _main(monkeypatch, capsys, "reproduce", "li2014", "--results", str(out))
    assert code == 2
    assert err.count("\n") == 1
    assert "key 'tolerance'" in err
    assert str(broken) in err
    assert not out.exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("match_factor = 2.0", "match_factor = 1.0", "key 'match_factor'.*greater than 1"),
        ("match_factor = 2.0", "match_facto = 2.0", "did you mean 'match_factor'"),
        ("[44.67, 76.58, 45.44, 48.05, 8.738]", "[44.67, 76.58]", "must have 6 rows of 5"),
        ("[44.67, 76.58,", "[-44.67, 76.58,", "values must be positive"),
        ("[44.67, 76.58,", "[nan, 76.58,", r"tables\.0\.values\.0\.0"),
        ("seeds = 20", "seeds = 0", r"scenarios\.2\.seeds"),
    ],
)
def test_mistakes_in_a_file_of_tables(tmp_path, old, new, message):
    source = paper_tables.paper_path("li2014").read_text()
    assert old in source
    path = tmp_path / "paper.toml"
    path.write_text(source.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        parse(paper_tables.PaperTables, read_toml(path), path)
    assert "\n" not in str(caught.value)
