"""The page of the documentation on exports, made from the data of the estimators."""

import sys
from collections.abc import Iterator

from tracknoise.estimators.exports import FAMILIES, LANDMARKS, PURPOSES, Estimator, estimators, refused
from tracknoise.estimators.model import TOLERANCE

_INTRODUCTION = """\
# Noise for your estimator

<!-- Made from src/tracknoise/estimators/syntaxes. Edit the files there, then run:
python -m tracknoise.estimators.export_page > docs/estimators/exports.md -->

`tracknoise noise export` writes the noise of a model in the syntax of an estimator. It also says what the number makes
right, and what the estimator cannot express.

```sh
tracknoise noise export lk.noise.json --to openvins --focal 458.6 --rate 20 -o config
tracknoise noise export --list
```

With `-o`, the files are written to a folder, with a text and with a patch if there is one. Otherwise they are printed.
From Python: `model.export("openvins")`, with `target=` for another camera, rate, window or purpose. Case, hyphens and
spaces in names do not matter: `OpenVINS` and `open-vins` are `openvins`.

A model from a truth that is not trusted, or of which this is unknown, is refused without `--accept-truth`
([trust](../trust.md)). The verdict on the truth is in a comment of each file. CSV has the comment only where the truth
is not trusted or this is unknown.

## Which numbers are written

Sigma, gates and robust loss are chosen together, for the state and the window of the estimator
([how](../estimators.md#how-the-numbers-are-chosen)). `tracknoise noise show MODEL --for NAME` says the same, and so
does the first finding of a run with `[estimator] name = "NAME"`. Each estimator has a default window and a default
purpose, in the tables below. `--window` and `--purpose` change them. The window of the model that is nearest in length
is taken.
The first line of each file states the numbers with their intervals. `filter`, `sliding_window`, `mapping` and `pnp` are
kinds of estimators.

| Purpose | What is right |
|---|---|
"""
_CONVERSION = f"""
With a walk, these numbers differ. A sigma that makes innovations look right makes the newest pose too certain. Files in
the syntax of a configuration are fragments: replace the keys of the same names in your file, and keep all others.

## Focal length and rate

Both must be those of the model, to {100 * TOLERANCE:g} %. Without the options, those of the model are used.

| Difference | Option | What happens |
|---|---|---|
| the same images, resampled | `--allow-focal resampled` | px scale with the focal length |
| another lens | `--allow-focal lens` | px stay as they are; this was not measured |
| every n-th frame of the tracker is used | `--allow-rate thinned` | white noise stays, walks of n frames add up |
| the model does not know its rate | `--allow-rate unchecked` | the rate is taken as stated |
| another rate of the tracker | none | refused: motions between frames differ, and so does the noise |

A tracker that runs on resampled images has other noise than one whose positions are scaled. Measure it on such images.
For the rate of a tracker that skips frames, fit the model to that speed of the run.

"""


def markdown() -> str:
    """The content of ``docs/estimators/exports.md``."""
    purposes = "".join(f"| `{purpose}` | {phrase} |\n" for purpose, phrase in PURPOSES.items())
    return f"{_INTRODUCTION}{purposes}{_CONVERSION}" + "\n".join(_body()).rstrip() + "\n"


def _body() -> Iterator[str]:
    for family, title in FAMILIES.items():
        yield f"## {title}\n"
        for name, about in estimators().items():
            if about.family == family:
                yield from _section(name, about)
    yield "## No export\n"
    for name, item in refused().items():
        yield f"- **{item.title}** ({', '.join(f'`{one}`' for one in (name, *item.aliases))}): {item.why}"


def _section(name: str, about: Estimator) -> Iterator[str]:
    rows = {
        "`--to`": ", ".join(f"`{one}`" for one in (name, *about.aliases)),
        "Unit": about.unit,
        "Where": about.place,
        "First observation": LANDMARKS[about.landmark],
        "Default": about.purpose and f"`{about.purpose}`, windows of {about.window} frames",
        "Needs": ", ".join(_NEEDS[need] for need in about.needs),
        "Cannot be expressed": "; ".join(about.cannot),
        "Files": ", ".join(f"`{file}`" for file in about.files) + (", and a patch" if about.patch else ""),
        "Checked against": ", ".join(about.checked_against),
    }
    yield f"### {about.title}\n\n| | |\n|---|---|"
    yield from (f"| {key} | {value} |" for key, value in rows.items() if value)
    yield ""
    yield from (f"- {sentence}" for sentence in (*about.without_effect, *about.notes))
    yield ""


_NEEDS = {
    "focal length": "`--focal`, unless the model knows it",
    "rate": "`--rate`, unless the model knows it",
    "observations": "`--tracks`",
}


if __name__ == "__main__":
    sys.stdout.write(markdown())
