"""Self-test: measure tracks whose true positions and errors are known, and compare.

    python -m benchmarks.selfcheck [--scenes N] [--seed N] [--out FOLDER] [--workers N]

Positions come from closed formulas, statistics from their definitions, and verdicts have known answers. None of them
uses the package's own geometry or statistics. Exit status 0 if the self-test passes, 2 if it fails.
"""

import argparse
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from benchmarks.program import ended
from benchmarks.selfcheck.comparison import Area
from benchmarks.selfcheck.self_test import FOLDERS, LEAST_SCENES, judge, self_test
from tracknoise.cli.text_table import aligned
from tracknoise.exceptions import StoreError
from tracknoise.guarded_folder import guarded_folder
from tracknoise.processes import usable_cores
from tracknoise.tables.files import require_no_links
from tracknoise.text import counted

_FILE = "selfcheck.csv"
"""Marks the folder of an earlier self-test, and holds its checks."""
_SHOWN = 6
"""Maximum number of wrong quantities that are listed."""


def main(arguments: list[str]) -> int:
    """Run the self-test and print what it found. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.selfcheck", description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=LEAST_SCENES, help="for intervals and verdicts, which need 12")
    parser.add_argument("--seed", type=int, default=0, help="random seed of the tracks and their errors")
    parser.add_argument("--out", type=Path, help="keep the runs and all checks in this folder")
    parser.add_argument("--workers", type=int, default=usable_cores())
    options = parser.parse_args(arguments)
    return ended(lambda: _tested(options))


def _tested(options: argparse.Namespace) -> int:
    with _folder(options.out) as folder:
        checks = self_test(
            folder,
            scenes=options.scenes,
            seed=options.seed,
            workers=options.workers if options.scenes >= LEAST_SCENES else 1,  # with fewer scenes there is one part
            progress=lambda part: print(f"self-test: {part}", file=sys.stderr),
        )
        checks.write_csv(folder / _FILE)
    print(result_text(checks))
    return 0 if judge(checks).passes else 2


def result_text(checks: pl.DataFrame) -> str:
    """The answer, what is wrong, and a table with one row per area."""
    return "\n".join([*_answer(checks), "", *_areas(checks)])


def _answer(checks: pl.DataFrame) -> Iterator[str]:
    """Whether the self-test passed; if not, what is wrong and which part of the package is suspect."""
    result, untested = judge(checks), _untested(checks)
    if result.passes:
        yield f"Self-test passed: all {result.n_values:,} values that were compared are right."
    else:
        yield f"Self-test FAILED: {result.n_wrong:,} of {result.n_values:,} values that were compared are wrong."
        yield f"First area that is wrong: {result.areas[0]}. Suspect: {result.suspect}."
        if len(result.areas) > 1:
            yield f"May follow from it: {', '.join(result.areas[1:])}."
        wrong = checks.filter(pl.col("n_wrong") > 0)
        yield from (f"- {_wrong(row)}" for row in wrong.head(_SHOWN).iter_rows(named=True))
        if wrong.height > _SHOWN:
            more = wrong.height - _SHOWN
            yield f"- {counted(more, 'more quantity', 'more quantities')} {'is' if more == 1 else 'are'} wrong."
    if untested:
        why = "it takes more scenes" if result.passes else "it builds on what is wrong"
        yield f"Not tested, because {why}: {', '.join(untested)}."


def _untested(checks: pl.DataFrame) -> list[str]:
    """Areas without any check."""
    tested = set(checks["area"].to_list())
    return [area for area in Area if area not in tested]


def _wrong(row: dict[str, Any]) -> str:
    """A sentence about a quantity that is wrong."""
    where = f" ({row['place']})" if row["place"] else ""
    values = f"found {row['measured']}, expected {row['expected']}{where}"
    several = f"; {row['n_wrong']:,} of {row['n']:,} values are wrong" if row["n_wrong"] > 1 else ""
    return f"{row['area']}, world '{row['world']}': {row['quantity']}: {values}{several}"


def _areas(checks: pl.DataFrame) -> list[str]:
    """One row per area: how many values were compared, and how many are wrong."""
    totals = checks.group_by("area", maintain_order=True).agg(pl.col("n", "n_wrong").sum())
    cells = [(area, f"{n:,}", f"{wrong:,}", "wrong" if wrong else "ok") for area, n, wrong in totals.iter_rows()]
    lines = aligned([("area", "compared", "wrong", ""), *cells], numeric=[False, True, True, False])
    return [lines[0], "-" * len(lines[0]), *lines[1:]]


@contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """The requested folder without what an earlier self-test left there, or a temporary one."""
    if out is None:
        with guarded_folder("tracknoise-selfcheck-") as temporary:
            yield temporary.path
        return
    _clear(out)
    (out / _FILE).touch()
    yield out


def _clear(out: Path) -> None:
    """Remove an earlier self-test; refuse a folder that holds anything else."""
    out.mkdir(parents=True, exist_ok=True)
    if any(out.iterdir()) and not (out / _FILE).exists():
        raise StoreError(f"{out}: holds other files, expected a new or empty folder or an earlier self-test")
    require_no_links(out)
    for name in FOLDERS:
        shutil.rmtree(out / name, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
