"""How far the visits of a chain are from the enumerated posterior.

    python -m tests.tools.measure_chain [MOVES]

Five problems of hundreds to thousands of partitions, each with uniform and informed growth, in
two and three dimensions, with gaps and uneven sampling; the last with a settled zone. With as many
moves as the docs speak of (30 million, the default) it takes some minutes.
"""

# ruff: noqa: T201
from __future__ import annotations

import sys
import time

from tests.references.chain_moves import make_chain
from tests.references.partitions import every_partition, problem_of_size
from tests.references.visits import total_variation


def main() -> None:
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 30_000_000
    for case, (least, most, seed, n_axes) in enumerate(
        [(500, 1000, 0, 2), (1000, 3000, 100, 3), (3000, 6000, 200, 2), (6000, 20_000, 300, 3),
         (500, 5000, 40, 2)]
    ):  # fmt: skip
        d, model = problem_of_size(least, most, seed, n_axes)
        all_ = len(every_partition(d, model)[0])
        for informed in (False, True):
            found = []
            for moves in (n // 100, n // 10, n):
                chain = make_chain(d, model, informed=informed, seed=1)
                settled = None
                if case == 4:
                    chain.run(1000)
                    chain.freeze(1)
                    settled = (1, chain.labels())
                start = time.perf_counter()
                tv, left = total_variation(d, model, chain, moves, settled=settled)
                found.append(f"{tv:.4f} ({moves:.0e})")
                seconds = time.perf_counter() - start
            growth = "informed" if informed else "uniform"
            print(
                f"{n_axes}-D, {all_} partitions, {left} possible, {growth}: total variation",
                ", ".join(found), f"{1e6 * seconds / n:.2f} µs a move", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
