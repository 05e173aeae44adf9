"""How a registry is listed: a name and a description a line."""

from collections.abc import Mapping


def listing(descriptions: Mapping[str, str]) -> str:
    """Names and what they stand for, aligned, sorted by name."""
    width = max(map(len, descriptions), default=0)
    return "\n".join(f"{name.ljust(width)}  {text}" for name, text in sorted(descriptions.items()))
