"""The estimate of the memory that a batch needs, and the memory that is free."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training import memory
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.memory import available, check_memory, sizes_of
from fnnq_torchrl.training.trainer import Trainer


def batch_of(*overrides: str) -> Batch:
    return Batch([Job(load_config(*overrides), Path("job"))])


def test_what_is_kept_by_hand() -> None:
    sizes = sizes_of(batch_of("situations=10", "engine=eager", "num_seeds=1000"))
    assert (sizes.runs, sizes.evaluations, sizes.tests, sizes.weights) == (1000, 3, 5, 20)
    # Each evaluation has 20 weights, steps and diverged. Each of its 5 situations has two flags,
    # return and length.
    of_evaluations = 1000 * 3 * (20 * 4 + 8 + 1 + 5 * (2 + 4 + 4))
    assert of_evaluations < sizes.kept < 1.5 * of_evaluations + 1000 * 8 * 50


def test_what_is_kept_is_what_the_ledger_has() -> None:
    batch = batch_of("situations=100", "num_seeds=500", "engine=eager")
    ledger, sizes = Trainer(batch.config, batch.runs, batch.engine).ledger, sizes_of(batch)
    tensors = [
        *ledger.book.pages.values(True, True),
        *ledger.results.values(),
        ledger.diverged,
    ]
    held = sum(tensor.numel() * tensor.element_size() for tensor in tensors)
    assert held <= sizes.kept <= 1.5 * held


def test_counted_firing_strengths_take_memory() -> None:
    plain = sizes_of(batch_of("num_seeds=500", "engine=eager"))
    counting = sizes_of(batch_of("num_seeds=500", "engine=eager", "rules.count_firing=true"))
    assert counting.kept - plain.kept == 500 * 20 * 4
    assert counting.at_work > plain.at_work


def test_what_a_step_size_remembers_takes_memory() -> None:
    plain, of_swift = (
        sizes_of(batch_of("num_seeds=500", "engine=eager", f"step_size={name}"))
        for name in ("constant", "swift")
    )
    assert of_swift.at_work - plain.at_work == of_swift.lanes * 20 * 4 * 5 * 2
    assert of_swift.kept == plain.kept


def test_what_a_network_of_any_size_would_have_takes_no_memory_to_say() -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sizes = sizes_of(batch_of("action.candidates=1000000000"))
    assert sizes.at_work > 1e10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e6  # in KiB


def test_too_much_is_refused_and_much_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    batch = batch_of("num_seeds=1000")
    needed = sizes_of(batch).total
    monkeypatch.setattr(memory, "available", lambda device: needed - 1)
    with pytest.raises(ConfigError, match=r"^1,000 runs .*need about 0\.\d GB .* are free: choose"):
        check_memory(batch)
    monkeypatch.setattr(memory, "available", lambda device: needed)
    assert "need about" in (check_memory(batch) or "")
    monkeypatch.setattr(memory, "available", lambda device: 100 * needed)
    assert check_memory(batch) is None


def test_a_gpus_memory_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    free = {"cuda:1": 1000, "cuda": 10**18}
    monkeypatch.setattr(torch.cuda, "mem_get_info", lambda device: (free[device], 10**18))
    monkeypatch.setattr(memory, "_free_of_machine", lambda: 5000)
    monkeypatch.setattr(memory, "_limits_of_groups", lambda: iter([6000]))
    assert (available("cuda:1"), available("cuda"), available()) == (1000, 5000, 5000)


def test_a_control_groups_limit_counts(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.write_text("4:memory:/old\n7:cpu:/\n0::/user/job\n")
    for file, text in {
        "user/job/memory.max": "max\n",
        "user/memory.max": "1000\n",
        "memory/old/memory.limit_in_bytes": "300\n",
    }.items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    assert [*memory._limits_of_groups(tmp_path, own)] == [300, 1000]
    assert [*memory._limits_of_groups(tmp_path, tmp_path / "none")] == []
    assert available() > 0


PEAK = """
import sys, tempfile
from pathlib import Path
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.job import run_job
config = load_config("engine=eager", "situations=50", "evaluation.every=1", *sys.argv[1:])
with tempfile.TemporaryDirectory() as directory:
    run_job(config, Path(directory))
# Not getrusage, whose peak begins with that of the process that started this one.
status = Path("/proc/self/status").read_text().split()
print(1024 * int(status[status.index("VmHWM:") + 1]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's accounts")
@pytest.mark.long
def test_the_estimate_is_near_what_a_job_takes() -> None:
    keys = ("num_seeds=1000", "env.time_limit_steps=1", "action.candidates=2")
    ended = subprocess.run(
        [sys.executable, "-c", PEAK, *keys], check=True, capture_output=True, text=True
    )
    peak = int(ended.stdout.splitlines()[-1])
    foreseen = sizes_of(batch_of("situations=50", "evaluation.every=1", *keys)).total
    assert foreseen / 2 < peak < foreseen * 1.25
