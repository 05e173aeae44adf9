"""The program, as it is called from a shell."""

import pytest

from tracknoise.cli.app import main


@pytest.fixture
def tracknoise(capsys):
    def go(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main(list(arguments))
        captured = capsys.readouterr()
        return exit_.value.code, captured.out, captured.err

    return go
