from __future__ import annotations

import html
import html.parser
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from synthetic_rows import noisy_frame, noisy_rows, row
from typer.testing import CliRunner

import gripbench
from gripbench.bench.command_line import application
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.report import content, page, series
from gripbench.bench.publishing.tables import csv
from gripbench.bench.running.rows import frame_of
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

pytest.importorskip("plotly", reason="the report needs the extra 'report'")

SCENARIO = "li2014_friction_step"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Folder with rows of real runs, one method of which lacks its sensors."""
    folder = tmp_path_factory.mktemp("results")
    methods = ["slip_slope", "proposed_observer:paper", "dugoff_ekf"]
    gripbench.run(scenarios=[SCENARIO], methods=methods, seeds=2, results=folder, workers=1)
    table = Table(
        (Column("a", "Scenario"), Column("b", "Ours", "N"), Column("c", "Verdict")),
        ({"a": "<Simple>", "b": 38.8, "c": "match"}, {"a": "Step", "b": None, "c": "mismatch"}),
    )
    (folder / "li2014").mkdir()
    (folder / "li2014" / "table_iv.csv").write_text(csv(table))
    (folder / "li2014" / "README.md").write_text("Table\n\n- 1 of 2 cells match.\n")
    (folder / "li2014" / "manifest.json").write_text('{"commit": "abc"}')
    return folder


@pytest.fixture(scope="module")
def report(results):
    path = results / "report.html"
    page.write_report(results, path, shown_seeds=2, band_seeds=2)
    return path.read_text(encoding="utf-8")


@given(arrays(float, st.integers(1, 50), elements=st.floats(-1e6, 1e6) | st.just(np.nan)))
def test_packing_keeps_values_to_a_step_of_their_range(values):
    packed = series.packed(values)
    restored = series.unpacked(json.loads(json.dumps(packed)))
    np.testing.assert_array_equal(np.isnan(restored), np.isnan(values))
    known = np.isfinite(values)
    span = np.ptp(values[known]) if known.any() else 0.0
    assert np.all(np.abs(restored[known] - values[known]) <= span / 65534 + 1e-9)


def test_values_are_held_between_samples_and_missing_behind_the_end():
    time, values = np.array([0.0, 1.0, 2.0]), np.array([5.0, 6.0, 7.0])
    held = series.at_times(time, values, np.array([0.0, 0.9, 1.0, 1.5, 2.0, 2.1]))
    np.testing.assert_array_equal(held, [5.0, 5.0, 6.0, 6.0, 7.0, np.nan])


def test_series_are_those_of_the_run_and_bands_those_of_the_errors():
    seeds = (0, 1, 2, 3)
    plan = series.SeriesPlan("two_turns", {"sideslip": ("kinematic_kalman_filter",)}, (1,), seeds)
    made = series.series_of(plan)
    times = np.linspace(0.0, load_scenario("two_turns").horizon, series.POINTS)
    np.testing.assert_allclose(series.unpacked(made["time"]), times, atol=2e-3)
    errors = []
    for seed in seeds:
        runs = Runs()
        truth = runs.recording("two_turns", seed).truth
        estimate = runs.estimates("two_turns", "kinematic_kalman_filter", seed)["sideslip"]
        true = np.degrees(series.at_times(truth["time"], truth["sideslip"], times))
        errors.append(np.degrees(series.at_times(truth["time"], estimate, times)) - true)
        if seed == 1:
            np.testing.assert_allclose(
                series.unpacked(made["truth"]["sideslip"]["1"]), true, atol=1e-4
            )
    bands = made["bands"]["sideslip"]["kinematic_kalman_filter"]
    expected = np.percentile(errors, series.BAND, axis=0)
    np.testing.assert_allclose([series.unpacked(band) for band in bands], expected, atol=1e-3)
    assert list(made["truth"]["sideslip"]) == ["1"]


def test_a_method_that_is_not_at_hand_has_no_curve():
    plan = series.SeriesPlan(SCENARIO, {"mu_front": ("slip_slope", "filter_of_a_file")}, (0,), (0,))
    made = series.series_of(plan)
    assert list(made["estimates"]["mu_front"]) == ["slip_slope"]
    assert list(made["bands"]["mu_front"]) == ["slip_slope"]


def test_series_are_the_same_in_one_process_and_in_several():
    plans = [
        series.SeriesPlan(name, {"mu_front": ("slip_slope:paper",)}, (0,), (0,))
        for name in ("li2014_constant_mu", SCENARIO)
    ]
    assert series.all_series(plans, 1) == series.all_series(plans, 2)


def test_targets_are_those_of_the_suites_that_were_run():
    rows = noisy_frame({"a": 1.0, "b": 2.0}, scenarios=("friction_step",))
    assert content.chosen_targets(rows) == ("mu_front",)
    assert content.chosen_targets(rows.assign(target="mu_rear")) == ("mu_rear",)


def test_a_suite_that_was_not_run_is_named():
    rows = noisy_frame({"a": 1.0})
    with pytest.raises(InputError, match="no stored row of suite 'longitudinal'"):
        content.rows_of_suites(rows, ["longitudinal"])


def test_a_heat_map_gives_ratios_to_the_best_and_words_for_failures():
    rows = noisy_rows({"good": 1.0, "bad": 3.0}, seeds=3, spread=0.0)
    rows += [row("broken", seed, None, name) for seed in range(3) for name in ("step", "hill")]
    rows += [row("good", 3, None, "step")]
    rows += [row("blind", 0, None, "step", status="skipped")]
    found = content.heat_map(frame_of(rows), "mu_front")
    assert found["methods"] == ["good", "bad", "broken", "blind"]
    np.testing.assert_allclose(found["ratio"][:2], [[1.0, 1.0], [3.0, 3.0]])
    assert found["ratio"][2] == [None, None]
    assert found["text"][2] == ["failed", "failed"]
    assert found["text"][3] == ["–", ""]
    assert found["text"][0][0].endswith("*")
    assert not found["text"][0][1].endswith("*")


def test_an_idealised_method_is_marked_and_not_the_best():
    rows = noisy_frame(
        {"ideal": 0.1, "real": 1.0, "poor": 2.0},
        spread=0.0,
        ideal={"idealised": ("wheel_acceleration_front",)},
    )
    found = content.heat_map(rows, "mu_front")
    assert found["methods"] == ["ideal†", "real", "poor"]
    np.testing.assert_allclose([line[0] for line in found["ratio"]], [0.1, 1.0, 2.0])


def test_boards_are_of_all_methods_and_of_each_set_of_instruments():
    rows = noisy_frame({"a": 1.0, "b": 2.0}, b={"sensors": ("accel_x",)})
    found = content.found_boards(rows, ["mu_front"])
    assert found[0].sensors == ()
    assert ("accelerometer",) not in [board.sensors for board in found]  # one method: no board
    points = {point["label"]: point for point in content.front(found[0])}
    assert points["a"]["front"]
    assert points["a"]["step"] == pytest.approx(1000.0)


class Links(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for key, value in attrs if key in ("src", "href") and value]


def test_the_page_needs_nothing_outside_itself(report):
    assert len(report) < 10_000_000
    head, _, _ = report.partition("<script>")
    links = Links()
    links.feed(head)
    assert links.found
    assert all(link.startswith(("#", "data:")) for link in links.found)
    assert "connect-src" not in report
    assert "default-src 'none'" in report


def test_the_page_has_every_section_with_its_caption(report):
    for name in ("summary", "boards", "map", "series", "front", "papers", "failures", "manifest"):
        assert f'<section id="{name}">' in report
    assert report.count("<figcaption>") == 5
    assert "{{" not in report.partition("<script>")[0]


def test_the_page_shows_failures_papers_and_manifests(report):
    assert "the scenario has no sensor for" in report
    assert "&lt;Simple&gt;" in report
    assert "1 of 2 cells match." in report
    assert '"commit": "abc"' in html.unescape(report)


def test_an_absent_recording_is_a_note_and_no_failure(tmp_path):
    reason = "log.csv is not at hand; get it from <somewhere>"
    rows = noisy_rows({"good": 1.0, "bad": 3.0}, seeds=2)
    rows += [
        row(label, 0, None, "recording:x", status="skipped", reason=reason, targets=())
        for label in ("good", "bad")
    ]
    made = page.page(frame_of(rows), ("mu_front",), {}, tmp_path)
    failures = made.partition('<section id="failures">')[2].partition("</section>")[0]
    assert "Every run finished." in failures
    assert "Note: recording:x was not run: log.csv is not at hand; get it from &lt;" in failures
    assert "<dt>Runs</dt><dd>8</dd>" in made
    rows += [row("good", 1, None, "recording:x", status="failed")]
    made = page.page(frame_of(rows), ("mu_front",), {}, tmp_path)
    assert "Note: recording:x" not in made
    assert "Every run finished." not in made


def test_the_data_are_plain_json_without_a_closing_tag(report):
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', report)[1]
    data = json.loads(text)
    assert set(data["series"]) == {SCENARIO}
    assert data["series"][SCENARIO]["seeds"] == [0, 1]
    assert set(data["series"][SCENARIO]["estimates"]["mu_front"]) == {
        "slip_slope", "proposed_observer:paper",
    }  # fmt: skip


def test_series_on_the_page_are_those_of_the_recording(report):
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', report)[1]
    made = json.loads(text)["series"][SCENARIO]
    truth = record(load_scenario(SCENARIO), 0).truth
    times = np.linspace(0.0, 30.0, series.POINTS)
    expected = series.at_times(truth["time"], truth["mu_front"], times)
    np.testing.assert_allclose(series.unpacked(made["truth"]["mu_front"]["0"]), expected, atol=1e-4)


def test_nothing_to_report_is_one_error(tmp_path):
    with pytest.raises(InputError, match="no rows under"):
        page.write_report(tmp_path, tmp_path / "report.html")


def test_the_command_writes_the_report(results, tmp_path):
    arguments = ["report", "--results", str(results), "--output", str(tmp_path / "r.html")]
    result = CliRunner().invoke(application(), [*arguments, "--seeds", "1", "--workers", "1"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "r.html").stat().st_size > 1_000_000
