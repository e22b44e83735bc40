"""A class, a variant and parameters in, a new estimator out: values checked, in their types."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin, get_type_hints

from gripbench.errors import InputError, nearest, unknown
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.foreign.declared import ForeignMethod
from gripbench.methods.settings import Parameter, Variant


def make(factory: Any, variant: str, parameters: Mapping[str, Any], name: str) -> Any:
    """Return a new estimator of a class, or an instance as it is."""
    arguments = dict(parameters)
    if not callable(factory):  # an instance carries its settings already
        if arguments or variant:
            raise InputError(f"{name}: an instance takes no variant or parameters any more")
        return factory
    try:
        known = inspect.signature(factory).parameters
    except (TypeError, ValueError):
        known = inspect.signature(lambda **_: None).parameters
    flexible = any(item.kind is item.VAR_KEYWORD for item in known.values())
    if variant and ("variant" in known or flexible):
        arguments["variant"] = variant
    elif variant:
        arguments = {**_settings_of(factory, variant, name), **arguments}
    listed = _listed(factory)
    own = {key: item.default for key, item in listed.items() if key not in known and not flexible}
    for key, value in arguments.items():
        if key not in known and key not in listed and not flexible:
            raise InputError(f"{name}: it takes no parameter '{key}': {nearest(key, known)}")
        declared = listed.get(key) or _parameter(factory, known.get(key))
        if declared is not None:
            arguments[key] = declared.checked(value, name)
    own |= {key: arguments.pop(key) for key in own if key in arguments}
    method = factory(**arguments)
    for key, value in own.items():  # listed, and no argument: an attribute
        setattr(method, key, value)
    return method


def _settings_of(factory: Any, variant: str, name: str) -> Mapping[str, Any]:
    """Return the arguments of a variant that a plain class lists in `variants`."""
    variants = getattr(factory, "variants", None)
    if not isinstance(variants, Mapping) or not variants:
        raise InputError(f"{name}: it takes no variant")
    if variant not in variants:
        raise unknown(f"variant of {name}", variant, variants)
    found = variants[variant]
    settings = found.settings if isinstance(found, Variant) else found
    if not isinstance(settings, Mapping):
        raise InputError(f"{name}: variant '{variant}' must be a table of parameter values")
    return settings


def _listed(factory: Any) -> dict[str, Parameter]:
    """Return the `parameters` that a plain class lists, by name; one of ours checks them itself."""
    if isinstance(factory, type) and issubclass(factory, CompiledMethod | ForeignMethod):
        return {}
    listed = getattr(factory, "parameters", ())
    items = listed if isinstance(listed, list | tuple) else ()
    return {item.name: item for item in items if isinstance(item, Parameter)}


def _parameter(factory: Any, argument: inspect.Parameter | None) -> Parameter | None:
    """Return what an argument of a plain class allows; None: nothing is known of it.

    Its default says of which type it is: a whole number, a number, a switch; its annotation, where
    that is a `Literal`, which choices there are.
    """
    if argument is None:
        return None
    choices = _choices(factory, argument)
    if choices:
        return Parameter(argument.name, choices[0], "-", "", choices=choices)
    if isinstance(argument.default, bool | int | float):
        return Parameter(argument.name, argument.default, "-", "")
    return None


def _choices(factory: Any, argument: inspect.Parameter) -> tuple[str, ...]:
    """Return the texts of an argument's `Literal`, even where annotations are kept as text."""
    if argument.annotation is inspect.Parameter.empty:
        return ()
    try:
        hints = get_type_hints(factory.__init__ if inspect.isclass(factory) else factory)
    except Exception:  # names that exist for a type checker only
        return ()
    hint = hints.get(argument.name)
    found = get_args(hint) if get_origin(hint) is Literal else ()
    return found if found and all(isinstance(item, str) for item in found) else ()
