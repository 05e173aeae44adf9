"""The tables of a run that a noise model is fitted to, of one tracker at one speed in one view of each scene."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import polars as pl

from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.groups_of_scenes import groups_of_run
from tracknoise.noise_models.reference_view import reference_view
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import NOISE_PAIRS, empty
from tracknoise.tables.store import RunFolder

_NEEDED, _PAIRS = "noise_sums", "noise_pairs"
_OTHERS = ("noise_outliers", "noise_covariates", "samples", "ends", "window_noise", "floors", "rigid")


@dataclass(frozen=True, slots=True, eq=False)
class TrainingTables:
    """Tables of all scenes that a model is fitted to.

    Attributes
    ----------
    tracker, speed
        Name, and frames of the recording per frame that it saw.
    settings
        Its options.
    scenes
        Names, sorted.
    keys
        Of the sequences.
    groups
        Of scenes that are not independent of each other.
    tables
        Tables of all sequences together, of the tracker at the speed, by name.
    folder
        Of the run.
    """

    tracker: str
    speed: int
    settings: dict[str, object]
    scenes: tuple[str, ...]
    keys: tuple[str, ...]
    groups: SceneGroups
    tables: dict[str, pl.DataFrame]
    folder: RunFolder

    def __getitem__(self, name: str) -> pl.DataFrame:
        return self.tables[name]

    def of_sequence(self, name: str, key: str) -> pl.DataFrame:
        """A table of one sequence."""
        return self.folder.sequence_table(name, key)

    @property
    def audit_curves(self) -> pl.DataFrame | None:
        """Table `AUDIT_CURVES` of the run; None while it has not been audited."""
        audited = "audit_curves" in self.folder.manifest().statistics
        return self.folder.statistics("audit_curves") if audited else None

    def of_scenes(self, scenes: Collection[str]) -> "TrainingTables":
        """The same of some of the scenes."""
        of_scenes = self._of(pl.col("scene").is_in(list(scenes)), lambda sequence: sequence.scene in scenes)
        return replace(of_scenes, scenes=tuple(sorted(scenes)))

    def of_reference_view(self) -> "TrainingTables":
        """The same of one view of each scene."""
        view = reference_view(self[_NEEDED])
        rows = pl.all_horizontal(pl.col(name) == value for name, value in view.items())
        of_view = self._of(rows, lambda found: all(getattr(found, name) == value for name, value in view.items()))
        return replace(of_view, scenes=tuple(sorted(of_view[_NEEDED]["scene"].unique())))

    def _of(self, rows: pl.Expr, includes: Callable[[SequenceId], bool]) -> "TrainingTables":
        entries = self.folder.manifest().sequences
        return replace(
            self,
            keys=tuple(key for key in self.keys if includes(entries[key].sequence)),
            tables={name: table.filter(rows) for name, table in self.tables.items()},
        )


def conditions(folder: RunFolder) -> list[tuple[str, int]]:
    """Trackers and speeds that noise models can be fitted to, sorted.

    Raises
    ------
    StoreError
        If there are none.
    """
    found = [table.unique() for table in folder.stored_tables(_NEEDED, only=["tracker", "speed"])]
    rows = sorted(pl.concat(found).unique().iter_rows()) if found else []
    if not rows:
        raise _without_sums(folder)
    return rows


def chosen_conditions(
    folder: RunFolder, *, trackers: Collection[str] | None = None, speeds: Collection[int] | None = None
) -> list[tuple[str, int]]:
    """The same of some trackers and speeds; by default of all.

    Raises
    ------
    UnknownNameError
        If one of the trackers is not among them.
    SettingsError
        If one of the speeds is not, or no such tracker has such a speed.
    StoreError
        If there are none.
    """
    known = conditions(folder)
    names, every = {name for name, _ in known}, sorted({speed for _, speed in known})
    for tracker in trackers or ():
        if tracker not in names:
            raise UnknownNameError("tracker", tracker, names)
    for speed in speeds or ():
        if speed not in every:
            raise SettingsError(f"{folder.path}: found no speed {speed}, expected one of {', '.join(map(str, every))}")
    wanted = [(name, speed) for name, speed in known if name in (trackers or names) and speed in (speeds or every)]
    if not wanted:
        expected = ", ".join(f"{name}@{speed}" for name, speed in known)
        raise SettingsError(f"{folder.path}: found none of the wanted trackers and speeds, expected some of {expected}")
    return wanted


def _without_sums(folder: RunFolder) -> StoreError:
    expected = "a run of this version whose truth is known for each first position (neither scan nor triangulated)"
    return StoreError(f"{folder.path}: holds no sums for noise models, expected {expected}")


def training_tables(
    folder: RunFolder, *, tracker: str, speed: int, scenes: Collection[str] | None = None
) -> TrainingTables:
    """Read what a model is fitted to.

    Parameters
    ----------
    folder
        Of a finished run.
    tracker, speed
        Names as in the run.
    scenes
        Names of the scenes; by default all.

    Raises
    ------
    UnknownNameError
        If there is no such tracker or scene.
    SettingsError
        If there is no such speed, or no scene.
    StoreError, SchemaError
        If a table is missing or damaged.
    """
    return all_training_tables(folder, [(tracker, speed)], scenes=scenes)[0]


def all_training_tables(
    folder: RunFolder, wanted: Sequence[tuple[str, int]], *, scenes: Collection[str] | None = None
) -> list[TrainingTables]:
    """The same for several models. Each table of the run is read once.

    Parameters
    ----------
    folder, scenes
        As in `training_tables`.
    wanted
        Trackers and speeds.

    Raises
    ------
    UnknownNameError, SettingsError, StoreError, SchemaError
        As `training_tables`.
    """
    entries = folder.manifest().sequences
    _require_scenes({entry.sequence.scene for entry in entries.values()}, scenes)
    chosen = {
        key: entry
        for key, entry in sorted(entries.items())
        if _NEEDED in entry.sha256 and (scenes is None or entry.sequence.scene in scenes)
    }
    if not chosen:
        raise _without_sums(folder)
    has_pairs = all(_PAIRS in entry.sha256 for entry in chosen.values())  # scenes of an earlier version have none
    names = [*_OTHERS, *([_PAIRS] if has_pairs else [])]
    of = {_NEEDED: _pooled(folder, _NEEDED, tuple(chosen), wanted)}
    if any(table.is_empty() for table in of[_NEEDED]):
        _require_conditions(folder, wanted)
    of |= {name: _pooled(folder, name, tuple(chosen), wanted) for name in names}
    if not has_pairs:
        of[_PAIRS] = [empty(NOISE_PAIRS)] * len(wanted)
    groups = groups_of_run(folder)
    read = [
        TrainingTables(
            tracker=tracker,
            speed=speed,
            settings=_settings(folder, tracker),
            scenes=tuple(sorted(of[_NEEDED][place]["scene"].unique())),
            keys=tuple(chosen),
            groups=groups,
            tables={name: tables[place] for name, tables in of.items()},
            folder=folder,
        )
        for place, (tracker, speed) in enumerate(wanted)
    ]
    return [tables.of_reference_view() for tables in read]


def _require_conditions(folder: RunFolder, wanted: Sequence[tuple[str, int]]) -> None:
    known = conditions(folder)
    names = {name for name, _ in known}
    for tracker, speed in wanted:
        if tracker not in names:
            raise UnknownNameError("tracker", tracker, names)
        if (tracker, speed) not in known:
            speeds = ", ".join(str(one) for name, one in known if name == tracker)
            raise SettingsError(f"{folder.path}: found no speed {speed} of {tracker}, expected one of {speeds}")


def _require_scenes(known: set[str], wanted: Collection[str] | None) -> None:
    for scene in wanted or ():
        if scene not in known:
            raise UnknownNameError("scene", scene, known)
    if wanted is not None and not wanted:
        raise SettingsError("noise model: found no scenes to fit to, expected at least one")


def _pooled(folder: RunFolder, name: str, keys: Sequence[str], wanted: Sequence[tuple[str, int]]) -> list[pl.DataFrame]:
    """Rows of each tracker and speed, of all sequences."""
    rows = [(pl.col("tracker") == tracker) & (pl.col("speed") == speed) for tracker, speed in wanted]
    parts = ([table.filter(mine) for mine in rows] for table in folder.stacked_tables(name, keys))
    return [pl.concat(own) for own in zip(*parts, strict=True)]


def _settings(folder: RunFolder, tracker: str) -> dict[str, object]:
    """Settings of the tracker in the experiment; empty if they are not there."""
    for settings in folder.settings()["trackers"]:
        if settings.get("name", settings["kind"]) == tracker:
            return dict(settings)
    return {}
