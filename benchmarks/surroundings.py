"""Run jobs in random bad surroundings: each must give all of its results or end in one line.

python benchmarks/surroundings.py [--rounds 200] [--seed 0] [--only KIND]

A round is a job or a sweep in one or two bad surroundings. It passes if the exit status is 0 and
the results are those of the job in good surroundings, bit for bit; or if the exit status isn't 0,
standard error gives the reason, and all files are complete. There is no traceback in either case.
After every third round, the same command in good surroundings must finish the job. Mounts and
control groups need root; without it, those kinds are left out.
"""

import argparse
import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from machine import describe_machine
from torture import check_whole, results

SMALL = ("env.circle_radius_m=0.5", "env.time_limit_steps=14", "num_seeds=2")
EAGER = (*SMALL, "situations=10", "engine=eager", "checkpoint.every_s=0.1")
JOBS = {
    "job": EAGER,
    "sweep": (*EAGER, "lam=0,0.2", "-m"),
    "compiled": (*SMALL, "situations=220", "evaluation.every=110", "engine=auto"),
}
LONGEST_S = 180
ENDED_BY = {signal.SIGTERM: 143, signal.SIGINT: 130, signal.SIGHUP: 129}
CGROUPS = Path("/sys/fs/cgroup")
UGLY = (
    "two words",
    "a=b,c",
    "[x] (y) {z}",
    "it's",
    "100%20",
    "q?x=1#y",
    "λ → ∞ 🤖",
    "-m",
    "~",
    "$HOME;`x`",
    'say "hi"',
    "back\\slash",
    "line\nbreak",
    "x" * 200,
)
VARIABLES = (
    {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
    {"MATPLOTLIBRC": "/dev/null/no"},
    {"MPLCONFIGDIR": "/proc/nowhere"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"},
    {"LC_ALL": "tr_TR.UTF-8"},
    {"COLUMNS": "1", "LINES": "0", "TERM": "dumb"},
    {"FORCE_COLOR": "1", "TTY_COMPATIBLE": "1"},
    {"XDG_CACHE_HOME": "relative"},
    {"XDG_CACHE_HOME": "/proc/nowhere", "TMPDIR": "/nowhere"},
    {"CXX": "false"},
    {"CXX": "'"},
    {"CXX": ""},
    {"CXXFLAGS": "-Nonsense", "LD_LIBRARY_PATH": "/nowhere"},
    {"TORCHINDUCTOR_CACHE_DIR": "/proc/nowhere"},
    {"PATH": "/nowhere"},
    {"WANDB_RUN_ID": "x", "WANDB_MODE": "nonsense", "MLFLOW_TRACKING_URI": "nonsense://"},
    {"HYDRA_FULL_ERROR": "0", "PYTHONWARNINGS": "always"},
)
FREE = {"learning_curve.png", "learning_curves.png"}


@dataclass
class Round:
    """A command and its surroundings, which the kinds change before it starts.

    Attributes:
        kind: the job, one of `JOBS`.
        folder: the working directory, which is empty.
        output: the job's output directory.
        variables: the changed environment variables; None for those that are removed.
        stdout, stderr: where the output goes; a pipe that is read if None.
        lines: the number of lines after which the reader of the pipe goes away.
        groups: the control groups of the process.
        number: a signal to send at a random moment.
        killed: whether the kernel may kill the process.
    """

    kind: str
    folder: Path
    output: Path
    variables: dict[str, str | None] = field(default_factory=dict)
    closed: tuple[int, ...] = ()
    stdout: str | None = None
    stderr: str | None = None
    lines: int | None = None
    groups: list[Path] = field(default_factory=list)
    number: signal.Signals | None = None
    killed: bool = False

    def command(self) -> list[str]:
        place = "hydra.sweep.dir" if self.kind == "sweep" else "hydra.run.dir"
        quoted = str(self.output).replace("'", "\\'")
        words = [*JOBS[self.kind], f"{place}='{quoted}'"]
        flags = [word for word in words if word == "-m"]
        others = [word for word in words if word != "-m"]
        return [sys.executable, "-m", "fnnq_torchrl.train", *others, *flags]


Kind = Callable[[Round, random.Random, ExitStack], str]
"""Changes the surroundings of a round, and returns them in words."""


def mount(place: Path, options: str, stack: ExitStack) -> Path:
    place.mkdir(parents=True, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)], check=True)
    stack.callback(subprocess.run, ["umount", "--lazy", str(place)], check=True)
    return place


def fill(place: Path) -> None:
    with suppress(OSError), open(place / "filler", "wb", buffering=0) as file:
        while True:
            file.write(bytes(256))


def pipe_closes(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    round_.lines = rng.randint(0, 8)
    return f"a pipe that closes after {round_.lines} lines"


def log_is_full(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    name = rng.choice(("stdout", "stderr"))
    setattr(round_, name, "/dev/full")
    return f"{name} on a full disk"


def streams_are_closed(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    round_.closed = rng.choice(((1,), (2,), (1, 2), (0, 1, 2)))
    return f"closed streams {round_.closed}"


def output_fills(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    size_kb = rng.choice((4, 16, 32, 48, 64, 96))
    mount(round_.output.parent, f"size={size_kb}k", stack)
    return f"an output disk of {size_kb} KiB"


def output_is_read_only(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    mount(round_.output.parent, "ro", stack)
    return "a read-only output disk"


def disk_of_programs(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    options = rng.choice(("noexec", "ro", "full"))
    names = rng.choice((("XDG_CACHE_HOME",), ("TMPDIR",), ("XDG_CACHE_HOME", "TMPDIR")))
    for name in names:
        place = mount(round_.folder / name, "size=64k" if options == "full" else options, stack)
        if options == "full":
            fill(place)
        round_.variables[name] = str(place)
    return f"{options}: {', '.join(names)}"


def ugly_name(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    round_.output = round_.output.parent / rng.choice(UGLY)
    return f"the directory {str(round_.output.name)!r}"


def hostile_variables(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    chosen = rng.choice(VARIABLES)
    round_.variables |= chosen
    return f"variables {chosen}"


def no_home(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    home = rng.choice((None, "/nowhere", "/proc", ""))
    round_.variables |= {"HOME": home, "XDG_CACHE_HOME": None, "XDG_CONFIG_HOME": None}
    return f"HOME={home}"


def matplotlibrc(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    text = rng.choice((b"text.usetex: True\n", b"font.family: sans\xe9rif\n", b"backend: x\n\x00"))
    (round_.folder / "matplotlibrc").write_bytes(text)
    return f"a matplotlibrc with {text!r}"


def control_group(name: str, limit: str, value: int, stack: ExitStack) -> Path:
    group = CGROUPS / name / f"fnnq_{os.getpid()}_{time.monotonic_ns()}"
    group.mkdir()
    stack.callback(group.rmdir)
    (group / limit).write_text(str(value))
    return group


def little_memory(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    round_.killed = True
    bytes_ = 256 * 2**20
    round_.groups.append(control_group("memory", "memory.limit_in_bytes", bytes_, stack))
    return "256 MB of memory"


def few_processes(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    most = rng.randint(1, 4)
    round_.groups.append(control_group("pids", "pids.max", most, stack))
    if rng.random() < 0.5:
        round_.variables["OMP_NUM_THREADS"] = None
    return f"at most {most} processes and threads"


def signalled(round_: Round, rng: random.Random, stack: ExitStack) -> str:
    round_.number = rng.choice((*ENDED_BY, signal.SIGUSR1, signal.SIGKILL))
    return round_.number.name


KINDS: dict[str, Kind] = {
    "pipe": pipe_closes,
    "full log": log_is_full,
    "closed streams": streams_are_closed,
    "small disk": output_fills,
    "read-only": output_is_read_only,
    "programs": disk_of_programs,
    "ugly name": ugly_name,
    "variables": hostile_variables,
    "no home": no_home,
    "matplotlibrc": matplotlibrc,
    "memory": little_memory,
    "processes": few_processes,
    "signal": signalled,
}
ROOT_ONLY = {"small disk", "read-only", "programs", "memory", "processes"}


def possible() -> list[str]:
    """Return the kinds of surroundings that this user can make here."""
    root = sys.platform == "linux" and os.geteuid() == 0
    missing = set() if root else set(ROOT_ONLY)
    missing |= {
        n for n, d in (("memory", "memory"), ("processes", "pids")) if not (CGROUPS / d).is_dir()
    }
    return [name for name in KINDS if name not in missing]


@dataclass(frozen=True)
class Ended:
    status: int
    stdout: str
    stderr: str


def run(round_: Round, rng: random.Random) -> Ended:
    """Run the command of a round in its surroundings."""
    variables = {**os.environ, "OMP_NUM_THREADS": "1", **round_.variables}

    def enter() -> None:
        for group in round_.groups:
            (group / "cgroup.procs").write_text(str(os.getpid()))
        for number in round_.closed:
            os.close(number)

    with ExitStack() as stack:
        streams = {}
        for name in ("stdout", "stderr"):
            target = getattr(round_, name)
            if target is None:
                file = stack.enter_context(tempfile.TemporaryFile("w+", errors="replace"))
            else:
                file = stack.enter_context(open(target, "w"))
            streams[name] = file
        reading = writing = None
        if round_.lines is not None:
            reading, writing = os.pipe()
            streams = {"stdout": writing, "stderr": writing}
        process = subprocess.Popen(
            round_.command(),
            cwd=round_.folder,
            env={name: value for name, value in variables.items() if value is not None},
            preexec_fn=enter,
            **streams,
        )
        if reading is not None:
            os.close(writing)
            read_lines(reading, round_.lines)
        if round_.number is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(rng.uniform(0, 12))
            process.send_signal(round_.number)
        try:
            status = process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return Ended(124, "", f"still running after {LONGEST_S} s\nTraceback of none\n")
        texts = {}
        for name, stream in streams.items():
            texts[name] = ""
            if not isinstance(stream, int) and getattr(round_, name) is None:
                stream.seek(0)
                texts[name] = stream.read()
        return Ended(status, **texts)


def read_lines(descriptor: int, lines: int) -> None:
    with open(descriptor, errors="replace") as file:
        for _ in itertools.islice(file, lines):
            pass


def verdict(round_: Round, ended: Ended, reference: dict[str, object]) -> str:
    """Return what is wrong with the end of a round; empty if it is right."""
    if "Traceback" in ended.stdout + ended.stderr:
        return "a traceback"
    allowed = {0, 1, 2, -signal.SIGKILL} if round_.killed else {0, 1, 2}
    if round_.number is not None:
        allowed |= {ENDED_BY.get(round_.number, 0), -round_.number}
    if ended.status not in allowed:
        return f"exit status {ended.status}"
    try:
        check_whole(round_.output)
    except Exception as error:
        return f"an incomplete file: {error}"
    told = round_.stderr is None and round_.lines is None and 2 not in round_.closed
    if ended.status > 0 and told and not ended.stderr.strip():
        return f"exit status {ended.status} without a line"
    if ended.status == 0:
        found = results(round_.output)
        for name in reference.keys() - found.keys():
            if Path(name).name not in FREE or (told and name not in ended.stderr):
                return f"{name} is missing, though the status is 0"
        if round_.kind != "compiled":  # auto may have been eager, with other roundings
            for name in found.keys() - FREE:
                if Path(name).name not in FREE and found[name] != reference[name]:
                    return f"{name} differs"
    return ""


@contextmanager
def surroundings(kind: str, names: list[str], rng: random.Random) -> Iterator[tuple[Round, str]]:
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        round_ = Round(kind, Path(folder), Path(folder, "outputs", "job"))
        words = [KINDS[name](round_, rng, stack) for name in names]
        yield round_, " and ".join(words)


def good(kind: str, output: Path, folder: Path) -> Ended:
    return run(Round(kind, folder, output), random.Random(0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=KINDS)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    print(describe_machine())
    known = [arguments.only] if arguments.only else possible()
    print(f"kinds: {', '.join(known)}; not here: {', '.join({*KINDS} - {*known}) or 'none'}")
    references = {}
    tally: Counter[str] = Counter()
    wrong = []
    for number in range(arguments.rounds):
        kind = rng.choice([*JOBS])
        if kind not in references:
            with tempfile.TemporaryDirectory() as folder:
                ended = good(kind, Path(folder, "job"), Path(folder))
                if ended.status:
                    sys.exit(f"{kind}: {ended.stderr}")
                references[kind] = results(Path(folder, "job"))
        names = rng.sample(known, min(len(known), rng.choice((1, 1, 2))))
        with surroundings(kind, names, rng) as (round_, words):
            ended = run(round_, rng)
            status, fault = ended.status, verdict(round_, ended, references[kind])
            again = ""
            if not fault and number % 3 == 0 and not {"small disk", "read-only"} & {*names}:
                ended_again = good(kind, round_.output, round_.folder)
                fault = verdict(
                    Round(kind, round_.folder, round_.output), ended_again, references[kind]
                )
                fault = fault or ("status" if ended_again.status else "")
                again = ", and again in good surroundings"
                tally["finished again"] += not fault
        outcome = "all of it" if status == 0 else f"status {status}"
        tally["complete" if status == 0 else "ended with a reason"] += not fault
        line = f"{number}: {kind} with {words}{again}: {fault or outcome}"
        print(line, flush=True)
        if fault:
            wrong.append(line)
            print(ended.stdout[-2000:], ended.stderr[-4000:], sep="\n", flush=True)
    print(
        f"{arguments.rounds} rounds: {tally['complete']} gave all results, "
        f"{tally['ended with a reason']} ended with a reason, {len(wrong)} went wrong; "
        f"{tally['finished again']} were finished by the same command in good surroundings."
    )
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
