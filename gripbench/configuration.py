"""Read TOML into pydantic models; every mistake becomes one line with file, key and remedy."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from gripbench.errors import InputError, nearest, unknown

CONFIGS = Path(__file__).parent / "configs"
"""Where the TOML files that ship with gripbench lie."""


class Configuration(BaseModel):
    """Base of every configuration: no unknown key, no NaN, nothing changes after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)


Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, empty or not TOML.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is no plain file")  # reading from a pipe would wait for ever
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:  # no text, or a path that no file can have
        raise InputError(f"{path}: cannot be read as text ({error})") from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: nested too deeply") from None
    except ValueError as error:  # also a number of thousands of digits
        raise InputError(f"{path}: not valid TOML: {error}") from None


def parse(model: type[Model], content: Mapping[str, Any], source: str | Path) -> Model:
    """Return `content` as a `model`.

    Parameters
    ----------
    model
        The pydantic model to fill.
    content
        Keys and values, as read from a TOML file.
    source
        Name of the file, for the message.

    Raises
    ------
    InputError
        On the first mistake, with file, key, what was given and what is allowed.
    """
    try:
        # as JSON a list may become a tuple, while strictly no text or truth value becomes a number
        return model.model_validate_json(json.dumps(content, default=str), strict=True)
    except ValidationError as error:
        details = error.errors()
        # a misspelt key is also a missing one; the misspelling is what helps
        misspelt = [detail for detail in details if detail["type"] == "extra_forbidden"]
        raise InputError(f"{source}: {_describe(model, [*misspelt, *details][0])}") from None
    except (RecursionError, ValueError) as error:  # what JSON cannot hold
        raise InputError(f"{source}: {error}") from None


def named_file(kind: str, name: object, files: Mapping[str, Path]) -> Path:
    """Return the file of a name, or of the path of a TOML file.

    Parameters
    ----------
    kind
        What it is, for the message.
    name
        One of `files`, or a path that ends with `.toml`.
    files
        The files by name.

    Raises
    ------
    InputError
        If it is neither; the message names the nearest one.
    """
    if isinstance(name, str) and name.endswith(".toml"):
        return Path(name)
    if not isinstance(name, str) or name not in files:
        raise unknown(kind, str(name), files)
    return files[name]


def _describe(model: type[BaseModel], detail: ErrorDetails) -> str:
    location = [str(part) for part in detail["loc"]]
    key = ".".join(location)
    message = detail["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if not location:
        return message  # a check over several keys names them itself
    if detail["type"] == "extra_forbidden":
        hint = nearest(location[-1], _keys_beside(model, location))
        return f"unknown key '{key}': {hint}"
    if detail["type"] == "missing":
        return f"missing key '{key}'"
    message += _allowed(model, location)
    shown = "" if isinstance(detail["input"], Mapping | list) else f" (given {detail['input']!r})"
    return f"key '{key}': {message}{shown}"


def _allowed(model: type[BaseModel], location: list[str]) -> str:
    """Return the whole range of a number's key, where the model gives both of its ends."""
    current: Any = model
    for part in location:
        fields = getattr(current, "model_fields", {})
        if part not in fields:
            continue
        field = fields[part]
        if part == location[-1]:
            low = _bound(field.metadata, {"ge": "from", "gt": "above"})
            high = _bound(field.metadata, {"le": "to", "lt": "below"})
            return f", allowed is {low} {high}" if low and high else ""
        current = _model_in(field.annotation)
    return ""


def _bound(metadata: list[Any], words: Mapping[str, str]) -> str:
    """Return one end of a range in words, empty if there is none."""
    for item in metadata:
        for name, word in words.items():
            if getattr(item, name, None) is not None:
                return f"{word} {getattr(item, name):g}"
    return ""


def _keys_beside(model: type[BaseModel], location: list[str]) -> list[str]:
    """Return the keys that are allowed where the last part of `location` stands."""
    current: Any = model
    for part in location[:-1]:
        fields = getattr(current, "model_fields", None)
        if fields is None or part not in fields:
            continue  # a tag of a union or a key of a table: the model below it comes next
        current = _model_in(fields[part].annotation)
    return list(getattr(current, "model_fields", {}))


def _model_in(annotation: Any) -> Any:
    """Return the first pydantic model in a type annotation, such as `dict[str, Model]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_in(argument)
        if found is not None:
            return found
    return None
