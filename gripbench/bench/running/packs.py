"""A method's stored rows in, one file with them and all that they rest on out; and back, checked.

A pack is a zip file: `manifest.json`, the method's own files below `method/` (those that its key
covers, and what its rows were seen to read), its rows below `rows/` as the store keeps them, and
`lock.txt`, every installed package with its version. The manifest holds the digest of each. A pack
comes from a stranger: nothing of it is written before all of it has been looked at, and none of its
code runs here.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import re
import stat
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

import gripbench
from gripbench.bench.catalogue.registry import MethodSpec, choose_method
from gripbench.bench.running.dependencies import folder_of, unchanged
from gripbench.bench.running.isolation.audit import ABSENT
from gripbench.bench.running.rows import Row
from gripbench.bench.running.store import Store, read_row, row_path, seal
from gripbench.configuration import Configuration, parse
from gripbench.errors import InputError, one_line
from gripbench.sources import in_project, source_files
from gripbench.writing import being_written

FORMAT = 1
"""Version of the form of a pack."""

MOST_BYTES = 128 * 1024**2
"""Most bytes of a pack, and of all that it holds unpacked."""

MOST_FILES = 20_000
"""Most files in a pack."""

MANIFEST, LOCK, METHOD, ROWS = "manifest.json", "lock.txt", "method", "rows"

_PART = re.compile(r'[^<>:"/\\|?*\x00-\x1f\x7f]{1,200}')
_OWN = "packed_method.py"


class Manifest(Configuration):
    """What a pack says of itself.

    Attributes
    ----------
    gripbench, python, machine
        Where it was made.
    label, method, variant, parameters
        The method with its settings.
    file, class_name
        Where its class is, the file below `method/`.
    method_digest
        Digest of its source and settings, as its rows have it.
    files
        Digest (SHA-256) of every other file of the pack, by its name in it.
    """

    format: int = FORMAT
    gripbench: str
    python: str
    machine: str
    label: str
    method: str
    variant: str = ""
    parameters: dict[str, bool | int | float | str] = Field(default_factory=dict)
    file: str
    class_name: str = ""
    method_digest: str
    files: dict[str, str]


@dataclass(frozen=True)
class Pack:
    """A pack that has been read and lies unpacked.

    Attributes
    ----------
    path
        The pack.
    manifest
        What it says of itself.
    rows
        Its rows, by scenario and seed.
    folder
        Where it lies unpacked.
    """

    path: Path
    manifest: Manifest
    rows: tuple[Row, ...]
    folder: Path

    def method(self) -> MethodSpec:
        """Return its method, ready to run; its code is loaded in its sandbox only.

        Raises
        ------
        InputError
            If it cannot be loaded, or is not the method of the rows.
        """
        said = self.manifest
        place = self.folder / METHOD
        spec = choose_method(
            f"{place / said.file}:{said.class_name}".removesuffix(":"), said.variant,
            said.parameters,
        )  # fmt: skip
        if (spec.label, spec.declaration.name) != (said.label, said.method):
            raise InputError(f"{self.path}: its method is '{spec.label}', its rows '{said.label}'")
        file = Path(spec.declaration.file)
        if file.is_file() and not file.resolve().is_relative_to(place.resolve()):
            raise InputError(
                f"{self.path}: {file} would run instead of the packed one; verify it where that "
                "package is not installed"
            )
        return spec


def write_pack(method: str, results: Path, path: Path) -> Manifest:
    """Write the pack of a method that has stored rows.

    Parameters
    ----------
    method
        As `choose_method` takes it; not one that ships with gripbench.
    results
        The results folder with its rows.
    path
        The file to write.

    Raises
    ------
    InputError
        If there are no rows, some are of another state of the method, or it rests on something
        that a file cannot carry.
    """
    spec = choose_method(method)
    if not spec.isolated:
        raise InputError(f"{method}: ships with gripbench: there is nothing to pack")
    rows = list(_rows_of(spec, results))
    main, base, own = _own_files(spec, rows)
    content = {f"{METHOD}/{file.relative_to(base).as_posix()}": file.read_bytes() for file in own}
    class_name = spec.source.target.rpartition(":")[2]
    file = main.relative_to(base).as_posix()
    if spec.source.kind == "module":
        # it is loaded by its full name, which a file in the pack's top folder does
        module = spec.source.target.rpartition(":")[0]
        file = _OWN
        content[f"{METHOD}/{_OWN}"] = f"from {module} import {class_name}\n".encode()
    for row in rows:
        name = row_path(row.scenario, row.label, row.seed).as_posix()
        content[f"{ROWS}/{name}"] = seal(row).encode()
    content[LOCK] = "".join(f"{line}\n" for line in _installed()).encode()
    manifest = Manifest(
        gripbench=gripbench.__version__,
        python=platform.python_version(),
        machine=platform.machine(),
        label=spec.label,
        method=spec.declaration.name,
        variant=spec.variant,
        parameters=spec.parameters,
        file=file,
        class_name=class_name,
        method_digest=spec.digest,
        files={name: hashlib.sha256(data).hexdigest() for name, data in sorted(content.items())},
    )
    _check_size(path, len(content), sum(map(len, content.values())))
    content[MANIFEST] = (manifest.model_dump_json(indent=1) + "\n").encode()
    with being_written(path) as temporary:
        _zip(temporary, content)
    return manifest


def _rows_of(spec: MethodSpec, results: Path) -> Iterator[Row]:
    """Yield the stored rows of a method, which must all be of its present state."""
    found = False
    for row in Store(results).read_all(labels=(spec.label,)):
        if row.label != spec.label:
            continue
        found = True
        fresh = row.method_digest == spec.digest and not row.computed_outside and not row.passing
        if not (fresh and (row.untracked or unchanged(row.dependencies, folder_of(spec)))):
            raise InputError(
                f"{results}: the row of '{row.label}' for seed {row.seed} of '{row.scenario}' is "
                "not of the method as it is now; run it again"
            )
        yield row
    if not found:
        raise InputError(f"{results}: no stored rows of '{spec.label}'; 'gripbench run' makes them")


def _own_files(spec: MethodSpec, rows: Iterable[Row]) -> tuple[Path, Path, list[Path]]:
    """Return a method's main file, the folder that its modules are found from, and its files."""
    given = Path(spec.source.target.rpartition(":")[0]) if spec.source.kind == "file" else None
    main = (given or Path(spec.declaration.file)).resolve()
    folder, base = folder_of(spec), main.parent
    if spec.source.kind == "module":
        base = main.parents[spec.source.target.rpartition(":")[0].count(".")]
        base = base if main.name != "__init__.py" else base.parent
    starts = [main, *([Path(spec.declaration.file)] if spec.declaration.file else [])]
    found = {path for path in source_files(*starts) if not in_project(path)}
    found |= {(main.parent / name).resolve() for name in spec.declaration.files}
    for row in rows:
        for key, digest in row.dependencies.items():
            kind, _, name = key.partition(":")
            if digest == ABSENT or kind == "folder":
                continue
            if kind == "environment":
                raise InputError(
                    f"{spec.label}: reads the environment variable {name}, which no pack can "
                    "carry; make it a parameter"
                )
            found.add((folder / Path(name).expanduser()).resolve())
    for path in sorted(found):
        if not path.is_relative_to(base):
            raise InputError(f"{path}: '{spec.label}' reads it; put it below {base} and run again")
    return main, base, sorted(found)


def _installed() -> list[str]:
    """Return every installed package with its version."""
    found = {
        f"{item.metadata['Name']}=={item.version}"
        for item in importlib.metadata.distributions()
        if item.metadata["Name"]
    }
    return sorted(found, key=str.lower)


def _zip(path: Path, content: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(content.items()):
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # the same bytes whenever
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o100644 << 16
            archive.writestr(info, data)


def read_pack(path: Path, folder: Path) -> Pack:
    """Return a pack after checking all of it, and unpack it.

    Parameters
    ----------
    path
        The pack.
    folder
        An empty folder to unpack into.

    Raises
    ------
    InputError
        If it is no pack, is too large, holds a name or an entry that no pack has, or something in
        it is not what its digest says; then nothing of it is unpacked.
    """
    content = _unzipped(path)
    manifest = _manifest(path, content)
    if set(manifest.files) != set(content) - {MANIFEST}:
        odd = sorted(set(manifest.files) ^ (set(content) - {MANIFEST}))[0]
        raise _bad(path, f"'{odd}' is in it or in its manifest, not in both")
    for name, digest in manifest.files.items():
        if hashlib.sha256(content[name]).hexdigest() != digest:
            raise _bad(path, f"'{name}' is not what its digest says: it was changed")
    if f"{METHOD}/{manifest.file}" not in content or not manifest.file.endswith(".py"):
        raise _bad(path, f"it lacks the method's file '{manifest.file}'")
    for name, data in content.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
    names = [name for name in content if name.startswith(f"{ROWS}/")]
    rows = sorted(
        (_row(path, folder, name, manifest) for name in names),
        key=lambda row: (row.scenario, row.seed),
    )
    if not rows:
        raise _bad(path, "it holds no rows")
    return Pack(path, manifest, tuple(rows), folder)


def _unzipped(path: Path) -> dict[str, bytes]:
    """Return what a zip file holds by name, after looking at all names and sizes."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise _bad(path, "no plain file")
        _check_size(path, 1, path.stat().st_size)
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            _check_size(path, len(entries), sum(entry.file_size for entry in entries))
            for entry in entries:
                _check_entry(path, entry)
            if len({entry.filename.lower() for entry in entries}) < len(entries):
                raise _bad(path, "two of its entries have one name")
            return {entry.filename: _content(path, archive, entry) for entry in entries}
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; 'gripbench pack' writes one") from None
    except Exception as error:  # whatever zipfile raises of a file that is none
        reason = " ".join(str(error).split()) or type(error).__name__
        raise _bad(path, one_line(reason[:1].lower() + reason[1:], 200)) from None


def _check_size(path: Path, files: int, size: int) -> None:
    if files > MOST_FILES or size > MOST_BYTES:
        raise InputError(
            f"{path}: {files} files with {size / 1024**2:.0f} MiB; a pack has at most {MOST_FILES} "
            f"files with {MOST_BYTES // 1024**2} MiB"
        )


def _check_entry(path: Path, entry: zipfile.ZipInfo) -> None:
    name, kind = entry.filename, stat.S_IFMT(entry.external_attr >> 16)
    parts = name.split("/")
    plain = all(_PART.fullmatch(part) and part not in (".", "..") for part in parts)
    known = name in (MANIFEST, LOCK) or (len(parts) > 1 and parts[0] in (METHOD, ROWS))
    if not plain or not known or entry.orig_filename != name:
        raise _bad(path, f"the entry {one_line(repr(name), 120)} has no place in a pack")
    if kind not in (0, stat.S_IFREG) or entry.is_dir():
        raise _bad(path, f"the entry '{name}' is no plain file")
    if entry.flag_bits & 1 or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise _bad(path, f"the entry '{name}' is encrypted or compressed in another way")


def _content(path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    with archive.open(entry) as file:
        content = file.read(entry.file_size + 1)
    if len(content) != entry.file_size:
        raise _bad(path, f"the entry '{entry.filename}' has not the size that it is said to have")
    return content


def _manifest(path: Path, content: Mapping[str, bytes]) -> Manifest:
    if MANIFEST not in content:
        raise _bad(path, f"it has no {MANIFEST}")
    try:
        found: Any = json.loads(content[MANIFEST])
    except (ValueError, RecursionError):
        raise _bad(path, f"its {MANIFEST} is not JSON") from None
    if not isinstance(found, dict):
        raise _bad(path, f"its {MANIFEST} is no table")
    version = found.get("format")
    if isinstance(version, int) and version > FORMAT:
        raise InputError(f"{path}: written by a newer gripbench (form {version}); update gripbench")
    return parse(Manifest, found, f"{path}: {MANIFEST}")


def _row(path: Path, folder: Path, name: str, manifest: Manifest) -> Row:
    try:
        row = read_row(folder / name)
    except InputError as error:
        reason = str(error).removeprefix(f"{folder / name}: ")
        raise _bad(path, f"'{name}': {reason}") from None
    if row is None or name != f"{ROWS}/{row_path(row.scenario, row.label, row.seed).as_posix()}":
        raise _bad(path, f"'{name}' is not the row of its place")
    of_method = (manifest.label, manifest.method, manifest.method_digest)
    if (row.label, row.method, row.method_digest) != of_method or row.computed_outside:
        raise _bad(path, f"'{name}' is a row of another method, or of another state of it")
    return row


def _bad(path: Path, why: str) -> InputError:
    return InputError(f"{path}: cannot be used as a pack: {why}")
