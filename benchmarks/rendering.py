"""How fast simulated frames are rendered; the renderer uses one core."""

from collections.abc import Callable

import numpy as np

from benchmarks.harness import Row, median_ms
from tracknoise.sequences.simulated import Simulated, SimulatedSequence
from tracknoise.tables.identity import SequenceId

REPEATS = 5


def rows() -> list[Row]:
    """Frames a second at 800x600 with 2x2 rays a pixel and sensor noise; what shadows, depth and worlds cost."""
    plain, shaded = Simulated(), Simulated(motions=("sideways",), shadows=True)
    table = []
    for sequence_id in plain.sequences():
        sequence = plain.open(sequence_id)
        table += [_rate(sequence_id.scene, sequence), _time("exact depth of", sequence_id.scene, _depth(sequence))]
    table.append(_rate("sideways-00 with shadows", shaded.open(shaded.sequences()[0])))
    table.append(_time("building the world of", sequence_id.scene, _build(plain, sequence_id), repeats=2))
    return table


def _rate(name: str, sequence: SimulatedSequence) -> Row:
    return Row(
        f"rendering {name} at 800x600, 2x2 rays", 1e3 / median_ms(lambda: sequence.image(1), REPEATS), "frames/s"
    )


def _time(what: str, scene: str, run: Callable[[], object], *, repeats: int = REPEATS) -> Row:
    return Row(f"{what} {scene}", median_ms(run, repeats), "ms")


def _depth(sequence: SimulatedSequence) -> Callable[[], object]:
    return lambda: sequence.depth(1)


def _build(reader: Simulated, sequence_id: SequenceId) -> Callable[[], object]:
    """Casting a single ray builds the world and its search tree, and nothing else."""
    return lambda: reader.open(sequence_id).cast(0, np.zeros((1, 2)))
