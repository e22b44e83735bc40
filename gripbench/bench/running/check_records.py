"""What the checks of a plug-in found, kept beside the rows; a row's mark on boards comes from it.

`gripbench check` keeps one record a label below `<results>/checks`. A row of a plug-in is then
`passed` or `failed`; `old` where the method, or the checks, have changed since; `missing` where
there is no record. A method that ships with gripbench is checked by its tests and has no mark.
"""

from __future__ import annotations

import inspect
import json
from functools import cache
from pathlib import Path
from urllib.parse import quote

from pydantic import Field

from gripbench.bench.running.rows import Checked
from gripbench.configuration import Configuration, parse
from gripbench.errors import InputError
from gripbench.sources import digest
from gripbench.writing import write_atomically


class CheckRecord(Configuration):
    """What the checks of one state of a method found.

    Attributes
    ----------
    label
        The method.
    method_digest
        Digest of its source and settings.
    checks_digest
        Digest of the checks themselves.
    failed
        Failures by name of the check, and what each says.
    """

    label: str
    method_digest: str
    checks_digest: str
    failed: dict[str, str] = Field(default_factory=dict)


def record_path(results: Path | str, label: str) -> Path:
    """Return where the record of a method lies."""
    name = quote(label, safe="")
    if len(name) > 150:
        name = f"{name[:150]}~{digest(label)[:16]}"
    return Path(results) / "checks" / f"of_{name}.json"


def keep_record(results: Path | str, method: str, found: dict[str, str]) -> None:
    """Keep what all checks of a method found; of one that ships with gripbench nothing is kept.

    Parameters
    ----------
    results
        The results folder.
    method
        Name or file, as `choose_method` takes it; one that cannot be loaded has no record.
    found
        As `check_estimator` returns it.
    """
    from gripbench.bench.catalogue.check import failures
    from gripbench.bench.catalogue.registry import choose_method

    try:
        spec = choose_method(method)
    except InputError:
        return
    if not spec.isolated:
        return
    record = CheckRecord(
        label=spec.label,
        method_digest=spec.digest,
        checks_digest=checks_digest(),
        failed=failures(found),
    )
    write_atomically(record_path(results, spec.label), record.model_dump_json(indent=1) + "\n")


def mark_of(results: Path | str, label: str, method_digest: str) -> Checked:
    """Return the mark of a plug-in's row.

    Parameters
    ----------
    results
        The results folder.
    label, method_digest
        Of the row.
    """
    record = _read(record_path(results, label))
    if record is None:
        return "missing"
    if (record.method_digest, record.checks_digest) != (method_digest, checks_digest()):
        return "old"
    return "failed" if record.failed else "passed"


def _read(path: Path) -> CheckRecord | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
        return parse(CheckRecord, content, path) if isinstance(content, dict) else None
    except (OSError, ValueError, RecursionError, InputError):
        return None  # whatever it is, it is no record


@cache
def checks_digest() -> str:
    """Return the digest of the checks: another one makes every record old."""
    from gripbench.bench.catalogue import distortions, expectations
    from gripbench.bench.running.isolation import trials

    return digest(*(inspect.getsource(module) for module in (distortions, expectations, trials)))
