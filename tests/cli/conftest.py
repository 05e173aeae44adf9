"""The program, as it is called from a shell."""

import pytest
from tests.writers.wall import write_wall

from tracknoise.cli.app import main


@pytest.fixture
def tracknoise(capsys):
    def go(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main(list(arguments))
        captured = capsys.readouterr()
        return exit_.value.code, captured.out, captured.err

    return go


@pytest.fixture
def scene(tmp_path):
    """The folder of a sequence that can be measured, beside the experiment ``x.toml``."""
    folder = tmp_path / "data" / "seq-01"
    write_wall(folder)
    (tmp_path / "x.toml").write_text(
        'name = "x"\nspeeds = [1]\n[dataset]\nreader = "sevenscenes"\nroot = "data"\n'
        '[[trackers]]\nkind = "lucas-kanade"\n[statistics]\nmin_features = 2\n'
    )
    return folder
