"""How processes of Python that this program starts begin: what they import, and what becomes of what they print."""

import os
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from types import MappingProxyType

from tracknoise import standard_streams

_SAFE_PATH, _OURS = "PYTHONSAFEPATH", "set by tracknoise"
_NOTHING: Mapping[str, str] = MappingProxyType({})


@contextmanager
def safely_started(environment: Mapping[str, str] = _NOTHING) -> Iterator[None]:
    """Let processes that `multiprocessing` starts in the block not import modules of the current folder by mistake.

    They begin with ``python -c``, which looks in the current folder first. A ``pickle.py`` among the data would be run
    in place of the standard one. If this process itself looks there, as an interactive one does, they do so last.
    `begin` must be the first call in each of them.

    Parameters
    ----------
    environment
        Environment variables of these processes, besides those of this one.
    """
    safe = {} if os.environ.get(_SAFE_PATH) else {_SAFE_PATH: _OURS}
    with _added_to_environment({**environment, **safe}), _current_folder_last():
        yield


def begin() -> None:
    """Prepare a process that was started by `safely_started`. Its results are not what it prints."""
    if os.environ.get(_SAFE_PATH) == _OURS:
        del os.environ[_SAFE_PATH]  # programs of plug-ins find what lies beside them
    standard_streams.prepare()


@contextmanager
def process_pool(workers: int, environment: Mapping[str, str] = _NOTHING) -> Iterator[ProcessPoolExecutor]:
    """Processes that share work; the parameters are their number and those of `safely_started`."""
    spawn = get_context("spawn")
    with safely_started(environment), ProcessPoolExecutor(workers, mp_context=spawn, initializer=begin) as pool:
        yield pool


def module_path() -> list[str]:
    """Where this process looks for modules, the current folder by its name and last."""
    return [*filter(None, sys.path), *([os.getcwd()] if "" in sys.path else [])]  # noqa: PTH109 (a str is wanted)


@contextmanager
def _added_to_environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Some variables are read when a process begins, so that it cannot set them itself."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _current_folder_last() -> Iterator[None]:
    """`multiprocessing` passes the module path on."""
    if "" not in sys.path:
        yield
        return
    place = sys.path.index("")
    sys.path.append(sys.path.pop(place))
    try:
        yield
    finally:
        if "" in sys.path:
            sys.path.remove("")
            sys.path.insert(place, "")
