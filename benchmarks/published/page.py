"""The page of the published benchmark."""

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean

from tracknoise.report.results_file import Results, Round, StatedPoses, standings
from tracknoise.words import DASH, listing, number, percent, pixels

_ABOUT = """# Benchmark

**{best}**

Sigma to set in a filter, px; of `-stereo` trackers, for positions in both cameras. Raised: ranks in typical error
(core), where there are six scenes and exact poses. Rank 2 to 5 of 15: one tracker is shown to be better by more than
10 %, ten to be worse. `≤`: the truth is not trusted, and sigma is at most this.
"""
_TRUTHS = """
## How wrong stated truths are

By poses that are refined with reference tracks, which are never measured: how errors of stated poses grow per root
frame, what they add to errors of tracks, and their share of the squared errors of `lucas-kanade` (core) at the later
age.
"""
_ADD = """
## Add your tracker

```sh
tracknoise tournament --add mine.toml --to docs/benchmark.json --data /data
```

measures the trackers of `mine.toml` in every round, ranks them among the others, and writes them into the file. Rounds
of recordings need their folders in that of `--data`. Other data, truth, settings or versions of libraries are refused.

`xfeat` are keypoints of a network, matched by its descriptors or followed by Lucas-Kanade. `benchmarks/xfeat.toml` has
their settings, and `benchmarks/xfeat.py` makes the file of the network.

All of it again: `python -m benchmarks.published FOLDER --data /data --learned WHEEL`, with the rounds of
`benchmarks/published`.
"""
_EXAMPLE = "lucas-kanade"
EN_DASH = "\N{EN DASH}"


def page(results: Results, abouts: Mapping[str, str]) -> str:
    """Sigmas and ranks of every tracker in every round, how wrong stated truths are, and how to add a tracker.

    `abouts`: what the data of each round are.
    """
    rounds = dict(sorted(results.rounds.items(), key=lambda pair: (bool(pair[1].folder), pair[0])))
    parts = [_ABOUT.format(best=_best(rounds)), _sigmas(rounds), _data(abouts)]
    known = {name: (poses, one) for name, one in rounds.items() if (poses := one.stated_poses) is not None}
    parts += [_TRUTHS, _truths(known)] if known else []
    return "\n".join([*parts, _ADD, _made(results)])


def _best(rounds: Mapping[str, Round]) -> str:
    """Which trackers have the first rank in typical error, alone or with others, in the most rounds."""
    boards = [board for one in rounds.values() if (board := standings(one)).is_ranked]
    first = Counter(
        one.tracker for board in boards for one in board.rows if one.ranks.get(board.roles[0], (0,))[0] == 1
    )
    most = max(first.values(), default=0)
    best = sorted(name for name, n in first.items() if n == most)
    if not best:
        return ""
    rounds_of_best = sum(any(one.tracker == best[0] for one in board.rows) for board in boards)
    return f"{listing(best)} share the first rank in typical error in {most} of {rounds_of_best} simulated rounds."


def _data(abouts: Mapping[str, str]) -> str:
    return "\n".join([*(f"- **{name}**: {text}" for name, text in abouts.items())])


def _sigmas(rounds: Mapping[str, Round]) -> str:
    cells = {name: _ranked_sigmas(one) for name, one in rounds.items()}
    trackers = dict.fromkeys(tracker for of_round in cells.values() for tracker in of_round)
    rows = [[tracker, *(of_round.get(tracker, DASH) for of_round in cells.values())] for tracker in trackers]
    return _table(["tracker", *cells], rows)


def _ranked_sigmas(of: Round) -> dict[str, str]:
    """What to set for each tracker, px, with its ranks raised; by name, the best first."""
    board = standings(of)
    shown = {}
    for one in board.rows:
        sigma = f"{'≤' if one.is_bound else ''}{pixels(one.sigma.value)}"
        span = one.span(board.roles[0]).replace(" to ", EN_DASH)
        shown[one.tracker] = f"{sigma}<sup>{span}</sup>" if span else sigma
    return shown


def _truths(known: Mapping[str, tuple[StatedPoses, Round]]) -> str:
    rows = [
        [
            name,
            number(poses.rotation_deg),
            number(poses.position_m),
            pixels(poses.next_px),
            pixels(poses.stated_px),
            pixels(poses.left_px),
            percent(_share(poses, one)),
        ]
        for name, (poses, one) in known.items()
    ]
    ages = {poses.age for poses, _ in known.values() if poses.age is not None}
    at = f"age {ages.pop()}" if len(ages) == 1 else "the reference age"
    headings = ["recording", "degrees", "metres", "px at age 1", f"px at {at}", "px left when refined"]
    return _table([*headings, "share"], rows)


def _share(poses: StatedPoses, of: Round) -> float | None:
    """Share of stated poses in squared errors: both coordinates of `_EXAMPLE`, as large as its core, and theirs."""
    tracker = of.trackers.get(_EXAMPLE)
    if tracker is None or poses.age is None:
        return None
    cores = [core for one in tracker.scenes.values() if (core := one.core[poses.age - 1]) is not None]
    added = poses.stated_px**2
    return added / (added + 2.0 * fmean(core**2 for core in cores)) if cores else None


def _made(results: Results) -> str:
    versions = next(iter(results.rounds.values())).versions
    return (
        "Made with "
        + ", ".join(f"{name} {versions[name]}" for name in ("tracknoise", "opencv-contrib-python-headless"))
        + ".\n"
    )


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rules = ["---", *(["--:"] * (len(headings) - 1))]
    return "\n".join(f"|{'|'.join(row)}|" for row in (headings, rules, *rows)) + "\n"
