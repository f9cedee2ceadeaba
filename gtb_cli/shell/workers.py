"""`-j` and `--cluster`: several specs, each done by this process, by one of several processes, or on a cluster."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import click

from gtb_cli.process.memory import divided_among
from gtb_cli.process.processes import MAX_JOBS, R, T, in_processes, processors
from gtb_cli.shell.gathering import gathered, option
from gtb_cli.shell.options import WholeNumber


@dataclass(frozen=True)
class Workers:
    """A number of processes (1: this one; 0: one for each processor), or a cluster: its scheduler's address or file."""

    jobs: int
    cluster: str | None = None

    def __post_init__(self) -> None:
        if self.cluster is not None and self.jobs != 1:
            raise click.UsageError("--cluster and -j exclude each other: the cluster says how many workers there are")

    def results(
        self,
        function: Callable[[T], R],
        tasks: Sequence[T],
        here: Callable[[T], R] | None = None,
        warn: Callable[[str], None] = lambda message: None,
    ) -> Generator[R]:
        """Yield ``function(task)`` for each task, in their order; in this process, `here` is called instead."""
        if self.cluster is not None and tasks:
            from gtb_cli.process.cluster import in_cluster

            return in_cluster(function, tasks, self.cluster, warn)
        jobs = divided_among(min(self.jobs or processors(), len(tasks)))
        return in_processes(function, tasks, jobs) if jobs > 1 else (found for found in map(here or function, tasks))


jobs_option = option("-j, --jobs JOBS", WholeNumber(0, MAX_JOBS), default=1)(
    help="Processes that share the work on several specs; 0 means one for each processor; 1 without this option. What "
    "is written does not depend on the number. Where ulimit -v allows less than 1 GB, this process does it all."
)

workers_option = gathered(
    "workers",
    Workers,
    jobs_option,
    option("--cluster ADDRESS", str)(
        help="Share the work on a cluster: the address of a Dask scheduler, or its scheduler file. Needs the extra "
        "gtb-cli[cluster]; makes the same bytes on processors of one kind, and others are named."
    ),
)
