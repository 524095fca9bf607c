import resource

import pytest

from falsifier.core.memory import check_memory_limits
from falsifier.errors import MachineError


def test_this_process_may_use_enough() -> None:
    check_memory_limits()


def test_a_limit_that_is_too_low_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1 << 20, 1 << 20))
    with pytest.raises(MachineError, match=r"1 MiB of memory .ulimit -d.*ulimit -d 307200") as error:
        check_memory_limits()
    assert error.value.exit_code == 3
