"""Methods, scenarios and suites by name, file, decorator and entry point."""

from pathlib import Path

import pytest

import gripbench
from gripbench.bench.catalogue import registry
from gripbench.bench.catalogue.registry import choose_method, method_names, split_choice
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.configuration import CONFIGS
from gripbench.errors import InputError


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("rls", ("rls", "", {})),
        ("rls:paper", ("rls", "paper", {})),
        ("rls@a=1,b=2.5", ("rls", "", {"a": 1.0, "b": 2.5})),
        ("dir/a.py", ("dir/a.py", "", {})),
        ("dir/a.py:My", ("dir/a.py:My", "", {})),
        ("dir/a.py:My:paper@a=1", ("dir/a.py:My", "paper", {"a": 1.0})),
    ],
)
def test_a_choice_splits_into_name_variant_and_parameters(text, parts):
    assert split_choice(text) == parts


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("slip_slop", "unknown method 'slip_slop': did you mean 'slip_slope'"),
        ("slip_slope:papre", "did you mean 'paper'"),
        ("slip_slope@forgeting=1", "unknown parameter 'forgeting'"),
        ("slip_slope@forgetting=x", "parameter 'forgetting' is 'x'; allowed is"),
        ("slip_slope@forgetting", "must be parameter=value"),
        ("slip_slope:a:b", "more than one variant"),
        ("nowhere.py:A", "no such file"),
    ],
)
def test_a_wrong_choice_is_one_line(text, message):
    with pytest.raises(InputError, match=message) as caught:
        choose_method(text)
    assert "\n" not in str(caught.value)


def test_a_decorated_class_is_known_by_name_and_runs(short_scenario, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})

    @gripbench.register
    class Half:
        name = "half"
        sensors = ("accel_x",)
        estimates = ("mu_front",)

        def reset(self, vehicle, dt):
            pass

        def update(self, obs):
            return {"mu_front": 0.5}

    assert method_names()["half"] == "registered"
    rows = gripbench.run(scenarios=[short_scenario], methods=["half"], results=tmp_path, workers=1)
    assert list(rows["status"]) == ["ok"]
    assert rows["rms"].iloc[0] == pytest.approx(0.4)


def test_the_name_of_a_built_in_method_cannot_be_taken():
    with pytest.raises(InputError, match="name 'slip_slope' is that of a built-in"):
        gripbench.register(type("Mine", (), {"name": "slip_slope"}))


@pytest.fixture
def installed(monkeypatch, tmp_path):
    """A function that puts a package with these files and entry points on the path."""

    def install(files, entry_points):
        site = tmp_path / "site-packages"
        for name, text in files.items():
            (site / name).parent.mkdir(parents=True, exist_ok=True)
            (site / name).write_text(text, encoding="utf-8")
        information = site / "a_plugin-1.0.dist-info"
        information.mkdir()
        (information / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: a-plugin\nVersion: 1.0\n"
        )
        (information / "entry_points.txt").write_text(entry_points, encoding="utf-8")
        monkeypatch.syspath_prepend(str(site))

    return install


def test_an_installed_package_brings_a_method(installed, plugins, tmp_path, short_scenario):
    source = (plugins / "faulty.py").read_text(encoding="utf-8")
    installed({"a_plugin.py": source}, "[gripbench.methods]\nsound = a_plugin:Sound\n")
    assert method_names()["sound"] == "entry point a_plugin:Sound"
    rows = gripbench.run(
        scenarios=[short_scenario], methods=["sound"], results=tmp_path / "r", workers=1
    )
    assert list(rows["status"]) == ["ok"]


def test_an_installed_package_brings_scenarios(installed, short_scenario):
    text = Path(short_scenario).read_text(encoding="utf-8")
    code = "from pathlib import Path\n\nFOLDER = Path(__file__).parent / 'scenarios'\n"
    installed(
        {
            "a_plugin_of_scenarios/__init__.py": code,
            "a_plugin_of_scenarios/scenarios/short.toml": text,
        },
        "[gripbench.scenarios]\nmine = a_plugin_of_scenarios:FOLDER\n",
    )
    assert find_scenario("short").horizon == 1.0


def test_unknown_scenarios_and_suites_suggest_the_nearest():
    with pytest.raises(InputError, match="did you mean 'constant_mu'"):
        find_scenario("constant_my")
    with pytest.raises(InputError, match="did you mean 'longitudinal'"):
        load_suite("longitudinl")


@pytest.mark.parametrize("name", suite_files())
def test_every_suite_that_ships_names_what_exists(name):
    suite = load_suite(name)
    assert suite.name == name
    for scenario in suite.scenarios:
        find_scenario(scenario)
    labels = [spec.label for spec in suite.specs()]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("seeds = 100", "seds = 100"), "unknown key 'seds': did you mean 'seeds'"),
        (("seeds = 100", "seeds = 0"), "key 'seeds'"),
        (("seeds = 100", 'seeds = "many"'), "key 'seeds'"),
        (('name = "longitudinal"', ""), "missing key 'name'"),
    ],
)
def test_a_mistake_in_a_suite_names_file_and_key(tmp_path, change, message):
    text = (CONFIGS / "suites" / "longitudinal.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_suite(str(path))
    assert str(path) in str(caught.value)
