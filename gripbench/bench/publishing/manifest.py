"""What was run and the files that came of it in; out, a manifest, by which to make them again."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gripbench.writing import write_atomically

_LIBRARIES = ("numpy", "scipy", "numba", "pandas", "gymnasium", "pydantic")


def manifest(configuration: Mapping[str, Any], seeds: Mapping[str, Any]) -> dict[str, Any]:
    """Return configuration, seeds, versions, commit, machine and date of a run.

    Parameters
    ----------
    configuration
        Everything that was read, by file name.
    seeds
        Seeds by scenario.
    """
    return {
        "configuration": dict(configuration),
        "seeds": dict(seeds),
        "versions": {"gripbench": _version("gripbench"), "python": platform.python_version()}
        | {name: _version(name) for name in _LIBRARIES},
        "commit": commit(),
        "machine": {
            "system": platform.system(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def write_manifest(directory: Path, content: Mapping[str, Any], files: Iterable[Path]) -> Path:
    """Write a manifest as JSON into a directory, unless the one there is about the same results.

    Parameters
    ----------
    directory
        Where it goes, as `manifest.json`.
    content
        As `manifest` returns it.
    files
        The files in the directory that were made; the manifest holds their digests (SHA-256).

    Returns
    -------
    Its path.

    Notes
    -----
    A manifest of the same configuration, seeds and files stays: it says when, where and by which
    commit these results were made first, and a rerun that changes nothing changes no file.
    """
    path = directory / "manifest.json"
    digests = {
        file.relative_to(directory).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
    }
    text = json.dumps({**content, "files": digests}, indent=2, sort_keys=True) + "\n"
    if _about(json.loads(text)) != _about(_read(path)):
        write_atomically(path, text)
    return path


def _about(content: Any) -> list[Any] | None:
    if not isinstance(content, dict):
        return None
    return [content.get(key) for key in ("configuration", "seeds", "files")]


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None  # none there, or spoilt: it is written anew


def commit() -> str:
    """Return the commit of the project's checkout, `+` where files differ, `unknown` outside."""
    here = Path(__file__).parent
    try:
        head = _git(here, "rev-parse", "HEAD")
        changed = _git(here, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head + ("+" if changed else "")


def _git(directory: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=directory, capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
