"""The name, file or class of a method in; where it comes from and what it declares out.

A method is known by name (built in, registered by decorator, or an entry point of the group
`gripbench.methods`) or by file (`path/to/file.py:Class`).
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import inspect
import pkgutil
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle  # type: ignore[import-untyped]
from pydantic import Field

from gripbench import methods as built_in
from gripbench.bench.catalogue.arrays import given_state
from gripbench.bench.catalogue.declarations import Declaration, Source, declaration_of
from gripbench.bench.catalogue.training import Trained, declared
from gripbench.configuration import Configuration, parse, read_toml
from gripbench.errors import InputError, unknown
from gripbench.extensions import entry_points
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.settings import Setting
from gripbench.sources import digest, source_digest

METHOD_GROUP = "gripbench.methods"

_registered: dict[str, Any] = {}

Class = TypeVar("Class", bound=type)


def register(method: Class) -> Class:
    """Make a class known by its `name`; a class decorator.

    Raises
    ------
    InputError
        If a built-in method has the name, or it is none.
    """
    name = getattr(method, "name", None)
    if not isinstance(name, str):
        raise InputError(f"{method.__name__}: set the class attribute 'name' before registering")
    if name in built_in_methods():
        raise InputError(f"{method.__name__}: the name '{name}' is that of a built-in method")
    _registered[name] = method
    return method


@functools.cache
def built_in_methods() -> Mapping[str, type[CompiledMethod]]:
    """Return the methods that ship with gripbench, by name."""
    found: dict[str, type[CompiledMethod]] = {}
    for module in pkgutil.walk_packages(built_in.__path__, built_in.__name__ + "."):
        for item in vars(importlib.import_module(module.name)).values():
            if (
                inspect.isclass(item)
                and issubclass(item, CompiledMethod)
                and item.__module__ == module.name
                and isinstance(getattr(item, "name", None), str)
                and not item.__name__.startswith("_")
            ):
                found[item.name] = item
    return dict(sorted(found.items()))


def method_names() -> dict[str, str]:
    """Return the names of all known methods, each with where it comes from."""
    names = dict.fromkeys(built_in_methods(), "built in")
    names |= {name: f"entry point {point.value}" for name, point in _methods_by_point().items()}
    names |= dict.fromkeys(_registered, "registered")
    return names


def _methods_by_point() -> dict[str, importlib.metadata.EntryPoint]:
    return {
        name: point
        for name, point in entry_points(METHOD_GROUP).items()
        if name not in built_in_methods()
    }


@dataclass(frozen=True)
class MethodSpec:
    """A method with its settings, ready to run in any process.

    Attributes
    ----------
    source
        Where to load it.
    declaration
        What it declares under these settings.
    variant, parameters
        What its constructor is given.
    isolated
        Whether it runs in a process of its own, as everything that is not built in.
    digest
        Digest of its source and settings.
    shown
        Label that tables show instead of the one that its settings make.
    trained
        How it was trained and what came of it; None: it was not, or not yet.
    unfitted
        Why its `fit` failed; empty: it did not.
    """

    source: Source
    declaration: Declaration
    variant: str
    parameters: dict[str, Any] = field(default_factory=dict)
    isolated: bool = True
    digest: str = ""
    shown: str = ""
    trained: Trained | None = None
    unfitted: str = ""

    @property
    def label(self) -> str:
        """Name that tables show: `name[:variant][@parameter=value,...]`."""
        if self.shown:
            return self.shown
        text = self.declaration.name
        if self.variant:
            text += f":{self.variant}"
        if self.parameters:
            settings = sorted(self.parameters.items())
            text += "@" + ",".join(f"{key}={value}" for key, value in settings)
        return text

    @property
    def state(self) -> bytes:
        """What its `fit` returned; empty: nothing is handed over."""
        return self.trained.state if self.trained else b""

    def make(self) -> Any:
        """Return a new estimator, with what its `fit` returned."""
        return given_state(self.source.make(self.variant, self.parameters), self.state)


def find_method(name: str) -> Source:
    """Return the source of a method by name or `file.py:Class`.

    Raises
    ------
    InputError
        If there is no such method; the message names the nearest one.
    """
    if ".py" in name:
        path, _, rest = name.partition(".py")
        return Source("file", f"{Path(path + '.py').resolve()}:{rest.removeprefix(':')}")
    if name in built_in_methods():
        method = built_in_methods()[name]
        return Source("module", f"{method.__module__}:{method.__qualname__}")
    if name in _registered:
        return _source_of_value(_registered[name])
    if name in _methods_by_point():
        return Source("module", _methods_by_point()[name].value)
    raise unknown("method", name, method_names())


def _source_of_value(method: Any) -> Source:
    kind = method if inspect.isclass(method) else type(method)
    if inspect.isclass(method) and kind.__module__ in {
        item.__module__ for item in built_in_methods().values()
    }:
        return Source("module", f"{kind.__module__}:{kind.__qualname__}")
    module = sys.modules.get(kind.__module__)
    file = getattr(module, "__file__", None)
    if inspect.isclass(method) and file and kind.__module__.startswith("gripbench_file_"):
        return Source("file", f"{file}:{kind.__qualname__}")
    return Source("value", kind.__qualname__, cloudpickle.dumps(method))


def split_choice(text: str) -> tuple[str, str, dict[str, Any]]:
    """Split `name[:variant][@parameter=value,...]` into its parts.

    In `file.py:Class:variant` the class comes before the variant.

    Examples
    --------
    >>> split_choice("slip_slope:paper@forgetting=0.99")
    ('slip_slope', 'paper', {'forgetting': 0.99})
    """
    place, at, settings = text.partition("@")
    head, dot, tail = place.rpartition(".py")
    name, *variant = tail.split(":")
    if dot:
        if name:
            raise InputError(f"method '{text}': '{name}' after '.py': {_FORM}")
        class_name = variant.pop(0) if variant else ""
        name = f"{head}.py:{class_name}" if class_name else f"{head}.py"
    if len(variant) > 1:
        raise InputError(f"method '{text}': more than one variant: {_FORM}")
    for part in (*variant, name.rpartition(".py")[2].lstrip(":") if dot else name):
        if part and not re.fullmatch(r"[\w.]+", part):
            raise InputError(f"method '{text}': '{part}' is no name: {_FORM}")
    parameters: dict[str, Any] = {}
    for item in settings.split(",") if at else ():
        key, equals, value = (part.strip() for part in item.partition("="))
        if not (key.isidentifier() and equals and value):
            raise InputError(f"method '{text}': '{item}' must be parameter=value: {_FORM}")
        if key in parameters:
            raise InputError(f"method '{text}': parameter '{key}' is given twice")
        parameters[key] = _value(value)
    return name, variant[0] if variant else "", parameters


_FORM = "give NAME[:VARIANT][@PARAMETER=VALUE,...] or FILE.py:CLASS[:VARIANT][@PARAMETER=VALUE,...]"


def _value(text: str) -> Setting:
    """Return a parameter's value: a whole number as such, a number, a yes or no, or a choice."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def choose_method(
    method: Any, variant: str = "", parameters: Mapping[str, Any] | None = None
) -> MethodSpec:
    """Return a method with its settings.

    Parameters
    ----------
    method
        A choice as `split_choice` takes it, the file of a `NamedVariant`, a class, or an instance.
    variant, parameters
        Settings, beside those in a text.

    Raises
    ------
    InputError
        If it is unknown, cannot be loaded or takes no such settings.
    """
    settings = dict(parameters or {})
    if isinstance(method, str) and method.endswith(".toml"):
        return _named_variant(Path(method), settings)
    if isinstance(method, str):
        name, chosen, given = split_choice(method)
        variant = variant or chosen
        settings = given | settings
        source = find_method(name)
    else:
        source = _source_of_value(method)
    if variant == "corrected" and not source.payload:
        variant = ""  # the default of every built-in: one name for one thing
    isolated = is_isolated(source)
    if isolated and source.kind != "value":
        from gripbench.bench.running.isolation.sandbox import (
            declare,  # a plug-in's code runs in its sandbox only
        )

        declaration = declare(source, variant, settings)
    else:
        declaration = declaration_of(source.make(variant, settings), variant, settings)
    if isolated and declaration.name in built_in_methods():
        raise InputError(
            f"{source.target}: the name '{declaration.name}' is that of a built-in method; "
            "give yours another"
        )
    return MethodSpec(
        source=source,
        declaration=declaration,
        variant=variant,
        parameters=settings,
        isolated=isolated,
        digest=method_digest(source, declaration),
        trained=declared(declaration.trained),
    )


class NamedVariant(Configuration):
    """A method's settings under a name of their own, with the record of where they come from.

    Attributes
    ----------
    method
        Choice `name[:variant]` whose settings these are.
    name
        Name of the variant.
    settings
        Values of parameters.
    record
        How they were found, as `gripbench tune --out` writes it.
    """

    method: str
    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    settings: dict[str, float | str | bool] = Field(default_factory=dict)
    record: dict[str, Any] = Field(default_factory=dict)


def _named_variant(path: Path, settings: Mapping[str, Any]) -> MethodSpec:
    given = parse(NamedVariant, read_toml(path), path)
    try:
        spec = choose_method(given.method, parameters=given.settings | dict(settings))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    training = given.record.get("training")
    trained = spec.trained
    if training is not None:
        trained = declared({**training, "seconds": given.record.get("seconds")})
    form = f":{spec.variant}" if spec.variant else ""
    shown = f"{spec.declaration.name}{form}@{given.name}"
    return replace(spec, shown=shown, trained=trained)


def is_isolated(source: Source) -> bool:
    """Return whether a method's code runs in a process of its own: it does not ship with us."""
    return not (source.kind == "module" and source.target.startswith("gripbench.methods."))


def method_digest(source: Source, declaration: Declaration) -> str:
    """Return the digest of a method's source and settings, from what is in its files now."""
    files = [Path(declaration.file)] if declaration.file else []
    if source.kind == "file":
        files.append(Path(source.target.rpartition(":")[0]))  # it may make the class of another
    code = source_digest(*(path for path in files if path.is_file()))
    for name in declaration.files:
        place = (files[-1].parent if files else Path()) / name
        try:
            content = hashlib.sha256(place.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(
                f"{declaration.name}: 'files' names '{name}', and {place} cannot be read: "
                f"{(error.strerror or str(error)).lower()}"
            ) from None
        code = digest(code, name, content)
    if source.kind == "value":
        code = digest(code, repr(source.payload))
    settings = sorted(declaration.settings.items())
    return digest(code, source.target.rpartition(":")[2], declaration.variant, repr(settings))
