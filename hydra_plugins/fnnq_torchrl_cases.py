"""A Hydra sweeper for experiments that are no single grid, where Hydra looks for plugins."""

from collections.abc import Mapping, Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override


class CaseSweeper(BasicSweeper):
    """Hydra's own sweeper over several grids, one after the other.

    Args:
        cases: each a grid, keys with their values as on the command line; ``{}`` is a single job.
        params: swept within every case, as are sweeps on the command line, which come last: they
            replace what a case says of their keys.
        max_batch_size: jobs that are launched together; all, if not given.
    """

    def __init__(
        self,
        cases: Sequence[Mapping[str, Any]],
        params: Mapping[str, str] | None = None,
        max_batch_size: int | None = None,
    ) -> None:
        super().__init__(max_batch_size, dict(params or {}))
        self.cases = cases

    def split_arguments(  # type: ignore[override]  # the base has it static, and calls it on self
        self, overrides: list[Override], max_batch_size: int | None
    ) -> list[list[list[str]]]:
        """The batches of jobs, each a list of overrides; no job comes twice."""
        parser = OverridesParser.create()
        jobs: dict[tuple[str, ...], None] = {}
        for case in self.cases:
            grid = parser.parse_overrides([f"{key}={values}" for key, values in case.items()])
            (batch,) = BasicSweeper.split_arguments([*grid, *overrides], None)
            jobs |= dict.fromkeys(map(tuple, batch))
        chunks = self.split_overrides_to_chunks([list(job) for job in jobs], max_batch_size)
        return list(chunks)
