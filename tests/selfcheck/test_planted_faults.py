"""The benchmark of the self-test can plant every one of its faults in the package as it is."""

import pytest
from benchmarks.validity.planted_faults import FAULTS, SOURCE, Fault


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_text_that_a_fault_replaces_is_in_the_package_once(fault: Fault) -> None:
    for path, old, new in fault.edits:
        text = (SOURCE / path).read_text(encoding="utf-8")
        assert text.count(old) == 1
        compile(text.replace(old, new), path, "exec")
