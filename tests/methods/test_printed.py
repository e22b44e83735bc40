"""Equations as papers print them: variants that call other functions than the method does."""

import importlib
import pkgutil

import numpy as np
import pytest

from gripbench import compiled_cache
from gripbench.bench.catalogue.registry import built_in_methods, choose_method, method_digest
from gripbench.compilation import compiled, inlined, replacing
from gripbench.methods import printed

MODULES = [
    importlib.import_module(f"{printed.__name__}.{module.name}")
    for module in pkgutil.iter_modules(printed.__path__)
]
FORMS = [
    (name, variant)
    for module in MODULES
    for name, forms in module.FORMS.items()
    for variant in forms
]


def test_every_file_of_printed_forms_belongs_to_methods_that_name_it():
    named = {
        (method.printed, name) for name, method in built_in_methods().items() if method.printed
    }
    assert named == {(module.__name__, name) for module in MODULES for name in module.FORMS}


@pytest.mark.parametrize(("name", "variant"), FORMS)
def test_a_form_is_a_variant_with_its_file_in_the_key(name, variant):
    spec = choose_method(f"{name}:{variant}")
    form = built_in_methods()[name].variants[variant]
    module = built_in_methods()[name].printed.rpartition(".")[2]
    assert spec.declaration.files == ((f"printed/{module}.py",) if form.functions else ())
    assert spec.digest == method_digest(spec.source, spec.declaration) != choose_method(name).digest


def test_no_method_has_a_switch_for_a_printed_form():
    for method in built_in_methods().values():
        assert not [one.name for one in method.parameters if "printed" in one.name]


@inlined
def _law(x):
    return 2.0 * x


@inlined
def _other_law(x):
    return 3.0 * x


@compiled
def _inner(x):
    return _law(x) + 1.0


@compiled
def _unconcerned(x):
    return x * x


@compiled
def _outer(x):
    return _inner(x) + _unconcerned(x)


def test_a_function_is_replaced_at_any_depth_and_nothing_else_is():
    other = replacing(_outer, {_law: _other_law}, "test")
    assert (_outer(3.0), other(3.0), _outer(3.0)) == (16.0, 19.0, 16.0)
    assert replacing(_unconcerned, {_law: _other_law}, "test") is _unconcerned
    assert replacing(_law, {_law: _other_law}, "test") is _other_law
    assert other.py_func.__globals__["_unconcerned"] is _unconcerned


def test_compiled_code_goes_stale_with_the_file_of_what_it_calls_instead(tmp_path):
    here, there = tmp_path / "here.py", tmp_path / "there.py"
    here.write_text("A = 1\n")
    there.write_text("B = 1\n")
    before = compiled_cache._stamp(str(here), str(there))
    there.write_text("B = 2\n")
    assert compiled_cache._stamp(str(here), str(there)) != before
    other = replacing(_outer, {_law: _other_law}, "test")
    assert other._cache._impl.locator._others == (__file__,)


def test_a_corrected_method_is_as_it_was_after_its_printed_form_ran():
    method = built_in_methods()["kinematic_kalman_filter"]
    samples = np.zeros(50, [(name, float) for name in (*method.sensors, "time")])
    samples["time"] = np.arange(50) * 0.01
    samples["yaw_rate"], samples["speed_gps"] = np.sin(samples["time"]), 20.0
    before, form, after = (method(v).run({}, samples) for v in ("corrected", "paper", "corrected"))
    assert before.tobytes() == after.tobytes() != form.tobytes()
