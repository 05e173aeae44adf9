"""The page of the documentation on exports, made from the data of the estimators."""

import sys
from collections.abc import Iterable, Iterator

from tracknoise.estimators.exports import FAMILIES, PURPOSES, Estimator, estimators, refused
from tracknoise.estimators.model import TOLERANCE

_INTRODUCTION = """\
# Exports to estimators

<!-- Made from src/tracknoise/estimators/syntaxes. Edit the files there, then run:
python -m benchmarks.documents.exports > docs/estimators/exports.md -->

`tracknoise export` writes the noise of a tracker in the syntax of an estimator, from a run or a noise model.

```sh
tracknoise export runs/mine --tracker lucas-kanade --to openvins --focal 458.6 --rate 20 -o config
tracknoise export                         # lists the estimators
```

With `-o`, the files are written to a folder, with a text and with a patch if there is one. Otherwise they are printed.
**The text says what the number makes right, which keys of the estimator have no effect, what it cannot express, and the
version that this was checked against.** From Python: `model.export("openvins")`. Case, hyphens and spaces in names do
not matter.

A model from a truth that is not trusted or unknown is refused without `--allow untrusted` ([truth](../truth.md)). The
verdict is in a comment of each file unless the truth is trusted.

## Which numbers are written

Sigma, gates and robust loss are chosen together, for the state and the window of the estimator
([how](../estimators.md#how-the-numbers-are-chosen)). `--window` changes the default below, `Target(purpose=...)` in
Python the purpose. The window of the model that is nearest in length is taken.

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
| the same images, resampled | `--allow resampled` | px scale with the focal length |
| another lens | `--allow lens` | px stay as they are; this was not measured |
| every n-th frame of the tracker is used | `--allow thinned` | white noise stays, walks of n frames add up |
| the model does not know its rate | `--allow unchecked` | the rate is taken as stated |
| another rate of the tracker | none | refused: motions between frames differ, and so does the noise |

"""


def markdown() -> str:
    """The content of ``docs/estimators/exports.md``."""
    purposes = "".join(f"| `{purpose}` | {phrase} |\n" for purpose, phrase in PURPOSES.items())
    return f"{_INTRODUCTION}{purposes}{_CONVERSION}" + "\n".join(_body()).rstrip() + "\n"


def _body() -> Iterator[str]:
    for family, title in FAMILIES.items():
        yield f"## {title}\n"
        yield from (_entry(name, about) for name, about in estimators().items() if about.family == family)
        yield ""
    yield "## No export\n"
    for name, item in refused().items():
        yield f"- **{item.title}** ({_names(name, item.aliases)}): {item.why}"


def _entry(name: str, about: Estimator) -> str:
    """What ``--to`` calls it, its unit, and where the numbers belong."""
    window = f" Windows of {about.window} frames, `{about.purpose}`." if about.purpose else ""
    needs = "".join(f" Needs {_NEEDS[need]}." for need in about.needs)
    title = f"**{about.title}** ({_names(name, about.aliases)})"
    return f"- {title}: {about.unit}. Where: {about.place}.{window}{needs}"


def _names(name: str, aliases: Iterable[str]) -> str:
    return ", ".join(f"`{one}`" for one in (name, *aliases))


_NEEDS = {
    "focal length": "`--focal`, unless the model knows it",
    "rate": "`--rate`, unless the model knows it",
    "observations": "`--tracks`",
}


if __name__ == "__main__":
    sys.stdout.write(markdown())
