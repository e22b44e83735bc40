"""Pictures of what methods state of their errors, against the samples that they are drawn from."""

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.publishing.figures.calibration import nees_plot, reliability_plot
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import style
from gripbench.configuration import CONFIGS
from gripbench.errors import InputError


@pytest.fixture(scope="module")
def short_cars(tmp_path_factory):
    """Name of a scenario of a quarter of a second, every seed another car."""
    text = (CONFIGS / "scenarios" / "constant_mu.toml").read_text(encoding="utf-8")
    text = text.replace('name = "constant_mu"', 'name = "short"', 1)
    path = tmp_path_factory.mktemp("cars") / "short.toml"
    path.write_text(text.replace("horizon = 30.0", "horizon = 0.25", 1), encoding="utf-8")
    return f"{path}@1"


def test_nees_over_time_is_that_of_the_runs_with_the_band_of_the_chi_square_law(short_cars):
    runs, method = Runs(), "constant_friction:prior"
    with style():
        axes = nees_plot(runs, short_cars, [method], "mu_front", 4).axes[0]
    expected = []
    for seed in range(4):
        recording = runs.recording(short_cars, seed)
        prior = recording.vehicle["friction_prior"], recording.vehicle["friction_prior_std"]
        expected.append(((recording.truth["mu_front"] - prior[0]) / prior[1]) ** 2)
    curve = axes.lines[0].get_ydata()
    assert curve[0] == pytest.approx(np.mean(expected, axis=0)[0])
    assert curve[-1] == pytest.approx(np.mean(expected, axis=0)[-1])
    low, high = stats.chi2.interval(0.95, 4)
    box = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert (box.y0, box.y1) == pytest.approx((low / 4.0, high / 4.0))


def test_a_reliability_diagram_counts_the_samples_below_each_quantile(short_cars):
    runs, method = Runs(), "constant_friction:prior"
    with style():
        axes = reliability_plot(runs, short_cars, [method], "mu_front", 3).axes[0]
    x, y = axes.lines[1].get_data()
    places = []
    for seed in range(3):
        recording = runs.recording(short_cars, seed)
        prior = recording.vehicle["friction_prior"], recording.vehicle["friction_prior_std"]
        places.append(stats.norm.cdf(recording.truth["mu_front"], *prior))
    for level, share in zip(x[1:-1], y[1:-1], strict=True):
        assert share == pytest.approx(np.mean([np.mean(place <= level) for place in places]))
    assert (x[0], y[0], x[-1], y[-1]) == (0.0, 0.0, 1.0, 1.0)


def test_what_states_nothing_has_no_picture_of_its_errors(short_cars):
    for draw in (nees_plot, reliability_plot):
        with style(), pytest.raises(InputError, match="slip_slope states nothing of its error"):
            draw(Runs(), short_cars, ["slip_slope"], "mu_front", 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--draw", "nes", "--methods", "slip_slope"), "picture 'nes'"),
        (("--draw", "nees"), "needs --methods"),
        (("--draw", "nees", "--methods", "slip_slope", "--signal", "sideslip"), "'sideslip'"),
    ],
)
def test_pictures_of_errors_that_cannot_be_are_one_line(short_cars, tmp_path, arguments, message):
    failed = CliRunner().invoke(
        application(), ["plot", short_cars, *arguments, "--results", str(tmp_path)]
    )
    assert isinstance(failed.exception, InputError)
    assert message in str(failed.exception)
    assert not list(tmp_path.rglob("*.p*"))
