"""A batch whose captures are tracked by jobs of a SLURM cluster.

Start it where `sbatch` works, in a folder that all nodes share:

    python examples/batch_on_slurm.py captures tracked --jobs 100

It needs `pip install 'asterism[cluster]' dask-jobqueue`. The jobs connect to this process, which
must be reachable over the network and is to run until the end.
"""

from __future__ import annotations

import argparse
from typing import Any

from dask_jobqueue.slurm import SLURMCluster

import asterism as am


def main() -> None:
    """Start the jobs and track the captures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("captures")
    parser.add_argument("out")
    parser.add_argument("--jobs", type=int, default=10)
    parser.add_argument("--memory", default="4GB", help="of each job")
    parser.add_argument("--walltime", default="08:00:00")
    parser.add_argument("--queue", help="partition of SLURM")
    parser.add_argument("--interface", help="network interface, such as ib0")
    options = parser.parse_args()
    start: Any = SLURMCluster
    with start(
        cores=1, processes=1, memory=options.memory, walltime=options.walltime,
        queue=options.queue, interface=options.interface,
    ) as cluster:  # fmt: skip
        cluster.scale(jobs=options.jobs)
        batch = am.batch.run([options.captures], options.out, scheduler=cluster.scheduler_address)
    print(batch)
    for reason in batch.failed.values():
        print(reason)


if __name__ == "__main__":
    main()
