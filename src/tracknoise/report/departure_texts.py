"""The texts on how tracknoise differs from the paper, and the page of the documentation that is made from them."""

import sys
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources

_INTRODUCTION = """\
# Differences from the paper

<!-- Made from src/tracknoise/report/departures.toml. Edit that file, then run:
python -m tracknoise.report.departure_texts > docs/differences-from-the-paper.md -->

The presets `dtu`, `kitti`, `gazebo-linear` and `gazebo-arvr` repeat the experiments of S. Tsuei, W. Mo and S. Soatto,
"Feature Tracks are not Zero-Mean Gaussian", 2022 ([arXiv 2303.14315](https://arxiv.org/abs/2303.14315)). This page
lists every difference from the paper and its reason. No preset is tuned to agree with the paper.

`tracknoise replicate --out FOLDER` measures what the differences change. It writes `FOLDER/differences.html`: this list
with the numbers of its runs. Curves are compared by the rule of the verdicts (see [Effects](statistics.md#effects)).
"""


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Title and text of every difference by its id, in the order of the page. Some have `see`, a page in docs/."""
    source = resources.files("tracknoise.report") / "departures.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def markdown() -> str:
    """The content of ``docs/differences-from-the-paper.md``."""
    return "\n".join([_INTRODUCTION, *map(_section, texts().values())])


def _section(item: Mapping[str, str]) -> str:
    parts = [f"## {item['title']}\n", item["text"].lstrip()]
    if "see" in item:
        parts.append(f"See [{item['see'].partition('#')[0]}]({item['see']}).\n")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.stdout.write(markdown())
