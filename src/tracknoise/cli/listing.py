"""Format a registry as text: one name and its description per line."""

from collections.abc import Mapping


def listing(descriptions: Mapping[str, str]) -> str:
    """Names and descriptions in two aligned columns, sorted by name."""
    width = max(map(len, descriptions), default=0)
    return "\n".join(f"{name.ljust(width)}  {text}" for name, text in sorted(descriptions.items()))
