"""The manifest: what made a set of results, so that it can be made again."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
from collections.abc import Mapping
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


def write_manifest(directory: Path, content: Mapping[str, Any]) -> Path:
    """Write a manifest as JSON into a directory; return its path."""
    path = directory / "manifest.json"
    write_atomically(path, json.dumps(content, indent=2, sort_keys=True) + "\n")
    return path


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
