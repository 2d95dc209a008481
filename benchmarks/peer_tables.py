"""Measures work on tables of positions: sweeps in NumPy and SciPy, and CSV in pandas and polars. Started by `peers.py`.

The least of `rounds` repetitions counts. Imports are not measured.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any


def sweep(task: dict[str, Any]) -> dict[str, Any]:
    """Returns the time of the smallest distance of any pair at the samples of an NPZ archive, with this distance [m].

    The archive is read in the measured time. Pairs of one sample are evaluated at once, without the square root.
    """
    import numpy as np

    def judge() -> float:
        positions = np.load(task["path"])["positions"]
        first, second = np.triu_indices(positions.shape[1], k=1)
        least = np.inf
        for sample in positions:
            apart = sample[first] - sample[second]
            least = min(least, float(np.einsum("ij,ij->i", apart, apart).min()))
        return float(np.sqrt(least))

    seconds, least_m = best(judge, task["rounds"])
    return {"wall_s": seconds, "min_m": least_m, "version": np.__version__, "settings": "all pairs of each sample"}


def tree_sweep(task: dict[str, Any]) -> dict[str, Any]:
    """Returns the same as `sweep`, from the nearest neighbour of each vehicle in a k-d tree of each sample."""
    import numpy as np
    import scipy
    from scipy.spatial import cKDTree

    def judge() -> float:
        positions = np.load(task["path"])["positions"]
        return min(float(cKDTree(sample).query(sample, k=2)[0][:, 1].min()) for sample in positions)

    seconds, least_m = best(judge, task["rounds"])
    return {"wall_s": seconds, "min_m": least_m, "version": scipy.__version__, "settings": "a tree of each sample"}


def pandas_csv(task: dict[str, Any]) -> dict[str, Any]:
    """Returns the time of `pandas.read_csv` and the number of rows."""
    import pandas

    seconds, rows = best(lambda: len(pandas.read_csv(task["path"])), task["rounds"])
    return {"wall_s": seconds, "rows": rows, "version": pandas.__version__, "settings": "read_csv, engine C"}


def polars_csv(task: dict[str, Any]) -> dict[str, Any]:
    """Returns the time of `polars.read_csv` and the number of rows."""
    import polars

    seconds, rows = best(lambda: polars.read_csv(task["path"]).height, task["rounds"])
    return {"wall_s": seconds, "rows": rows, "version": polars.__version__, "settings": "read_csv, one thread"}


def best(work: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    least, answer = float("inf"), None
    for _ in range(rounds):
        began = time.perf_counter()
        answer = work()
        least = min(least, time.perf_counter() - began)
    return least, answer


if __name__ == "__main__":
    given = json.load(sys.stdin)
    work = {"all pairs": sweep, "tree": tree_sweep, "pandas": pandas_csv, "polars": polars_csv}[given["work"]]
    print(json.dumps(work(given)))
