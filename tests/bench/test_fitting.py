"""Trained methods: drives that are never tested, one fit each, kept and used again, and shown."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gripbench
from gripbench.bench.catalogue.arrays import as_given, numbers_of_fit, packed, unpacked
from gripbench.bench.catalogue.check import check_estimator, failures
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.training import TRAINING_SEEDS, Training, check_test_seeds
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.courses import course_of
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.store import Store
from gripbench.configuration import CONFIGS
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import GripbenchError, InputError

METHOD = '''
import pathlib
import numpy as np

HERE = pathlib.Path(__file__).parent


class Mean:
    """The mean friction of its training drives, and a slope on the acceleration."""

    name = "mean"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    trained_on = "brief.toml"

    def __init__(self, ridge=1.0):
        self.ridge = ridge

    def fit(self, recordings, budget):
        {before}
        rows = np.concatenate([r.observations["accel_x"] for r in recordings])
        truth = np.concatenate([r.truth["mu_front"] for r in recordings])
        slope = rows @ (truth - truth.mean()) / (rows @ rows + self.ridge)
        return {{"mean": truth.mean(), "slope": slope, "drives": len(recordings), "budget": budget}}

    def reset(self, vehicle, dt):
        self.mean, self.slope = self.fitted["mean"], self.fitted["slope"]

    def update(self, obs):
        return {{"mu_front": self.mean + self.slope * obs["accel_x"]}}
'''


@pytest.fixture
def brief(tmp_path):
    """Path of a scenario of half a second with a population, beside the methods."""
    text = (CONFIGS / "scenarios" / "friction_step.toml").read_text(encoding="utf-8")
    for old, new in (('"friction_step"', '"brief"'), ("horizon = 30.0", "horizon = 0.5")):
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "brief.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def method(tmp_path, brief):
    """Return a function that writes the method; it gives its path."""

    def write(before="pass", **changes):
        text = METHOD.format(before=before)
        for old, new in changes.values():
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "mean.py"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def run(brief, choices, results, **more):
    choices = [choices] if isinstance(choices, str) else choices
    return gripbench.run(
        scenarios=[f"{brief}@1"], methods=choices, results=results, seeds=2, workers=1, **more
    )


def expected(brief):
    """Return mean and slope as they follow from the drives that a fit must be given."""
    scenario = load_scenario(f"{brief}@1")
    drives = [record(scenario, TRAINING_SEEDS.start + k) for k in range(4)]
    rows = np.concatenate([one.observations["accel_x"] for one in drives])
    truth = np.concatenate([one.truth["mu_front"] for one in drives])
    return truth.mean(), rows @ (truth - truth.mean()) / (rows @ rows + 1.0)


def test_a_fit_sees_level_one_of_seeds_that_are_never_tested_and_is_made_once(
    brief, method, tmp_path, monkeypatch
):
    results = tmp_path / "results"
    path = method()
    frame = run(brief, [path, "constant_friction"], results)
    assert set(frame["status"]) == {"ok"}
    spec = fitted(choose_method(path), results, Limits())
    found = as_given(spec.state)
    mean, slope = expected(brief)
    assert found["mean"] == pytest.approx(mean, rel=1e-12)
    assert found["slope"] == pytest.approx(slope, rel=1e-9)
    assert (found["drives"], found["budget"]) == (4, 100)
    row = next(row for row in Store(results).read_all() if row.label == "mean")
    first = TRAINING_SEEDS.start
    assert row.training == Training(
        how="fitted", on="brief@1", seeds=(first, first + 4), drives=4, budget=100
    )
    assert row.runtime.training > 0.0
    truth = record(load_scenario(f"{brief}@1"), row.seed)
    error = mean + slope * truth.observations["accel_x"] - truth.truth["mu_front"]
    assert row.scores["mu_front"]["rms"].value == pytest.approx(np.sqrt(np.mean(error**2)))
    # it is not made again, whatever is run with it
    monkeypatch.setattr("gripbench.bench.running.fitting._fit", None)
    again = run(brief, [path], results, fresh=True)
    old = frame[frame["label"] == "mean"]
    assert list(again["key"]) == list(old["key"])
    assert list(again["sum_of_squares"]) == list(old["sum_of_squares"])


@pytest.mark.slow
@pytest.mark.parametrize("what", ["code", "settings", "data", "stored file"])
def test_a_fit_is_made_again_when_anything_is_another(brief, method, tmp_path, what):
    results = tmp_path / "results"
    choice = method()
    before = run(brief, choice, results)
    stored = list((results / "fits").iterdir())
    assert len(stored) == 1
    if what == "code":
        method(slope=('"slope": slope', '"slope": 2.0 * slope'))
    elif what == "settings":
        choice += "@ridge=1000.0"
    elif what == "data":
        brief.write_text(brief.read_text().replace("horizon = 0.5", "horizon = 0.4", 1))
    else:
        content = stored[0].read_bytes()
        stored[0].write_bytes(content[:200] + bytes([content[200] ^ 1]) + content[201:])
    after = run(brief, choice, results)
    if what == "stored file":
        assert list(after["key"]) == list(before["key"])
        assert len(list((results / "fits").iterdir())) == 1
        return
    assert len(list((results / "fits").iterdir())) == 2
    assert not set(after["key"]) & set(before["key"])


def test_a_stored_fit_with_a_pickle_is_not_opened(brief, method, tmp_path):
    results, mark = tmp_path / "results", tmp_path / "executed"

    class Trap:
        def __reduce__(self):
            return (mark.write_text, ("run",))

    choice = method()
    before = run(brief, choice, results)
    (path,) = (results / "fits").iterdir()
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    trapped = np.empty(1, object)
    trapped[0] = Trap()
    np.savez(path, **(arrays | {"mean": trapped}))
    assert list(run(brief, choice, results)["key"]) == list(before["key"])
    assert not mark.exists()


@pytest.mark.slow
def test_workers_and_order_do_not_matter(brief, method, tmp_path):
    choice = method()
    one = run(brief, [choice, "constant_friction"], tmp_path / "one")
    frame = gripbench.run(
        scenarios=[f"{brief}@1"], methods=["constant_friction", choice], seeds=2, workers=2,
        results=tmp_path / "two",
    )  # fmt: skip
    for label in ("mean", "constant_friction"):
        left, right = (item[item["label"] == label] for item in (one, frame))
        assert list(left["key"]) == list(right["key"])
        assert list(left["sum_of_squares"]) == list(right["sum_of_squares"])


def test_boards_say_how_it_was_trained(brief, method, tmp_path):
    results = tmp_path / "results"
    run(brief, [method(), "constant_friction"], results)
    board = boards(gripbench.read_rows(results), "mu_front", "any")[0]
    line = board.lines.set_index("label").loc["mean"]
    assert line["training"] == "fitted: 4 drives of brief@1"
    assert line["training_time"] > 0.0
    table = board_table(board)
    assert any(row["name"].startswith("mean§") for row in table.rows)
    assert any(note.startswith("mean§ fitted: 4 drives of brief@1, in ") for note in table.notes)
    assert not board.lines.set_index("label").loc["constant_friction", "training"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "reason"),
    [
        ("raise ValueError('no luck')", "ValueError: no luck (in fit, mean.py:"),
        ("return 1.0", "fit returned float; return a dict"),
        ("return {'mean': float('nan')}", "fit returned 'mean', which is not finite"),
        ("return {'mean': 'x'}", "fit returned 'mean' as str; return a number"),
        ("return {'mean': [[1.0], [1.0, 2.0]]}", "fit returned 'mean' as list"),
        ("return {'a b': 1.0}", "fit returned the name 'a b'; use a word"),
        ("return {'mean': np.zeros(3_000_000)}", "fit returned 22.9 MiB; at most 16 are kept"),
        ("import os; os._exit(3)", "its process exited with code 3"),
        ("recordings[0].truth['mu_front'][0] = 1.0", "assignment destination is read-only"),
        ("recordings[0].observations['speed_gps']", "no field of name speed_gps"),
    ],
)
def test_a_fit_that_fails_is_a_row_that_says_why(brief, method, tmp_path, before, reason):
    frame = run(brief, [method(before), "constant_friction"], tmp_path / "results")
    lines = frame.set_index("label")
    assert set(lines.loc[["mean"], "status"]) == {"failed"}
    assert all(text.startswith("its fit failed: ") for text in lines.loc[["mean"], "reason"])
    assert all(reason in text for text in lines.loc[["mean"], "reason"])
    assert set(lines.loc[["constant_friction"], "status"]) == {"ok"}
    assert not (tmp_path / "results" / "fits").exists()
    method()
    again = run(brief, str(tmp_path / "mean.py"), tmp_path / "results")
    assert set(again["status"]) == {"ok"}


def test_a_file_that_a_fit_reads_is_part_of_it(brief, method, tmp_path):
    weights = tmp_path / "prior.txt"
    weights.write_text("0.0")
    choice = method("self.ridge = float((HERE / 'prior.txt').read_text())")
    first = run(brief, choice, tmp_path / "results")
    weights.write_text("1e6")
    second = run(brief, choice, tmp_path / "results")
    assert not set(first["key"]) & set(second["key"])
    assert not set(first["sum_of_squares"]) & set(second["sum_of_squares"])


def test_seeds_for_training_are_refused_for_a_trained_method_alone(brief, method, tmp_path):
    first = TRAINING_SEEDS.start
    words = {"scenarios": [f"{brief}@1"], "results": tmp_path / "results", "workers": 1}
    for seeds in (f"{first - 1}:{first + 1}", f"{first + 500}:{first + 501}"):
        with pytest.raises(InputError, match="mean: is a trained method, and seed 1000000"):
            gripbench.run(methods=[method()], seeds=seeds, **words)
    assert not (tmp_path / "results").exists()
    frame = gripbench.run(methods=["constant_friction"], seeds=f"{first}:{first + 1}", **words)
    assert set(frame["status"]) == {"ok"}


WEIGHTS = """
class Weights:
    name = "weights"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    trained = {{"on": "straight_driving@1", "seeds": {seeds}, "drives": 8, "seconds": 2.5}}

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {{"mu_front": 0.6}}
"""


def test_a_method_that_was_fitted_on_test_seeds_elsewhere_is_refused(brief, tmp_path):
    path = tmp_path / "weights.py"
    path.write_text(WEIGHTS.format(seeds="(0, 8)"))
    with pytest.raises(InputError, match=r"weights: is a trained method, and seed 0 .* 0:8;"):
        run(brief, str(path), tmp_path / "results")
    frame = gripbench.run(
        scenarios=[f"{brief}@1"], methods=[str(path)], seeds="8:10", workers=1,
        results=tmp_path / "results",
    )  # fmt: skip
    assert list(frame["training"]) == ["declared: 8 drives of straight_driving@1"] * 2
    assert list(frame["training_time"]) == [2.5, 2.5]
    path.write_text(WEIGHTS.format(seeds="(8, 8)"))
    with pytest.raises(InputError, match=r"'trained'.*seeds 8 to 8"):
        choose_method(str(path))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('trained_on = "brief.toml"', "", "has 'fit', so set 'trained_on' to the name of the pop"),
        ("def fit(", "def fitting(", "has 'trained_on', so add the method 'fit"),
        ('"brief.toml"', "3", "set 'trained_on' to the name of a population"),
        ('"brief.toml"', '"cornring"', "unknown population or scenario 'cornring': did you mean"),
        ('"brief.toml"', '"nothing.toml"', "nothing.toml: no such file"),
        (
            '("accel_x",)',
            '("yaw_rate",)',
            "no drive of brief@1 serves it: the scenario has no",
        ),
        ('"brief.toml"', '"brief.toml"; training_truth = ("mue",)', "did you mean 'mu'"),
    ],
)
def test_what_a_method_says_of_its_training_is_checked(brief, method, tmp_path, old, new, words):
    with pytest.raises(InputError, match=words) as error:
        run(brief, method(text=(old, new)), tmp_path / "results")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "results").exists()


def test_a_population_gives_all_its_scenarios_a_car_of_its_own_each_drive(tmp_path):
    course = course_of(("straight_driving",), tmp_path, each=3)
    names = [scenario.name for scenario in course.scenarios]
    assert "friction_steps@1" in names
    assert not any(name.startswith("li2014_") for name in names)
    assert course.seeds == (10**9, 10**9 + 3 * len(names))
    assert course.name == "straight_driving@1"


numbers = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=4),
)


@given(st.dictionaries(st.from_regex(r"[a-z][a-z0-9_]{0,6}", fullmatch=True), numbers, max_size=4))
def test_numbers_survive_the_way_as_bytes(content):
    found = as_given(packed(numbers_of_fit(content)))
    assert found.keys() == content.keys()
    for name, value in content.items():
        assert np.array_equal(found[name], value)
        assert isinstance(value, list) or type(found[name]) is type(value)


@given(st.binary(max_size=60))
def test_odd_bytes_are_no_arrays(content):
    try:
        unpacked(content)
    except (ValueError, TypeError):
        return
    assert unpacked(packed(unpacked(content))).keys() == unpacked(content).keys()


def test_seeds_of_a_tuned_method_are_refused_too():
    training = Training(how="tuned", on="slalom_snow@1", seeds=(40, 60), drives=20)
    check_test_seeds("m", training, range(40))
    with pytest.raises(InputError, match="seed 40"):
        check_test_seeds("m", training, range(20, 41))


def test_a_fit_returns_no_tables_of_tables():
    with pytest.raises(GripbenchError, match="as dict"):
        numbers_of_fit({"nested": {"a": 1}})


def test_a_trained_method_is_checked_after_a_fit(brief, method):
    found = check_estimator(method(), [f"{brief}@1"])
    assert failures(found) == {}
    found = check_estimator(method("raise ValueError('no luck')"), [f"{brief}@1"])
    assert "its fit failed: ValueError: no luck" in next(iter(failures(found).values()))


COMPILED = """
import numpy as np
from gripbench import CompiledMethod, Parameter, compiled

@compiled
def step(state, obs, params, est):
    est.mu_front = params.level + params.slope * obs.accel_x

class Level(CompiledMethod):
    name = "level"; title = "Level"; reference = "None"
    sensors = ("accel_x",); estimates = ("mu_front",); state = np.dtype([("none", float)])
    parameters = (
        Parameter("level", 1.0, "-", "Level", 0.0, 2.0), Parameter("slope", 0.0, "-", "Slope")
    )
    trained_on = "brief.toml"
    step = staticmethod(step)

    def fit(self, recordings, budget):
        assert self.settings["level"] == 1.0
        return {"level": np.mean([r.truth["mu_front"].mean() for r in recordings])}
"""


@pytest.mark.slow
def test_what_a_compiled_method_fits_are_its_parameters(brief, tmp_path):
    path = tmp_path / "level.py"
    path.write_text(COMPILED)
    frame = run(brief, str(path), tmp_path / "results")
    recording = record(load_scenario(f"{brief}@1"), 0)
    error = expected(brief)[0] - recording.truth["mu_front"]
    assert frame["rms"].iloc[0] == pytest.approx(np.sqrt(np.mean(error**2)))
    path.write_text(COMPILED.replace('return {"level"', 'return {"levels"'))
    frame = run(brief, str(path), tmp_path / "results")
    assert "unknown parameter 'levels'" in frame["reason"].iloc[0]
