"""What a method declares, read once and checked: the only thing the harness knows about it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pickle
import re
import sys
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from gripbench.envs.signals import SIGNALS, VARIANCE, signal
from gripbench.errors import GripbenchError, InputError, nearest, unknown
from gripbench.methods.contract import CompiledMethod


@dataclass(frozen=True)
class Declaration:
    """What a method says of itself; see `gripbench.methods.contract` for the attributes."""

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

    @property
    def outputs(self) -> tuple[str, ...]:
        """Fields of its estimates: the signals, then their variances."""
        return (*self.estimates, *(name + VARIANCE for name in self.variances))

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


def make(factory: Any, variant: str, parameters: Mapping[str, Any], name: str) -> Any:
    """Return a new estimator of a class, or an instance as it is."""
    arguments = dict(parameters)
    if not callable(factory):  # an instance carries its settings already
        if arguments or variant:
            raise InputError(f"{name}: an instance takes no variant or parameters any more")
        return factory
    if variant:
        arguments["variant"] = variant
    try:
        known = inspect.signature(factory).parameters
    except (TypeError, ValueError):
        known = inspect.signature(lambda **_: None).parameters
    flexible = any(item.kind is item.VAR_KEYWORD for item in known.values())
    for key in arguments:
        if key not in known and not flexible:
            kind = "variant" if key == "variant" else f"parameter '{key}'"
            raise InputError(f"{name}: it takes no {kind}: {nearest(key, known) or 'none'}")
    return factory(**arguments)


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
    kind = type(method).__name__
    name = getattr(method, "name", None)
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(
            f"{kind}: set the class attribute 'name' to a string of lower case letters, digits "
            f"and underscores (it is {name!r})"
        )
    for function in ("reset", "update"):
        if not callable(getattr(method, function, None)):
            raise InputError(f"{name}: add the method '{function}' (see 'gripbench new method')")
    sensors = _names(method, name, "sensors", required=True)
    estimates = _names(method, name, "estimates", required=True)
    variances = _names(method, name, "variances")
    for estimate in variances:
        if estimate not in estimates:
            raise InputError(f"{name}: 'variances' names '{estimate}', which it does not estimate")
    compiled = isinstance(method, CompiledMethod)
    module = sys.modules.get(type(method).__module__)
    return Declaration(
        name=name,
        title=str(getattr(method, "title", name)),
        reference=str(getattr(method, "reference", "")),
        sensors=sensors,
        estimates=estimates,
        variances=variances,
        vehicle_parameters=tuple(getattr(method, "vehicle_parameters", ())),
        variant=method.variant if compiled else variant,
        settings=dict(method.settings) if compiled else dict(parameters),
        file=str(getattr(module, "__file__", None) or ""),
        baseline=bool(getattr(method, "baseline", False)),
    )


def _names(method: Any, name: str, attribute: str, required: bool = False) -> tuple[str, ...]:
    value = getattr(method, attribute, None)
    if value is None and not required:
        return ()
    empty = required and not value and attribute != "sensors"  # a constant reads nothing
    if isinstance(value, str) or not isinstance(value, list | tuple) or empty:
        raise InputError(
            f"{name}: set the class attribute '{attribute}' to a tuple of signal names, such as "
            f"('accel_x',) (it is {value!r})"
        )
    for item in value:
        try:
            signal(item)
        except GripbenchError:
            raise InputError(
                f"{name}: '{attribute}' names the unknown signal '{item}': "
                f"{nearest(str(item), SIGNALS)}"
            ) from None
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
        if inspect.isclass(value)
        and value.__module__ == module.__name__
        and callable(getattr(value, "update", None))
        and callable(getattr(value, "reset", None))
    }
    if name:
        if not hasattr(module, name):
            raise unknown(f"class in {path}:", name, methods)
        return getattr(module, name)
    if len(methods) != 1:
        found = ", ".join(sorted(methods)) or "none"
        raise InputError(f"{path}: name the class, as in {path.name}:MyFilter (found: {found})")
    return next(iter(methods.values()))


def describe_error(error: BaseException) -> str:
    """Return an exception as one sentence with the place where it was raised."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    message = " ".join(str(error).split())
    text = f"{type(error).__name__}: {message}" if message else type(error).__name__
    if isinstance(error, GripbenchError):
        return message
    if place is None:
        return text
    code = place.tb_frame.f_code
    return f"{text} (in {code.co_name}, {Path(code.co_filename).name}:{place.tb_lineno})"
