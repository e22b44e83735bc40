"""A co-simulation FMU of FMI 2 or 3 as a method: samples in, estimates out, through FMPy."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from gripbench.errors import LONGEST, GripbenchError, InputError, nearest, one_line
from gripbench.methods.foreign.declared import ForeignMethod
from gripbench.methods.foreign.whole_samples import WholeSamples
from gripbench.writing import own_folder

_TYPES = ("Real", "Float64")


class Fmu(ForeignMethod):
    """A method in a functional mock-up unit for co-simulation.

    The unit's inputs have the names of the declared channels, its outputs those of the estimates
    and `<name>_variance`, its parameters those of the vehicle parameters and settings; `variables`
    says where it calls one otherwise. All are Real (FMI 2) or Float64 (FMI 3). Parameters and the
    inputs of the first sample are set before it leaves its initialisation. At each further sample
    the inputs are set and a step is done from the last sample's time to this one's; the outputs
    after it are the estimates. So they depend on no later sample.

    It is given whole samples in order, as a compiled step is; where there is none its estimates
    hold.

    Attributes
    ----------
    fmu
        The file, relative to the method's own.
    variables
        Names in the unit by names here, where they differ.
    """

    fmu: ClassVar[str]
    variables: ClassVar[Mapping[str, str]] = {}

    def __init__(self, variant: str = "", **overrides: Any) -> None:
        super().__init__(variant, **overrides)
        self._unit: Any = None
        self._open()

    @property
    def files(self) -> tuple[str, ...]:
        """The unit: its content is part of every row's key."""
        return (self.fmu,)

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start afresh for a vehicle."""
        self._end()
        self._samples = WholeSamples(self.sensors)
        self._parameters = self.paper(vehicle) | self.numbers()
        self._estimates = dict.fromkeys(self.outputs, 0.0)

    def update(self, obs: Mapping[str, float]) -> dict[str, float]:
        """Take one sample and return the estimates."""
        taken = self._samples.take(obs)
        if taken is not None:
            values, time, elapsed = taken
            try:
                self._advance(values, time, elapsed)
            except GripbenchError:
                raise
            except Exception as error:  # FMPy raises plain ones
                raise GripbenchError(f"{self.fmu}: {_words(error)}") from None
        return dict(self._estimates)

    def _advance(self, values: list[float], time: float, elapsed: float) -> None:
        if self._unit is None:
            self._begin(values, time)
        else:
            self._set(self._inputs, values)
            stopped = self._unit.doStep(
                currentCommunicationPoint=time - elapsed, communicationStepSize=elapsed
            )
            if self._is_3 and stopped[1]:
                raise GripbenchError(f"{self.fmu}: asks to end the simulation at {time:g} s")
        get = self._unit.getFloat64 if self._is_3 else self._unit.getReal
        self._estimates = dict(zip(self.outputs, get(self._outputs), strict=True))

    def _begin(self, values: list[float], time: float) -> None:
        """Make an instance and take it through its initialisation."""
        from fmpy import fmi2, fmi3

        said = self._description
        kind = fmi3.FMU3Slave if self._is_3 else fmi2.FMU2Slave
        unit = kind(
            guid=said.guid,
            unzipDirectory=str(self._folder),
            modelIdentifier=said.coSimulation.modelIdentifier,
            instanceName=self.name,
        )
        unit.instantiate()
        self._unit = unit
        if not self._is_3:
            unit.setupExperiment(startTime=time)
        self._set(self._references, list(self._parameters.values()))
        unit.enterInitializationMode(**({"startTime": time} if self._is_3 else {}))
        self._set(self._inputs, values)
        unit.exitInitializationMode()

    def _set(self, references: list[int], values: list[float]) -> None:
        if references:
            (self._unit.setFloat64 if self._is_3 else self._unit.setReal)(references, values)

    def _open(self) -> None:
        try:
            from fmpy import read_model_description
        except ImportError:
            raise InputError(
                f"{self.name}: an FMU needs FMPy: pip install 'gripbench[fmi]'"
            ) from None
        path = self.place(self.fmu)
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        try:
            self._description = read_model_description(str(path))
            self._folder = unpacked(path)
        except Exception as error:
            raise InputError(f"{path}: cannot be used as an FMU: {_words(error)}") from None
        version = self._description.fmiVersion
        if version == "1.0" or self._description.coSimulation is None:
            what = "of FMI 1" if version == "1.0" else "not for co-simulation"
            raise InputError(f"{path}: is {what}; export it as a co-simulation FMU of FMI 2 or 3")
        self._is_3 = version.startswith("3")
        self._check_platform(path)
        parameters = (*self.vehicle_parameters, *(item.name for item in self.parameters))
        self._references = self._found(path, parameters, "parameter")
        self._inputs = self._found(path, self.sensors, "input")
        self._outputs = self._found(path, self.outputs, "output")

    def _check_platform(self, path: Path) -> None:
        from fmpy import platform, platform_tuple, sharedLibraryExtension

        folder = platform_tuple if self._is_3 else platform
        identifier = self._description.coSimulation.modelIdentifier
        library = self._folder / "binaries" / folder / (identifier + sharedLibraryExtension)
        if not library.is_file():
            raise InputError(
                f"{path}: has no library binaries/{folder}/{library.name}, which this machine needs"
            )

    def _found(self, path: Path, names: tuple[str, ...], causality: str) -> list[int]:
        """Return the value references of variables."""
        known = {item.name: item for item in self._description.modelVariables}
        found = []
        for name in names:
            there = self.variables.get(name, name)
            variable = known.get(there)
            if variable is None or variable.causality != causality:
                options = [key for key, item in known.items() if item.causality == causality]
                raise InputError(f"{path}: has no {causality} '{there}': {nearest(there, options)}")
            if variable.type not in _TYPES or variable.dimensions:
                raise InputError(
                    f"{path}: the {causality} '{there}' is no scalar of {' or '.join(_TYPES)}"
                )
            found.append(variable.valueReference)
        return found

    def _end(self) -> None:
        unit, self._unit = self._unit, None
        if unit is not None:
            with contextlib.suppress(Exception):
                unit.terminate()
            with contextlib.suppress(Exception):
                unit.freeInstance()

    def __del__(self) -> None:
        if getattr(self, "_unit", None) is not None:
            self._end()

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be stored: the settings; a copy starts with `reset`."""
        return {"settings": self.settings}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.settings = state["settings"]
        self._unit = None
        self._open()


def place_of_units() -> Path:
    """Return the folder, among this process's temporary files, in which FMUs are unpacked."""
    user = str(os.getuid()) if hasattr(os, "getuid") else "user"
    return Path(tempfile.gettempdir(), f"gripbench_fmu_{user}")


def unpacked(path: Path) -> Path:
    """Return the folder with an FMU's content, unpacked once and compared each time.

    A process of a plug-in is ended, not asked to end: it could not clear up behind itself.
    """
    content = path.read_bytes()
    place = place_of_units()
    own_folder(place)
    folder = place / hashlib.sha256(content).hexdigest()[:32]
    with zipfile.ZipFile(path) as archive:
        members = [item for item in archive.infolist() if not item.is_dir()]
        for item in members:
            parts = Path(item.filename).parts
            if item.filename.startswith("/") or "\\" in item.filename or ".." in parts:
                raise ValueError(f"holds the path {item.filename}")
        if not all(_same(folder / item.filename, item) for item in members):
            scratch = Path(tempfile.mkdtemp(dir=place))
            archive.extractall(scratch)
            shutil.rmtree(folder, ignore_errors=True)
            try:
                scratch.rename(folder)
            except OSError:  # another process was faster
                shutil.rmtree(scratch, ignore_errors=True)
    return folder


def _same(path: Path, member: zipfile.ZipInfo) -> bool:
    try:
        return path.stat().st_size == member.file_size and (
            zlib.crc32(path.read_bytes()) == member.CRC
        )
    except OSError:
        return False


def _words(error: Exception) -> str:
    return one_line(" ".join(str(error).split()), LONGEST // 2)
