"""What a method declares, read once and checked: the only thing the harness knows about it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import math
import pickle
import re
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from gripbench.bench.catalogue.making import make
from gripbench.bench.catalogue.training import checked_training, training_of
from gripbench.envs.signals import SIGNALS, signal
from gripbench.errors import (
    LONGEST,
    GripbenchError,
    InputError,
    describe_error,
    nearest,
    one_line,
    unknown,
)
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.outputs import checked_quantiles, fields_of


@dataclass(frozen=True)
class Declaration:
    """What a method says of itself; see `gripbench.methods.contract` and `catalogue.training`."""

    name: str
    title: str
    reference: str
    sensors: tuple[str, ...]
    estimates: tuple[str, ...]
    variances: tuple[str, ...]
    vehicle_parameters: tuple[str, ...]
    variant: str
    settings: dict[str, float | str | bool | None]
    file: str
    baseline: bool = False
    files: tuple[str, ...] = ()
    fits: bool = False
    trained_on: tuple[str, ...] = ()
    training_truth: tuple[str, ...] = ()
    trained: dict[str, Any] | None = None
    ranges: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    quantiles: dict[str, tuple[float, ...]] = field(default_factory=dict)
    innovations: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    lag: float = 0.0

    @property
    def outputs(self) -> tuple[str, ...]:
        """Fields of its estimates: signals, variances, quantiles, innovations."""
        return fields_of(self.estimates, self.variances, self.quantiles, self.innovations)

    @property
    def idealised(self) -> tuple[str, ...]:
        """Those of its sensors that no vehicle has."""
        return tuple(name for name in self.sensors if signal(name).idealised)


@dataclass(frozen=True)
class Source:
    """Where a method comes from; small and picklable, so that any process can load it.

    Attributes
    ----------
    kind
        `module` (`package.module:Class`), `file` (`/path/to/file.py:Class`, the class may be left
        out where the file has one method) or `value` (a class or an instance, pickled).
    target
        As above; for `value` its name.
    payload
        The pickle of a `value`.
    """

    kind: Literal["module", "file", "value"]
    target: str
    payload: bytes = field(default=b"", repr=False)

    def load(self) -> Any:
        """Return the class (or another callable that makes an estimator, or an instance)."""
        if self.kind == "value":
            return pickle.loads(self.payload)
        place, _, name = self.target.rpartition(":")
        if self.kind == "module":
            return getattr(importlib.import_module(place), name)
        path = Path(place)
        module = load_file(path)
        return _class_in(module, name, path)

    def make(self, variant: str, parameters: Mapping[str, Any]) -> Any:
        """Return a new estimator.

        Raises
        ------
        InputError
            If it takes no such variant or parameter.
        """
        return make(self.load(), variant, parameters, self.target)


def declaration_of(
    method: Any, variant: str = "", parameters: Mapping[str, Any] = {}
) -> Declaration:
    """Return what an estimator declares.

    Parameters
    ----------
    method
        An instance.
    variant, parameters
        With which it was made, for a plain class, which does not keep them.

    Raises
    ------
    InputError
        If a declaration is missing or names a signal that does not exist.
    """
    compiled = isinstance(method, CompiledMethod)
    given = {item: getattr(method, item, None) for item in _READ}
    name = given["name"] if isinstance(given["name"], str) else type(method).__name__
    for function in ("reset", "update"):
        whole = callable(getattr(method, "run", None)) and not hasattr(method, "update")
        if not whole and not callable(getattr(method, function, None)):
            raise InputError(f"{name}: add the method '{function}' (see 'gripbench new method')")
    if compiled:
        check_names(f"{name}: 'parameters'", [item.name for item in method.parameters])
        check_names(f"{name}: 'variants'", list(method.variants))
    own = (method.variant, method.settings) if compiled else (variant, parameters)
    given |= training_of(method, parameters) | {"variant": own[0], "settings": dict(own[1])}
    given["file"] = str(getattr(sys.modules.get(type(method).__module__), "__file__", None) or "")
    return declaration_from(given, type(method).__name__)


_READ = (
    "name", "title", "reference", "sensors", "estimates", "variances", "quantiles", "innovations",
    "vehicle_parameters", "files", "packages", "lag", "baseline",
)  # fmt: skip

LONGEST_NAME = 100
"""Largest number of characters of a name, which is also that of a file."""

_OF_WINDOWS = {
    "con", "prn", "aux", "nul", "conin$", "conout$",
    *(f"{port}{number}" for port in ("com", "lpt") for number in range(10)),
}  # fmt: skip


def declaration_from(given: Mapping[str, Any], kind: str = "method") -> Declaration:
    """Return a declaration from attributes, after checking each.

    Parameters
    ----------
    given
        The fields of a `Declaration`, as a method has them or its process sent them.
    kind
        What to call the method where it has no name.

    Raises
    ------
    InputError
        If one is missing, is not of its type or names a signal that does not exist.
    """
    name = given.get("name")
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(
            f"{kind}: set the class attribute 'name' to a string of lower case letters, digits "
            f"and underscores (it is {one_line(repr(name), 120)})"
        )
    check_names("'name'", [name])
    title = given.get("title")
    title = one_line(name if title is None else str(title), LONGEST)
    sensors = _signals(given, name, "sensors", required=True)
    estimates = _signals(given, name, "estimates", required=True)
    variances = _signals(given, name, "variances")
    for estimate in variances:
        if estimate not in estimates:
            raise InputError(f"{name}: 'variances' names '{estimate}', which it does not estimate")
    lag = given.get("lag") or 0.0
    if not isinstance(lag, float | int) or not 0.0 <= lag < math.inf:
        raise InputError(f"{name}: set 'lag' to seconds, 0 or more (it is {str(lag)[:120]!r})")
    settings, variant = given.get("settings"), given.get("variant")
    if not isinstance(settings, Mapping) or not isinstance(variant, str):
        raise InputError(f"{name}: its settings are no table of values")
    for key, value in settings.items():
        if not isinstance(key, str) or not isinstance(value, float | int | str | bool | None):
            raise InputError(f"{name}: the setting '{key}' is {type(value).__name__}")
    return Declaration(
        name=name,
        title=title,
        reference=one_line(str(given.get("reference") or ""), 2 * LONGEST),
        sensors=sensors,
        estimates=estimates,
        variances=variances,
        vehicle_parameters=_names(given, name, "vehicle_parameters", "vehicle parameter"),
        variant=variant,
        settings=dict(settings),
        file=str(given.get("file") or ""),
        baseline=bool(given.get("baseline")),
        files=_files(given, name),
        **checked_training(given, name),
        quantiles=checked_quantiles(name, given.get("quantiles"), estimates, variances),
        innovations=_signals(given, name, "innovations"),
        packages=_names(given, name, "packages", "package"),
        lag=float(lag),
    )


def _files(given: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """Return the data files that a method declares, relative to its own file."""
    files = given.get("files") or ()
    if not isinstance(files, list | tuple) or not all(
        isinstance(item, str) and item and "\0" not in item for item in files
    ):
        raise InputError(
            f"{name}: set 'files' to a tuple of file names, such as ('net.npz',) "
            f"(it is {one_line(repr(files), 120)})"
        )
    return tuple(files)


def check_names(what: str, names: Sequence[Any]) -> None:
    """Raise InputError unless names are different ones that any system can store.

    Parameters
    ----------
    what
        What they are the names of, for the message.
    names
        Names of methods, variants, parameters or scenarios.
    """
    for name in names:
        if not isinstance(name, str) or not name:
            raise InputError(f"{what}: a name is {one_line(repr(name), 120)}; give a text")
        wrong = (
            f"has {len(name)} characters; at most {LONGEST_NAME} are allowed"
            if len(name) > LONGEST_NAME
            else "is a name that an operating system keeps for itself"
            if name.split(".")[0].lower() in _OF_WINDOWS
            else "ends in a dot or a space, which not every system can store"
            if name[-1] in ". "
            else "holds a character that not every system can store; use letters, digits, _ and -"
            if re.search(r'[<>:"/\\|?*\x00-\x1f\x7f\ud800-\udfff]', name)
            else ""
        )
        if wrong:
            raise InputError(f"{what}: the name {one_line(repr(name), 120)} {wrong}")
        if list(names).count(name) > 1:
            raise InputError(f"{what} holds '{name}' twice")


def _signals(
    given: Mapping[str, Any], name: str, attribute: str, required: bool = False
) -> tuple[str, ...]:
    value = _names(given, name, attribute, "signal", required)
    for item in value:
        try:
            signal(item)
        except GripbenchError:
            raise InputError(
                f"{name}: '{attribute}' names the unknown signal '{one_line(item, 120)}': "
                f"{nearest(item, SIGNALS)}"
            ) from None
    if "time" in value:
        raise InputError(f"{name}: '{attribute}' names 'time', which every sample carries anyway")
    return value


def _names(
    given: Mapping[str, Any], name: str, attribute: str, of: str, required: bool = False
) -> tuple[str, ...]:
    value = given.get(attribute)
    if value is None and not required:
        return ()
    if (
        not isinstance(value, list | tuple)
        or (required and not value and attribute != "sensors")  # a constant reads nothing
        or not all(isinstance(item, str) for item in value)
    ):
        raise InputError(
            f"{name}: set the class attribute '{attribute}' to a tuple of {of} names, such as "
            f"('{'mass' if of == 'vehicle parameter' else 'accel_x'}',) "
            f"(it is {one_line(repr(value), 120)})"
        )
    for item in value:
        if value.count(item) > 1:
            raise InputError(f"{name}: '{attribute}' names '{one_line(item, 120)}' twice")
    return tuple(value)


def load_file(path: Path) -> ModuleType:
    """Import a Python file under a name of its own; its folder's modules can be imported by it.

    Raises
    ------
    InputError
        If the file is missing or cannot be imported.
    """
    path = path.resolve()
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    name = f"gripbench_file_{path.stem}_{zlib.crc32(str(path).encode()):08x}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: not a Python file")
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # before it runs, so that its classes can be pickled
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        raise InputError(f"{path}: cannot be imported: {describe_error(error)}") from None
    return module


def _class_in(module: ModuleType, name: str, path: Path) -> Any:
    methods = {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value) and value.__module__ == module.__name__ and _may_be_method(value)
    }
    if name:
        if not hasattr(module, name):
            raise unknown(f"class in {path}:", name, methods)
        return getattr(module, name)
    if len(methods) != 1:
        found = ", ".join(sorted(methods)) or "none"
        raise InputError(f"{path}: name the class, as in {path.name}:MyFilter (found: {found})")
    return next(iter(methods.values()))


def _may_be_method(kind: type) -> bool:
    """Return whether a class takes samples one by one, or declares itself and takes recordings."""
    if callable(getattr(kind, "update", None)):
        return callable(getattr(kind, "reset", None))
    return callable(getattr(kind, "run", None)) and hasattr(kind, "estimates")
