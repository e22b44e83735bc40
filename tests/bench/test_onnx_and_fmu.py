"""Networks in ONNX files and FMUs: the numbers of a twin in Python, the same checks, their keys."""

import inspect
import runpy
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

import gripbench
from gripbench.bench.catalogue.declarations import Source, declaration_of
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running.execution import run_online
from gripbench.bench.running.store import Store
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import GripbenchError, InputError

onnx = pytest.importorskip("onnx", reason="needs the packages onnx and onnxruntime")
pytest.importorskip("onnxruntime", reason="needs the package onnxruntime")
fmpy = pytest.importorskip("fmpy", reason="needs the package fmpy")

PLUGINS = Path(__file__).parent / "plugins"
EXAMPLES = Path(__file__).parents[2] / "examples"
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

DECLARED = """
from gripbench import Fmu, Parameter

class Unit(Fmu):
    name = "smoothed_{name}"
    {file}
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", -1.0),)
"""
TWIN = """
class Twin:
    name = "twin"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)

    def reset(self, vehicle, dt):
        self.mass, self.smooth, self.before = vehicle["mass"], 0.0, 0.0

    def update(self, obs):
        elapsed = obs["time"] - self.before
        self.before = obs["time"]
        self.smooth += elapsed / (0.05 + elapsed) * (obs["accel_x"] - self.smooth)
        return {"force_x_front": 0.5 * self.mass * self.smooth}
"""


def network(path, external="", **changes):
    """Write the low-pass as a network: a state, its next value, the force."""
    low_pass = runpy.run_path(str(EXAMPLES / "onnx" / "make_network.py"))["low_pass"]
    model = low_pass(**changes)
    onnx.checker.check_model(model)
    outside = {"save_as_external_data": True, "location": external, "size_threshold": 0}
    onnx.save(model, path, **(outside if external else {}))


def onnx_method(folder, **changes):
    network(folder / "smoothed_force.onnx", **changes)
    shutil.copy(EXAMPLES / "onnx" / "smoothed_force_onnx.py", folder)
    return folder / "smoothed_force_onnx.py"


DESCRIPTION_2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="smoothed_force" guid="{{1}}">
<CoSimulation modelIdentifier="smoothed_force" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<ScalarVariable name="{accel}" valueReference="0" causality="input" variability="continuous">
<Real start="0"/></ScalarVariable>
<ScalarVariable name="mass" valueReference="1" causality="parameter" variability="fixed">
<Real start="0"/></ScalarVariable>
<ScalarVariable name="time_constant" valueReference="2" causality="parameter" variability="fixed">
<Real start="0.05"/></ScalarVariable>
<ScalarVariable name="force_x_front" valueReference="3" causality="output"><Real/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="4"/></Outputs></ModelStructure>
</fmiModelDescription>
"""
DESCRIPTION_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="smoothed_force" instantiationToken="{{1}}">
<CoSimulation modelIdentifier="smoothed_force" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<Float64 name="{accel}" valueReference="0" causality="input" start="0"/>
<Float64 name="mass" valueReference="1" causality="parameter" variability="fixed" start="0"/>
<Float64 name="time_constant" valueReference="2" causality="parameter" variability="fixed"
 start="0.05"/>
<Float64 name="force_x_front" valueReference="3" causality="output"/>
<Float64 name="time" valueReference="4" causality="independent" variability="continuous"/>
</ModelVariables>
<ModelStructure><Output valueReference="3"/></ModelStructure>
</fmiModelDescription>
"""


def fmu_method(folder, version, change=("", ""), accel="accel_x"):
    """Build a unit of FMI 2 or 3 from C, and the class beside it."""
    from fmpy import fmi2, fmi3, platform, platform_tuple

    text = (PLUGINS / "smoothed_force_fmu.c").read_text().replace(*change)
    kind = fmi2.FMU2Slave if version == 2 else fmi3.FMU3Slave
    names = [name for name, _ in inspect.getmembers(kind) if name.startswith(f"fmi{version}")]
    stubs = " ".join(f"STUB({name})" for name in names if f"{name}(" not in text)
    (folder / "unit.c").write_text(text)
    library = folder / "smoothed_force.so"
    flags = ["-w", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-DSTUBS={stubs}"]
    flags += ["-DFMI3"] if version == 3 else []
    subprocess.run(["gcc", *flags, "-o", library, folder / "unit.c"], check=True)
    description = DESCRIPTION_2 if version == 2 else DESCRIPTION_3
    with zipfile.ZipFile(folder / f"unit{version}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description.format(accel=accel))
        place = platform if version == 2 else platform_tuple
        archive.write(library, f"binaries/{place}/smoothed_force.so")
    source = folder / f"fmu{version}.py"
    file = f'fmu = "unit{version}.fmu"; variables = {{"accel_x": "{accel}"}}'
    source.write_text(DECLARED.format(name=f"fmu{version}", file=file))
    return source


@pytest.fixture
def units(tmp_path, monkeypatch):
    """A folder for methods, with a place of its own for what is unpacked."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def estimates(path, recording, parameters=None):
    method = Source("file", f"{path}:").make("", parameters or {})
    found = run_online(method, declaration_of(method), recording.vehicle, recording.observations)
    return found["force_x_front"]


@needs_gcc
def test_network_fmu_and_python_give_the_same_estimates(units, short_scenario):
    (units / "twin.py").write_text(TWIN)
    recording = record(load_scenario(short_scenario), 0)
    expected = estimates(units / "twin.py", recording)
    paths = [onnx_method(units), fmu_method(units, 2), fmu_method(units, 3, accel="a_x")]
    for path in paths:
        found = estimates(path, recording)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
        slow = estimates(path, recording, {"time_constant": 0.5})
        assert not np.allclose(slow, expected, rtol=0.1)


@pytest.mark.slow
@needs_gcc
def test_they_rank_beside_built_in_ones_and_run_again_when_their_files_change(
    units, short_scenario, tmp_path
):
    paths = [onnx_method(units), fmu_method(units, 2), fmu_method(units, 3)]
    results = tmp_path / "results"
    choices = [*map(str, paths), "force_of_acceleration", "specific_force:longitudinal"]

    def run():
        frame = gripbench.run(
            scenarios=[short_scenario], methods=choices, results=results, workers=1
        )
        return frame[frame["target"] == "force_x_front"].set_index("label")

    first = run()
    names = ["smoothed_force_onnx", "smoothed_fmu2", "smoothed_fmu3"]
    assert dict(first.loc[names, "status"]) == dict.fromkeys(names, "ok")
    np.testing.assert_allclose(first.loc[names, "rms"], first.loc[names[0], "rms"], rtol=1e-12)
    board = gripbench.rank(gripbench.read_rows(results), target="force_x_front", sensors="any")
    assert set(board["label"]) >= {*names, "force_of_acceleration"}
    rows = {row.label: row for row in Store(results).read_all()}
    for name in names:
        assert not rows[name].untracked
        assert not any("/gripbench_fmu" in key for key in rows[name].dependencies)
    assert (run()["key"] == first["key"]).all()
    network(units / "smoothed_force.onnx", share_of_mass=0.6)
    for version in (2, 3):
        fmu_method(units, version, change=("0.5 * u->value[1]", "0.6 * u->value[1]"))
    second = run()
    assert (second.loc[names, "key"] != first.loc[names, "key"]).all()
    assert (second.loc[names, "rms"] != first.loc[names, "rms"]).all()
    for path, file in zip(paths, ("smoothed_force.onnx", "unit2.fmu", "unit3.fmu"), strict=True):
        (units / file).unlink()
        with pytest.raises(InputError, match=file):
            choose_method(str(path))


def test_weights_beside_a_network_are_part_of_the_key(tmp_path):
    source = onnx_method(tmp_path, external="net.weights")
    first = choose_method(str(source))
    assert first.declaration.files == ("smoothed_force.onnx", "net.weights")
    weights = tmp_path / "net.weights"
    weights.write_bytes(np.full(1, 0.7).tobytes())
    assert choose_method(str(source)).digest != first.digest
    weights.unlink()
    with pytest.raises(InputError, match=r"net\.weights"):
        choose_method(str(source))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"state": "memory"}, "the input 'memory' is none of sample, elapsed"),
        ({"kind": 10}, r"the input 'sample' is a tensor\(float16\)"),
    ],
)
def test_a_network_that_does_not_fit_says_where(tmp_path, change, words):
    source = onnx_method(tmp_path, **change)
    with pytest.raises(InputError, match=words) as error:
        choose_method(str(source))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"no network", b"\x08\x09"])
def test_what_is_no_network_or_unit_is_one_line(units, content):
    source = onnx_method(units)
    (units / "smoothed_force.onnx").write_bytes(content)
    (units / "unit2.fmu").write_bytes(content)
    fmu = units / "fmu2.py"
    fmu.write_text(DECLARED.format(name="fmu2", file='fmu = "unit2.fmu"'))
    for path, words in (
        (source, r"smoothed_force\.onnx: cannot be used"),
        (fmu, r"unit2\.fmu: cannot be"),
    ):
        with pytest.raises(InputError, match=words) as error:
            choose_method(str(path))
        assert "\n" not in str(error.value)


def test_a_state_of_single_precision_and_missing_channels_hold(tmp_path):
    source = onnx_method(tmp_path, kind=onnx.TensorProto.FLOAT)
    method = Source("file", f"{source}:").make("", {})
    method.reset({"mass": 1000.0}, 0.1)
    nan = float("nan")
    assert method.update({"accel_x": nan, "time": 0.0}) == {"force_x_front": 0.0}
    assert method.update({"accel_x": 1.0, "time": 0.1}) == {"force_x_front": 0.0}
    first = method.update({"accel_x": 1.0, "time": 0.15})["force_x_front"]
    assert first == pytest.approx(250.0, rel=1e-6)
    assert method.update({"accel_x": 9.0, "time": 0.15}) == {"force_x_front": first}
    assert method.update({"accel_x": nan, "time": 0.2})["force_x_front"] == pytest.approx(2375.0)


@needs_gcc
@pytest.mark.parametrize("version", [2, 3])
def test_a_unit_that_goes_wrong_says_where(units, short_scenario, version):
    source = fmu_method(units, version)
    recording = record(load_scenario(short_scenario), 0)
    with pytest.raises(GripbenchError, match=rf"unit{version}\.fmu: fmi{version}DoStep"):
        estimates(source, recording, {"time_constant": -1.0})
    source.write_text(source.read_text().replace('"accel_x": "accel_x"', '"accel_x": "accel_y"'))
    with pytest.raises(InputError, match=r"has no input 'accel_y': did you mean 'accel_x'"):
        choose_method(str(source))


@needs_gcc
def test_a_damaged_copy_of_a_unit_is_unpacked_again(units):
    from gripbench.methods.foreign.fmu import unpacked

    fmu_method(units, 2)
    folder = unpacked(units / "unit2.fmu")
    library = next(folder.rglob("*.so"))
    content = library.read_bytes()
    library.write_bytes(content[:-1] + b"?")
    assert unpacked(units / "unit2.fmu") == folder
    assert next(folder.rglob("*.so")).read_bytes() == content
