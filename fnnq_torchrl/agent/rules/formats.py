"""Read and write rules in the format that a file's ending names."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fnnq_torchrl.agent.rules import c_source, fis, fll, graphs, json_file, sentences
from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices
from fnnq_torchrl.agent.rules.parts import Content
from fnnq_torchrl.agent.rules.system import FuzzySystem
from fnnq_torchrl.files.atomic import atomic_write

MOST_BYTES = 2**22
"""The largest file that is read."""

READERS: dict[str, Callable[[str, str], Content]] = {
    ".fll": fll.read,
    ".fis": fis.read,
    ".json": json_file.read,
    ".txt": sentences.read,
}
"""The readers by ending: ``read(text, file)`` returns the content of a file."""

Files = dict[str, bytes]
"""The contents of the files to write, by ending."""


@dataclass(frozen=True)
class Writer:
    """The functions that write a format.

    Attributes:
        write: ``write(system, candidates, stem, floats)`` returns the files of a system. ``stem``
            is the file's name without its ending; ``floats`` asks for single precision.
        floats: whether the format has single precision as an option.
        full: like ``write``, for the greedy choice among the candidates; None if the format can't
            express it.
    """

    write: Callable[[FuzzySystem, Sequence[float], str, bool], Files]
    floats: bool = False
    full: Callable[[FuzzySystem, Sequence[float], str, bool], Files] | None = None


def _text(
    ending: str, write: Callable[[FuzzySystem, Sequence[float]], str]
) -> Callable[[FuzzySystem, Sequence[float], str, bool], Files]:
    def files(system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool) -> Files:
        return {ending: write(system, candidates).encode()}

    return files


WRITERS = {
    ".fll": Writer(_text(".fll", fll.write)),
    ".fis": Writer(_text(".fis", fis.write)),
    ".c": Writer(c_source.write, floats=True, full=c_source.write),
    ".onnx": Writer(graphs.write_onnx, floats=True, full=graphs.write_onnx_of_greedy),
    ".pt2": Writer(graphs.write_pt2, floats=True, full=graphs.write_pt2_of_greedy),
    ".json": Writer(_text(".json", json_file.write)),
    ".txt": Writer(_text(".txt", sentences.write)),
}
"""The writers by ending."""


def read_system(path: Path) -> Content:
    """Read a complete system in the format of the file's ending.

    Raises:
        OSError: if the file can't be read.
        RulesError: if the ending is unknown or the file has a mistake.
    """
    ending = path.suffix.lower()
    if ending not in READERS:
        raise RulesError(f"{path}: can't be read by its ending; {choices(ending, READERS)}")
    return READERS[ending](read_text(path), str(path))


def read_text(path: Path) -> str:
    """Read a file of rules as text.

    Raises:
        OSError: if the file can't be read.
        RulesError: if it is larger than :data:`MOST_BYTES` or isn't UTF-8.
    """
    with open(path, "rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise RulesError(f"{path}: is larger than {MOST_BYTES // 2**20} MiB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        raise Place(str(path), line, column).error("is no text in UTF-8") from None


def export_system(
    path: Path, system: FuzzySystem, candidates: Sequence[float] = (), *, floats: bool = False
) -> list[Path]:
    """Write a system in the format of the path's ending; errors as in :func:`export_controller`."""
    writer = _writer(path, floats)
    return _write(path, writer.write(system, candidates, path.stem, floats))


def export_controller(
    path: Path, system: FuzzySystem, candidates: Sequence[float], *, floats: bool = False
) -> list[Path]:
    """Write the greedy choice among the candidates in the format of the path's ending.

    Returns:
        The paths of the files that were written.

    Raises:
        OSError: if a file can't be written.
        RulesError: if the ending is unknown or its format can't express this choice.
    """
    writer = _writer(path, floats)
    if writer.full is None:
        able = ", ".join(ending for ending, each in WRITERS.items() if each.full)
        raise RulesError(
            f"controller=full: {path.suffix} can't choose among candidates; "
            f"controller=distilled can be written, or {able}"
        )
    return _write(path, writer.full(system, candidates, path.stem, floats))


def _writer(path: Path, floats: bool) -> Writer:
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise RulesError(f"{path}: can't be written by its ending; {choices(ending, WRITERS)}")
    if floats and not WRITERS[ending].floats:
        able = ", ".join(each for each, writer in WRITERS.items() if writer.floats)
        raise RulesError(f"export_float=true: is for {able}; {ending} has its numbers in full")
    return WRITERS[ending]


def _write(path: Path, files: Files) -> list[Path]:
    written = [path.with_suffix(ending) for ending in files]
    for target, content in zip(written, files.values(), strict=True):
        with atomic_write(target) as file:
            file.write(content)
    return written
