"""The file that wandb's process writes of a run, record by record: LevelDB's log.

https://github.com/google/leveldb/blob/main/doc/log_format.md, after a header of 7 bytes;
each record is a protobuf.
"""

from collections import deque
from collections.abc import Iterator
from pathlib import Path

from wandb.proto.wandb_internal_pb2 import Record  # type: ignore[attr-defined]  # made at run time

_HEADER, _BLOCK, _OF_RECORD = 7, 32768, 7
_FULL, _LAST = 1, 4

_AT_THE_END = 5
"""Records among which the last word on a run is."""


def records(path: Path) -> Iterator[bytes]:
    """Its records, without one that is cut short.

    Raises:
        OSError: it can't be read.
    """
    content = path.read_bytes()
    place, parts = _HEADER, b""
    while place + _OF_RECORD <= len(content):
        if _BLOCK - place % _BLOCK < _OF_RECORD:  # the end of a block has no room for a record
            place += _BLOCK - place % _BLOCK
            continue
        size = int.from_bytes(content[place + 4 : place + 6], "little")
        kind = content[place + 6]
        place += _OF_RECORD
        parts += content[place : place + size]
        place += size
        if kind in (_FULL, _LAST) and place <= len(content):
            yield parts
            parts = b""


def is_whole(path: Path) -> bool:
    """Whether the run's end is in it, which comes after all else.

    Raises:
        OSError: it can't be read.
    """
    last = map(Record.FromString, deque(records(path), _AT_THE_END))
    return any(record.WhichOneof("record_type") == "exit" for record in last)
