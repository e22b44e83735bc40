from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.commands.plot import split_methods
from gripbench.bench.papers.figures import PAPERS, choose, paper_figures, write_figures
from gripbench.bench.papers.panels import Panel, draw_panels, error_panel, signal_panel
from gripbench.bench.publishing.figures.run_plot import run_plot
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import (
    SERIES,
    TRUTH,
    axis_label,
    axis_scale,
    line,
    new_figure,
    save,
    style,
)
from gripbench.errors import InputError

RESULT_FIGURES = {
    "li2014": [*range(3, 18), *range(20, 33)],
    "yoon2015": [*range(6, 11), 12, 13, 14],
    "dakhlallah2008": [3, 4, *range(6, 14)],
    "anderson2004": [*range(2, 14)],
}
STEP = "li2014_friction_step"


@pytest.fixture(scope="module")
def runs():
    return Runs()


def luminance(colour):
    red, green, blue = to_rgb(colour)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("paper", PAPERS)
def test_every_result_figure_of_the_paper_is_there(paper):
    numbers = [figure.label for figure in paper_figures(paper) if figure.label.isdigit()]
    assert numbers == [str(number) for number in RESULT_FIGURES[paper]]


@pytest.mark.parametrize("paper", PAPERS)
def test_every_figure_says_what_to_see(paper):
    for figure in paper_figures(paper):
        assert figure.title
        assert figure.caption.endswith(".")


def test_an_unknown_paper_or_figure_is_named():
    with pytest.raises(InputError, match="unknown paper 'li2104': did you mean 'li2014'"):
        paper_figures("li2104")
    with pytest.raises(InputError, match="li2014 has no figure '18'"):
        choose("li2014", ["18"])


@pytest.mark.parametrize(
    ("paper", "label"),
    [("li2014", "7"), ("dakhlallah2008", "12"), ("yoon2015", "9"), ("anderson2004", "5")],
)
def test_one_figure_of_each_paper_is_written(paper, label, tmp_path):
    paths = write_figures(paper, tmp_path, [label], dpi=40)
    names = {path.name for path in paths}
    assert names == {f"figure_{int(label):02d}.png", f"figure_{int(label):02d}.pdf", "README.md"}
    assert paths[0].read_bytes().startswith(b"\x89PNG")
    assert paths[1].read_bytes().startswith(b"%PDF")
    index = (tmp_path / "README.md").read_text()
    assert f"## Figure {label}." in index
    assert choose(paper, [label])[0].caption in index


@pytest.mark.slow
def test_the_same_figure_gives_the_same_bytes(tmp_path):
    for name in ("first", "second"):
        write_figures("li2014", tmp_path / name, ["3", "overview"], dpi=40)
    for path in sorted((tmp_path / "first").iterdir()):
        assert path.read_bytes() == (tmp_path / "second" / path.name).read_bytes(), path.name


def test_a_figure_shows_truth_and_estimates_of_the_run(runs):
    figure = choose("li2014", ["24"])[0].draw(runs)
    truth, proposed = figure.axes[0].lines
    recording = runs.recording(STEP)
    np.testing.assert_array_equal(truth.get_xdata(), recording.truth["time"])
    np.testing.assert_array_equal(truth.get_ydata(), recording.truth["mu_front"])
    estimates = runs.estimates(STEP, "proposed_observer:paper")["mu_front"]
    np.testing.assert_array_equal(proposed.get_ydata(), estimates)


def test_figures_4_to_17_take_one_point_in_a_hundred(runs):
    figure = choose("li2014", ["6"])[0].draw(runs)
    truth = runs.recording(STEP).truth
    np.testing.assert_array_equal(
        figure.axes[0].lines[0].get_ydata(), truth["force_x_front"][::100]
    )
    assert [drawn.get_label() for drawn in figure.axes[0].lines] == [
        "Truth", "Method 1", "Method 2", "Method 3", "EKF",
    ]  # fmt: skip


def test_axes_have_the_units_of_the_papers(runs):
    figure = choose("li2014", ["6"])[0].draw(runs)
    assert figure.axes[0].get_ylabel() == "Front tyre force [N]"
    assert figure.axes[0].get_xlabel() == "Time [s]"
    assert axis_scale("sideslip") == (180.0 / np.pi, "°")
    assert axis_label("yaw_rate") == "Yaw rate [°/s]"
    assert axis_scale("wheel_speed_front") == (1.0, "rad/s")
    assert axis_label("mu") == "Friction coefficient"


def test_series_differ_without_colour_and_truth_is_the_darkest():
    assert len({(str(look.linestyle), look.marker) for look in SERIES}) == len(SERIES)
    assert len({look.marker for look in SERIES}) == len(SERIES)
    assert all(luminance(look.color) > luminance(TRUTH.color) + 0.1 for look in SERIES)
    assert all(look.linewidth < TRUTH.linewidth for look in SERIES)


def test_markers_are_even_in_time_where_points_are_not():
    x = np.concatenate([np.linspace(0.0, 1.0, 10_000), np.linspace(1.01, 10.0, 500)])
    with style():
        axes = new_figure(2.0).subplots()
        line(axes, x, x, "series", SERIES[0])
    places = x[axes.lines[0].get_markevery()]
    np.testing.assert_allclose(np.diff(places), 10.0 / 12, atol=0.03)


def test_angles_are_drawn_in_degrees():
    truth = np.array([(0.1,), (0.2,)], [("sideslip", float)])
    estimate = np.array([(0.1,), (0.3,)], [("sideslip", float)])
    panel = signal_panel("sideslip", truth, [("EKF", estimate)])
    np.testing.assert_allclose(panel.curves[0][1], np.degrees([0.1, 0.2]))
    error = error_panel("sideslip", truth, [("EKF", estimate)])
    assert error.ylabel == "Error of sideslip angle [°]"
    np.testing.assert_allclose(error.curves[0][1], np.degrees([0.0, 0.1]))


def test_panels_share_an_axis_and_a_legend():
    panels = [
        Panel("a", (("Truth", [0.0, 1.0]), ("EKF", [0.0, 2.0]))),
        Panel("b", (("EKF", [1, 2]),)),
    ]
    with style():
        figure = draw_panels([0.0, 1.0], panels)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["Truth", "EKF"]
    assert len(figure.axes) == 2
    assert figure.axes[0].lines[1].get_color() == figure.axes[1].lines[0].get_color()


def test_a_plot_shows_errors_and_the_band_of_the_variance(runs):
    figure = run_plot(
        runs, "two_turns", ["kinematic_kalman_filter"], "sideslip", start=2.0, end=9.0
    )
    above, below = figure.axes
    truth, estimate = above.lines
    np.testing.assert_allclose(
        below.lines[0].get_ydata(), estimate.get_ydata() - truth.get_ydata(), atol=1e-12
    )
    assert truth.get_xdata()[0] == pytest.approx(2.0)
    assert truth.get_xdata()[-1] == pytest.approx(9.0)
    assert len(above.collections) == 1


@pytest.mark.parametrize(
    ("methods", "name", "message"),
    [
        ([], "mu", "unknown signal in the truth of li2014_friction_step 'mu'"),
        (["slip_slope"], "speed_x", "unknown estimate of slip_slope 'speed_x'"),
        (["slip_slop"], "mu_front", "did you mean 'slip_slope'"),
        (["kinematic_kalman_filter"], "mu_front", "unknown estimate"),
    ],
)
def test_a_plot_refuses_what_is_not_there(runs, methods, name, message):
    with pytest.raises(InputError, match=message):
        run_plot(runs, STEP, methods, name)


def test_a_plot_of_a_method_without_its_sensors_says_so(runs):
    reason = "cannot run on two_turns_bicycle: the scenario has no sensor for"
    with pytest.raises(InputError, match=reason):
        run_plot(runs, "two_turns_bicycle", ["magnetometer_gps_cascade"], "sideslip")


def test_a_part_behind_the_end_of_the_run_is_refused(runs):
    with pytest.raises(InputError, match="seed 0 runs from 0 to 30 s"):
        run_plot(runs, STEP, [], "mu_front", start=31.0)


def test_settings_of_a_method_may_have_commas():
    assert split_methods("a@x=1,y=2, b:paper ,c@z=3") == ["a@x=1,y=2", "b:paper", "c@z=3"]
    assert split_methods("") == []


def test_the_command_writes_a_plot_where_it_says(tmp_path):
    arguments = ["plot", STEP, "--methods", "slip_slope", "--signal", "mu_front"]
    result = CliRunner().invoke(
        application(), [*arguments, "--results", str(tmp_path), "--dpi", "40"]
    )
    assert result.exit_code == 0, result.output
    assert (tmp_path / "plots" / f"{STEP}_mu_front_0.png").is_file()
    assert (tmp_path / "plots" / f"{STEP}_mu_front_0.pdf").is_file()


def test_the_command_writes_figures_below_the_paper(tmp_path):
    arguments = ["figures", "li2014", "--figure", "3", "--dpi", "40", "--results", str(tmp_path)]
    result = CliRunner().invoke(application(), arguments)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "li2014" / "figures" / "figure_03.png").is_file()


def test_a_folder_that_cannot_be_written_is_one_error(tmp_path):
    (tmp_path / "file").write_text("")
    with style(), pytest.raises(Exception, match="cannot be written"):
        save(new_figure(1.0), tmp_path / "file" / "below", "figure", dpi=40)
