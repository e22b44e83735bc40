"""Read MCAP files and ROS bags through mcap and rosbags; runs in a process of its own."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, optional

LIBRARIES = ("mcap.reader", "mcap_ros2.decoder", "rosbags.highlevel")

_LONGEST_ARRAY = 36  # a covariance; longer ones are scans and pictures


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read every number of every message, called `topic.field.field`, topics without their slash.

    A sample's time is that of its message's header where that is set, else that of its recording.

    Raises
    ------
    InputError
        If a library is missing or the bag holds no number.
    """
    messages = _of_mcap(path) if path.suffix.lower() == ".mcap" else _of_bag(path)
    samples: dict[str, tuple[list[float], list[float]]] = {}
    skipped: set[str] = set()
    for topic, logged, message in messages:
        if message is None:
            skipped.add(topic)
            continue
        fields = dict(_flat(message, topic.strip("/").replace("/", ".")))
        time = _stamp(fields, topic.strip("/").replace("/", "."))
        for name, value in fields.items():
            if name.endswith((".stamp.sec", ".stamp.nanosec", ".stamp.secs", ".stamp.nsecs")):
                continue
            times, values = samples.setdefault(name, ([], []))
            times.append(time if time is not None else logged)
            values.append(value)
    content = Content(names=list(samples))
    for name, (times, values) in samples.items():
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(np.asarray(values), np.asarray(times))
    if skipped:
        content.notes.append(f"topics of an unknown encoding were left out: {sorted(skipped)}")
    if not samples:
        raise InputError(f"{path}: the bag holds no number")
    return content


def _of_mcap(path: Path) -> Iterator[tuple[str, float, Any]]:
    reader = optional("mcap.reader", "an MCAP file")
    decoders = optional("mcap_ros2.decoder", "an MCAP file")
    factory = decoders.DecoderFactory()
    decoded: dict[int, Any] = {}
    with path.open("rb") as handle:
        source = reader.make_reader(handle, validate_crcs=True)
        for schema, channel, message in source.iter_messages():
            if channel.message_encoding == "json":
                content = json.loads(message.data)
            else:
                if channel.id not in decoded:
                    decoded[channel.id] = factory.decoder_for(channel.message_encoding, schema)
                decoder = decoded[channel.id]
                content = decoder(message.data) if decoder else None
            yield channel.topic, message.log_time * 1e-9, content


def _of_bag(path: Path) -> Iterator[tuple[str, float, Any]]:
    highlevel = optional("rosbags.highlevel", "a ROS bag")
    typesys = optional("rosbags.typesys", "a ROS bag")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with highlevel.AnyReader([path], default_typestore=store) as source:
        for connection, time, raw in source.messages():
            try:
                content = source.deserialize(raw, connection.msgtype)
            except KeyError:  # a type that neither the bag nor the distribution defines
                content = None
            yield connection.topic, time * 1e-9, content


def _flat(value: Any, name: str) -> Iterator[tuple[str, float]]:
    if isinstance(value, bool | int | float | np.integer | np.floating | np.bool_):
        yield name, float(value)
    elif isinstance(value, dict):
        for key, part in value.items():
            yield from _flat(part, f"{name}.{key}")
    elif isinstance(value, list | tuple | np.ndarray):
        if len(value) <= _LONGEST_ARRAY:
            for index, part in enumerate(value):
                yield from _flat(part, f"{name}[{index}]")
    elif not isinstance(value, str | bytes):
        fields: Any = getattr(value, "__dataclass_fields__", getattr(value, "__slots__", ()))
        for key in fields:
            if not key.startswith("_"):
                yield from _flat(getattr(value, key), f"{name}.{key}")


def _stamp(fields: dict[str, float], topic: str) -> float | None:
    for seconds, rest in (("sec", "nanosec"), ("secs", "nsecs")):
        whole = fields.get(f"{topic}.header.stamp.{seconds}")
        part = fields.get(f"{topic}.header.stamp.{rest}")
        if whole is not None and part is not None and (whole or part):
            return math.fsum((whole, part * 1e-9))
    return None
