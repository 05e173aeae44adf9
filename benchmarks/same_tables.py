"""Show that a change to the structure changes no number: four runs before and after it, compared to the byte.

    python -m benchmarks.same_tables record BEFORE     # with the version before the change
    python -m benchmarks.same_tables record AFTER      # with the version after it
    python -m benchmarks.same_tables compare BEFORE AFTER

The runs are the demo, 7-Scenes, KITTI and a small simulated light stage. `compare` reads every Parquet table of every
run. Columns of one name must hold the same bytes, row by row. A table, or a column, that only one side has is listed.
Aspects that were text are typed before they are compared, and sentences may be reworded. Exit status 1 if another
column differs.

Runs of machines of two kinds differ by rounding. BEFORE and AFTER may also be two run folders:

    OPENBLAS_CORETYPE=Haswell tracknoise run demo --scenes 2 --frames 12 --out HASWELL
    OPENBLAS_CORETYPE=SkylakeX tracknoise run demo --scenes 2 --frames 12 --out SKYLAKE
    python -m benchmarks.same_tables compare HASWELL SKYLAKE --tolerance 1e-6

With a tolerance, floats may differ by this share of the larger of the two. Everything else must be the same: rows,
keys, counts, verdicts and sentences. The largest share is printed.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.tables.schema import ASPECT

DATA = Path(os.environ.get("TRACKNOISE_DATA", "../shared/data"))
RUNS = ("demo", "sevenscenes", "kitti", "dtu")
SENTENCES = ("text", "topic", "figure", "why")
"""Columns for readers: sentences, and the section of the report that they belong to."""
STAGE = [
    "simulate",
    "--layout",
    "dtu",
    "--option",
    "worlds=2",
    "--option",
    "width=400",
    "--option",
    "height=300",
    "--option",
    "image_format=bmp",
]


def record(out: Path) -> None:
    """Make the four runs with the `tracknoise` that this interpreter imports."""
    stage = out / "data" / "dtu"
    commands = [
        ["demo", "--out", str(out / "demo")],
        ["run", "examples/sevenscenes.toml", "--data", str(DATA / "sevenscenes"), "--out", str(out / "sevenscenes")],
        ["run", "kitti", "--data", str(DATA / "kitti"), "--out", str(out / "kitti")],
        [*STAGE, "--out", str(stage)],
        ["run", "dtu", "--data", str(stage), "--out", str(out / "dtu")],
    ]
    for command in commands:
        print("tracknoise", *command, flush=True)
        program = "from tracknoise.cli.app import main; main()"
        subprocess.run([sys.executable, "-c", program, *command, "--quiet"], check=True)


def compare(before: Path, after: Path, tolerance: float | None = None) -> int:
    """Print what differs, run by run; return 1 if a column holds other values, otherwise 0."""
    wrong, rounding = 0, Rounding(tolerance)
    for name in RUNS if not _is_run(before) else ("",):
        differences, same = [], 0
        tables = sorted({*_tables(before / name), *_tables(after / name)})
        if not tables:
            sys.exit(f"no tables of a run in {before / name} and {after / name}")
        for table in tables:
            found = list(_differences(before / name, after / name, table, rounding))
            same += not any(line.endswith(("differs", "only before")) or line.startswith("differs") for line in found)
            differences += [f"{table}: {line}" for line in found]
        wrong += sum("differs" in line for line in differences)
        print(f"{name or before}: {same} of {len(tables)} tables {rounding.agree}")
        for line in _folded(differences):
            print(f"  {line}")
    print("no number differs" if not wrong else f"{wrong} columns differ")
    if tolerance is not None:
        print(f"largest relative difference of two floats: {rounding.largest:.2g} ({rounding.place or 'none'})")
    return int(wrong > 0)


def _is_run(folder: Path) -> bool:
    return (folder / "manifest.json").exists()


def _tables(run: Path) -> list[Path]:
    """Tables of a run."""
    return [path.relative_to(run) for path in run.rglob("*.parquet")]


def _table(run: Path, name: Path) -> pl.DataFrame | None:
    """A table of a run; None where it has none."""
    return with_typed_aspects(pl.read_parquet(run / name)) if (run / name).exists() else None


def _differences(before: Path, after: Path, name: Path, rounding: "Rounding") -> Iterator[str]:
    old, new = _table(before, name), _table(after, name)
    if old is None or new is None:
        yield "only after" if old is None else "only before"
        return
    if old.height != new.height:
        yield f"differs: {old.height} rows, then {new.height}"
        return
    for column in [*old.columns, *(column for column in new.columns if column not in old.columns)]:
        if column not in old.columns or column not in new.columns:
            yield f"column {column} only {'before' if column in old.columns else 'after'}"
        elif not rounding.allows(old[column], new[column], f"{name.stem}, {column}"):
            may_differ = column in SENTENCES and rounding.tolerance is None
            yield f"column {column} {'reworded' if may_differ else 'differs'}"


def with_typed_aspects(table: pl.DataFrame) -> pl.DataFrame:
    """A table with aspects as text, `lives K` among them, as one with the columns `aspect` and `at_least`."""
    if table.schema.get("aspect") != pl.String:
        return table
    name, place = pl.col("aspect"), table.columns.index("aspect")
    lives = name.str.starts_with("lives ")
    age = pl.when(lives).then(name.str.strip_prefix("lives ")).cast(pl.UInt32)
    aspect = pl.when(lives).then(pl.lit("long_lived")).otherwise(name).cast(ASPECT)
    typed = table.with_columns(aspect=aspect).insert_column(place + 1, table.select(at_least=age)["at_least"])
    return typed.sort(typed.columns[: place + 2], maintain_order=True)


@dataclass
class Rounding:
    """How much floats may differ, and how much they do at most.

    Attributes
    ----------
    tolerance
        Largest difference, as a share of the larger of two floats; None where all bytes must be the same.
    largest, place
        The largest difference that was seen, as such a share, and where.
    """

    tolerance: float | None
    largest: float = 0.0
    place: str = ""

    @property
    def agree(self) -> str:
        """What tables do that count as the same."""
        if self.tolerance is None:
            return "have the same bytes in every column that holds no sentence"
        return f"agree, floats to a relative tolerance of {self.tolerance:g}"

    def allows(self, old: pl.Series, new: pl.Series, place: str) -> bool:
        """Whether two columns count as the same."""
        if self.tolerance is None or not _innermost(old).is_float() or old.dtype != new.dtype:
            return _same_bytes(old, new)
        if old.dtype == pl.List:
            same_lengths = old.list.len().equals(new.list.len(), null_equal=True)
            return same_lengths and self.allows(old.explode(), new.explode(), place)
        if not old.is_null().equals(new.is_null()):
            return False
        share = _shares(old.drop_nulls().to_numpy(), new.drop_nulls().to_numpy())
        if share.max(initial=0.0) > self.largest:
            self.largest, self.place = float(share.max()), place
        return bool(np.all(share <= self.tolerance))


def _innermost(column: pl.Series) -> pl.DataType:
    """The type of a column, or of the elements of its lists."""
    return column.dtype.inner if isinstance(column.dtype, pl.List) else column.dtype


def _shares(old: NDArray[np.floating], new: NDArray[np.floating]) -> NDArray[np.float64]:
    """Differences of floats as shares of the larger; infinite where only one is finite or not a number."""
    same = (old == new) | (np.isnan(old) & np.isnan(new))
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.abs(old - new) / np.maximum(np.abs(old), np.abs(new))
    return np.where(same, 0.0, np.where(np.isfinite(share), share, np.inf))


def _same_bytes(old: pl.Series, new: pl.Series) -> bool:
    """Whether two columns have one type and the same bits: 0.0 is not -0.0 here."""
    if old.dtype != new.dtype or not old.is_null().equals(new.is_null()):
        return False
    if old.dtype.is_float():
        kind = pl.Int64 if old.dtype == pl.Float64 else pl.Int32
        old, new = (column.drop_nulls().reinterpret(dtype=kind) for column in (old, new))
    return old.equals(new)


def _folded(lines: list[str]) -> list[str]:
    """One line for all sequences of which the same is said."""
    said: dict[str, int] = {}
    for line in lines:
        path, _, text = line.partition(": ")
        said[f"{Path(path).parent}: {text}"] = said.get(f"{Path(path).parent}: {text}", 0) + 1
    return [f"{text} ({count} tables)" if count > 1 else text for text, count in said.items()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("record").add_argument("out", type=Path)
    comparing = actions.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument(
        "--tolerance", type=float, help="largest relative difference of floats; nothing else may differ"
    )
    chosen = parser.parse_args()
    if chosen.action == "compare":
        return compare(chosen.before, chosen.after, chosen.tolerance)
    record(chosen.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
