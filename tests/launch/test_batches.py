from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from fnnq_torchrl.launch.batches import in_batches
from fnnq_torchrl.training.jobs import BATCHABLE, Job
from tests.programs import config

CONFIG = config()
CONFIGS = st.builds(
    lambda lam, seed, num_seeds, alpha, trace: replace(
        CONFIG, lam=lam, seed=seed, num_seeds=num_seeds, alpha=alpha, trace=trace
    ),
    lam=st.sampled_from([0.0, 0.2]),
    seed=st.integers(0, 2**62),
    num_seeds=st.integers(1, 9),
    alpha=st.sampled_from([0.1, 0.4]),
    trace=st.sampled_from(["output", "gradient"]),
)
JOBS = st.lists(CONFIGS, max_size=12).map(
    lambda configs: [Job(config, Path(str(i))) for i, config in enumerate(configs)]
)


@given(jobs=JOBS, most_runs=st.integers(1, 20))
def test_every_job_is_in_one_batch_with_its_like(jobs: list[Job], most_runs: int) -> None:
    batches = in_batches(jobs, most_runs)
    assert Counter(job.directory for batch in batches for job in batch) == Counter(
        job.directory for job in jobs
    )
    for batch in batches:
        assert [jobs.index(job) for job in batch] == sorted(jobs.index(job) for job in batch)
        for job in batch:
            differ = {
                key
                for key, value in asdict(job.config).items()
                if value != getattr(batch[0].config, key) and not isinstance(value, dict)
            }
            assert differ <= set(BATCHABLE)
        runs = sum(job.config.num_seeds for job in batch)
        assert runs <= most_runs or len(batch) == 1
    # No batch has room for the first job of the next batch of its kind.
    for trace in ("output", "gradient"):
        sizes = [
            sum(job.config.num_seeds for job in batch)
            for batch in batches
            if batch[0].config.trace == trace
        ]
        firsts = [b[0].config.num_seeds for b in batches if b[0].config.trace == trace]
        assert all(size + new > most_runs for size, new in zip(sizes, firsts[1:], strict=False))


def test_what_isnt_per_run_sets_jobs_apart() -> None:
    world = replace(CONFIG.env, speed_mps=0.2)
    configs = [CONFIG, replace(CONFIG, env=world), replace(CONFIG, seed=3), replace(CONFIG)]
    batches = in_batches([Job(c, Path(str(i))) for i, c in enumerate(configs)], 100)
    assert [[job.directory.name for job in batch] for batch in batches] == [["0", "2", "3"], ["1"]]
