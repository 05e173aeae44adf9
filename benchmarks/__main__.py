"""Run the benchmarks and print a table: ``python -m benchmarks [NAME ...] [--full] [--json FILE]``.

A benchmark is a module with a function `rows`, and, where it has a larger version, `full_rows`. Libraries have one
thread each, as in a worker, unless a row says otherwise.
"""

import argparse
import json
import os
import pkgutil
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

import benchmarks
from benchmarks.harness import ONE_THREAD, Row

_TOOLS = {
    *("__main__", "harness", "made_up", "program", "same_tables"),
    *("gtsam_judge", "inertial_problem", "msckf", "planted_windows", "track_points"),
    *(
        "filter_arms",
        "filter_tracks",
        "filter_trial",
        "gazebo_truth",
        "linear_table",
        "paper_claims",
        "proof",
        "proof_halves",
        "proof_resampled",
    ),
    *("window_sigmas", "window_table"),
    "xfeat",
}
"""Modules that measure no time and no memory."""


def names() -> list[str]:
    """The benchmarks."""
    modules = pkgutil.iter_modules(benchmarks.__path__)
    return sorted({module.name for module in modules if not module.ispkg} - _TOOLS)


def main() -> None:
    """Run the named benchmarks, or all, one after another."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Time and weigh the parts.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which: {', '.join(names())}; by default all")
    parser.add_argument("--full", action="store_true", help="in full size, where there is a larger one")
    parser.add_argument("--json", type=Path, default=Path("runs/benchmarks.json"), help="where to write the figures")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(names()):
        parser.error(f"no such benchmark: {', '.join(sorted(unknown))}; known: {', '.join(names())}")
    os.environ.update(ONE_THREAD)  # before any of the libraries is loaded, which is when they look
    rows = []
    for name in arguments.names or names():
        for row in _rows(name, full=arguments.full):
            rows.append(row)
            print(f"{row.value:12.4g} {row.unit:<14} {row.name}{f'  ({row.note})' if row.note else ''}", flush=True)
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")


def _rows(name: str, *, full: bool) -> list[Row]:
    module = import_module(f"benchmarks.{name}")
    return module.full_rows() if full and hasattr(module, "full_rows") else module.rows()


if __name__ == "__main__":
    main()
