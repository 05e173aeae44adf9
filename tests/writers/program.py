"""The program as a file, and an experiment that it measures in a moment."""

PROGRAM = "from tracknoise.cli.app import main\nif __name__ == '__main__':\n    main()\n"


def small_experiment(tracker: str) -> str:
    """The text of an experiment with two simulated scenes; `tracker` is the body of its section ``[[trackers]]``."""
    return f"""
name = "small"
speeds = [1]
[dataset]
reader = "simulated"
options = {{ motions = ["forward"], frames = 4, width = 96, height = 72, worlds = 2, supersampling = 1 }}
[[trackers]]
{tracker}
[statistics]
min_features = 2
"""
