"""Measure all scenes of a study of effects into a folder. An interrupted study resumes."""

import io
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict
from itertools import repeat
from pathlib import Path

import polars as pl

from tracknoise.children import process_pool
from tracknoise.exceptions import SettingsError, StoreError, first_line
from tracknoise.experiments.effects.scene_values import Study, measure_scene
from tracknoise.findings.paired_changes import paired_changes
from tracknoise.tables.effects_schema import EFFECT_CHANGES, EFFECT_UNITS, EFFECT_VALUES, Size
from tracknoise.tables.files import write_atomically
from tracknoise.tables.schema import check, check_stored

_SETTINGS, _SCENES = "settings.json", "scenes"

Part = tuple[str, Size]
"""A scene and a size of effects, which are measured together."""


def run_study(
    study: Study, folder: Path, *, workers: int = 1, fresh: bool = False, done: Callable[[Part, int, int], None]
) -> pl.DataFrame:
    """Measure a study, or what is missing of it, and compare.

    Parameters
    ----------
    study
        What is measured.
    folder
        New or empty, or that of a study with the same settings, which may have another number of scenes.
    workers
        Number of processes.
    fresh
        Delete what the folder holds of another study.
    done
        Called for each part that is measured, with how many parts are done, and the count of all.

    Returns
    -------
    polars.DataFrame
        Schema `EFFECT_CHANGES`.

    Raises
    ------
    SettingsError
        If the sequences are too short for the ages.
    StoreError
        If the folder holds something else, or cannot be written.
    """
    oldest, frames = max(study.ages), study.reader.frames
    if oldest >= frames:
        raise SettingsError(f"age {oldest} of {frames} frames, expected an age of at most {frames - 1}")
    _prepare(folder, study, fresh=fresh)
    parts = [(name.scene, size) for name in study.reader.sequences() for size in study.sizes]
    missing = [part for part in parts if not _file(folder, part).exists()]
    for count, (part, values) in enumerate(_measured(study, missing, workers), len(parts) - len(missing) + 1):
        write_atomically(_file(folder, part), values)
        done(part, count, len(parts))
    return _changes(study, pl.concat([_read(_file(folder, part)) for part in parts]))


def _measured(study: Study, parts: list[Part], workers: int) -> Iterator[tuple[Part, bytes]]:
    """Tables of the parts as Parquet files, in order."""
    if workers == 1 or len(parts) < 2:
        yield from ((part, _measure(study, part)) for part in parts)
        return
    with process_pool(min(workers, len(parts))) as pool:
        yield from zip(parts, pool.map(_measure, repeat(study), parts), strict=True)


def _measure(study: Study, part: Part) -> bytes:
    buffer = io.BytesIO()
    measure_scene(study, *part).write_parquet(buffer)
    return buffer.getvalue()


def _changes(study: Study, values: pl.DataFrame) -> pl.DataFrame:
    """Changes with the texts of the effects, in the order of the catalogue."""
    rows = [(effect.name, effect.kind, size, effect.shown[size]) for effect in study.effects for size in study.sizes]
    schema = {name: EFFECT_CHANGES[name] for name in ("effect", "kind", "size", "shown")}
    named = pl.DataFrame(rows, schema=schema, orient="row")
    units = pl.col("statistic").cast(pl.String).replace_strict({str(name): unit for name, unit in EFFECT_UNITS.items()})
    changes = named.join(paired_changes(values), on=["effect", "size"], maintain_order="left_right")
    return check(changes.with_columns(unit=units).select(*EFFECT_CHANGES), EFFECT_CHANGES, "effect changes")


def _prepare(folder: Path, study: Study, *, fresh: bool) -> None:
    """Make the folder, and refuse one with other settings."""
    settings, path = _settings(study), folder / _SETTINGS
    known = path.exists()
    if not known and folder.is_dir() and any(folder.iterdir()):
        raise StoreError(f"{folder}: holds other files, expected a new or empty folder, or a study of effects")
    if known and not fresh and path.read_bytes() != settings:
        raise StoreError(f"{folder}: holds a study with other settings, expected the same, another folder or --fresh")
    if fresh or not known:
        shutil.rmtree(folder / _SCENES, ignore_errors=True)
        write_atomically(path, settings)


def _settings(study: Study) -> bytes:
    """What results depend on; not the number of scenes."""
    options = {name: value for name, value in study.options.items() if name != "worlds"}
    content = json.dumps({**asdict(study), "options": options}, indent=1, default=dict)
    return content.encode()


def _file(folder: Path, part: Part) -> Path:
    scene, size = part
    return folder / _SCENES / f"{scene}-{size}.parquet"


def _read(path: Path) -> pl.DataFrame:
    """One part.

    Raises
    ------
    StoreError
        If it is damaged.
    """
    try:
        return check_stored(pl.read_parquet(path), EFFECT_VALUES, path.name)
    except (OSError, pl.exceptions.PolarsError) as error:
        found = f"damaged ({first_line(error)})"
        raise StoreError(f"{path}: {found}, expected a table; delete it to measure again") from error
