"""Run one attack: ``python -m benchmarks.attack fuzz|kills|signals|flips|names|links [options]``.

Each attack is a module with a function `main(arguments)`, which prints counts and returns the exit code: 0 if
everything was as expected.
"""

import argparse
import sys
from importlib import import_module

ATTACKS = ("fuzz", "kills", "signals", "flips", "names", "links")


def main(arguments: list[str]) -> int:
    """Run the attack that the first argument names, with the others."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack", description=__doc__)
    parser.add_argument("attack", choices=ATTACKS)
    parser.add_argument("options", nargs=argparse.REMAINDER, help="--help lists those of an attack")
    chosen = parser.parse_args(arguments)
    code: int = import_module(f"benchmarks.attack.{chosen.attack}").main(chosen.options)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
