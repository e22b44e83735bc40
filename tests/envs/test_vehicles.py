"""Vehicle files: what ships is complete and sourced, mistakes are named."""

import pytest

from gripbench.envs.vehicles import VEHICLE_PARAMETERS, load_vehicle, require, vehicle_files
from gripbench.errors import InputError


@pytest.mark.parametrize("name", sorted(vehicle_files()))
def test_shipped_vehicles(name):
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    for key, given in vehicle.parameters.items():
        assert key in VEHICLE_PARAMETERS
        assert given.source


def test_table_iii_with_its_erratum():
    vehicle = load_vehicle("li2014")
    values = vehicle.values()
    assert values["mass"] == 1298.9
    assert (values["magic_b"], values["magic_c"], values["magic_e"]) == (20.0, 1.5, -0.5)
    assert values["rolling_resistance"] == 0.005  # Table III prints 1.5
    assert vehicle.parameters["rolling_resistance"].guess
    assert not vehicle.parameters["mass"].guess


def _write(tmp_path, line):
    path = tmp_path / "car.toml"
    path.write_text(f'name = "car"\ndescription = "Test"\n[parameters]\n{line}\n')
    return path


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('mass = { value = 0.0, source = "x" }', "mass.value is 0 kg; allowed is 0.1 to 100000"),
        ('mass = { value = -5.0, source = "x" }', "mass.value is -5 kg"),
        ('mass = { value = nan, source = "x" }', "parameters.mass.value.*finite"),
        ('mass = { value = "heavy", source = "x" }', "parameters.mass.value.*valid number"),
        ("mass = { value = 1000.0 }", "missing key 'parameters.mass.source'"),
        ('mass = { value = 1.0, sourc = "x", source = "y" }', "did you mean 'source'"),
        ('masss = { value = 1000.0, source = "x" }', "'masss': did you mean 'mass'"),
        ('rolling_resistance = { value = 1.5, source = "Table III" }', "allowed is 0 to 0.2"),
        ("mass = 1000.0", "key 'parameters.mass'"),
    ],
)
def test_mistakes_name_file_key_and_remedy(tmp_path, line, message):
    path = _write(tmp_path, line)
    with pytest.raises(InputError, match=message) as caught:
        load_vehicle(str(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_unknown_vehicle():
    with pytest.raises(InputError, match="unknown vehicle 'li2041': did you mean 'li2014'"):
        load_vehicle("li2041")


def test_require_names_reader_and_parameter():
    assert require({"a": 1.0, "b": 2.0}, ("a",), "it") == {"a": 1.0}
    with pytest.raises(InputError, match="the plant needs the vehicle parameter 'b'"):
        require({"a": 1.0}, ("a", "b"), "the plant")
