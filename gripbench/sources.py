"""What a piece of source rests on: its file and, from import to import, all of its project.

Two caches ask for it: the stored rows of the benchmark and numba's compiled functions. A module of
gripbench, or of the file's own folder or package, counts with its content; modules of other
packages count with their version. Imports are read from the source, so no code runs for it.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import gripbench

_PROJECT = Path(gripbench.__file__).resolve().parent


@dataclass(frozen=True)
class _File:
    path: Path
    changed: int
    size: int

    @cached_property
    def digest(self) -> str:
        """Digest of the content; empty where the file has changed before anybody asked."""
        content = hashlib.sha256(self.path.read_bytes()).hexdigest()
        return content if _file(self.path) == self else ""


def _file(path: Path) -> _File:
    about = path.stat()
    return _File(path, about.st_mtime_ns, about.st_size)


_AT_START = {path: _file(path) for path in _PROJECT.rglob("*.py")}
"""The files of gripbench when this process began: what it runs is what they held then."""


def changed_since_start() -> Path | None:
    """Return a file of gripbench that is not what this process runs; None: all are."""
    for path, before in _AT_START.items():
        try:
            now = _file(path)
            if now != before and now.digest != before.digest:
                return path
        except OSError:
            return path
    return None


def digest(*parts: str) -> str:
    """Return a digest of several texts, in which no text can run over into the next."""
    state = hashlib.sha256()
    for part in parts:
        content = part.encode()
        state.update(len(content).to_bytes(8, "big"))
        state.update(content)
    return state.hexdigest()[:32]


def source_digest(*files: Path) -> str:
    """Return the digest of source files with everything that they import from their project.

    Parameters
    ----------
    *files
        Python files.
    """
    paths, packages = _followed(files)
    lines = [f"{_relative(path)} {content}" for path, content in paths.items()]
    lines += [f"{name} {_version(name)}" for name in packages]
    return digest(*sorted(lines))


def source_files(*files: Path) -> set[Path]:
    """Return source files with all those of their project that they import by name."""
    return set(_followed(files)[0])


def _followed(files: Iterable[Path]) -> tuple[dict[Path, str], set[str]]:
    """Return the digests of files and of all that they import, and the packages beside them."""
    paths: dict[Path, str] = {}
    packages: set[str] = set()
    waiting = [path.resolve() for path in files]
    while waiting:
        path = waiting.pop()
        if path in paths:
            continue
        paths[path] = _AT_START[path].digest if path in _AT_START else _file(path).digest
        own, foreign = _imports(path, paths[path])
        waiting.extend(own)
        packages |= foreign
    return paths, packages


def _relative(path: Path) -> str:
    """Name a file so that moving the project does not make its results stale."""
    if path.is_relative_to(_PROJECT):
        return "gripbench/" + path.relative_to(_PROJECT).as_posix()
    return path.name


@cache
def _imports(path: Path, content: str) -> tuple[tuple[Path, ...], frozenset[str]]:
    """Return the own files that a file imports and the names of foreign packages."""
    del content  # part of the cache's key only: the file may change while a notebook runs
    own: list[Path] = []
    foreign: set[str] = set()
    for name in _imported_names(path):
        found = _locate(name, path)
        if found is not None:
            own.append(found)
        elif name.split(".")[0] not in sys.stdlib_module_names | {"gripbench"}:
            foreign.add(name.split(".")[0])
    return tuple(own), frozenset(foreign)


def _imported_names(path: Path) -> Iterator[str]:
    """Yield dotted names that may be modules; of gripbench itself, where each name is defined."""
    try:
        tree = ast.parse(path.read_bytes(), str(path))
    except (SyntaxError, ValueError):
        return  # loading the file will say what is wrong
    short: set[str] = set()
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "gripbench":
                    short.add(alias.asname or "gripbench")
                if alias.name != "gripbench":
                    yield from _prefixes(alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = _base(node, path)
            if base == "gripbench":
                for alias in node.names:
                    yield gripbench.DEFINED_IN.get(alias.name, f"gripbench.{alias.name}")
                continue
            yield from _prefixes(base)
            for alias in node.names:
                yield f"{base}.{alias.name}" if base else alias.name
    for node in ast.walk(tree) if short else ():
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in short
            and node.attr in gripbench.DEFINED_IN
        ):
            yield gripbench.DEFINED_IN[node.attr]


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield every statement, however deep; expressions, the most of a tree, hold no imports."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            inside = getattr(node, name, None)
            if isinstance(inside, list):
                waiting.extend(inside)


def _base(node: ast.ImportFrom, path: Path) -> str:
    if node.level == 0:
        return node.module or ""
    package = _dotted_package(path)
    kept = package[: len(package) - (node.level - 1)]
    return ".".join([*kept, *([node.module] if node.module else [])])


def _prefixes(name: str) -> Iterator[str]:
    parts = name.split(".")
    for length in range(1, len(parts) + 1):
        yield ".".join(parts[:length])


def _dotted_package(path: Path) -> list[str]:
    """Return the parts of the package that a file lies in, from the top."""
    parts: list[str] = []
    folder = path.parent
    while (folder / "__init__.py").is_file():
        parts.insert(0, folder.name)
        folder = folder.parent
    return parts


def _locate(name: str, importer: Path) -> Path | None:
    """Return the own file of a module, None for one of another project."""
    parts = name.split(".")
    if parts[0] == "gripbench":
        # Not the __init__ of gripbench and of its parts: they hold no code of a method.
        return _file_of(_PROJECT, parts[1:], packages=len(parts) > 2)
    package = _dotted_package(importer)
    if package:
        if parts[0] != package[0]:
            return None
        return _file_of(importer.parents[len(package)], parts)
    if importer.parent.name in ("site-packages", "dist-packages"):
        return None
    return _file_of(importer.parent, parts)


def _file_of(root: Path, parts: list[str], packages: bool = True) -> Path | None:
    if not parts or not parts[-1]:
        return None
    module = root.joinpath(*parts[:-1], parts[-1] + ".py")
    if module.is_file():
        return module.resolve()
    init = root.joinpath(*parts, "__init__.py")
    return init.resolve() if packages and init.is_file() else None


@cache
def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def in_project(path: Path) -> bool:
    """Return whether a file belongs to gripbench."""
    return path.resolve().is_relative_to(_PROJECT)


@cache
def imports_gripbench(path: Path) -> bool:
    """Return whether a file belongs to gripbench or imports anything of it."""
    if in_project(path):
        return True
    return any(name.split(".")[0] == "gripbench" for name in _imported_names(path))
