import pytest

from falsifier.context.sentry import Sentry
from falsifier.errors import SpecError

ALARM = "gain = 3\npassword: operators know it\n"


def test_a_line_like_a_key_is_refused_with_what_to_do() -> None:
    with pytest.raises(
        SpecError, match=r"a\.md: line 2 looks like a key.*leave it out; if it is none.*checked:a\.md"
    ):
        Sentry(()).look(ALARM, "a.md", "a.md", "leave it out")


def test_an_allowed_line_is_noted_once() -> None:
    sentry = Sentry(["a.md"])
    for _ in range(2):
        sentry.look(ALARM, "a.md", "a.md", "leave it out")
    sentry.refuse_unused()
    assert sentry.notes == ["context a.md: line 2 looks like a key, token or password, and was allowed"]


def test_only_the_named_file_is_allowed() -> None:
    with pytest.raises(SpecError, match=r"b\.md: line 2"):
        Sentry(["a.md"]).look(ALARM, "b.md", "b.md", "leave it out")


def test_the_value_of_a_key_is_never_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLANT_API_KEY", "quite an ordinary value")
    with pytest.raises(SpecError, match=r"a\.md: line 1 has the value of an environment variable"):
        Sentry(["a.md"]).look("quite an ordinary value", "a.md", "a.md", "leave it out")


def test_a_checked_name_that_is_not_read_is_refused() -> None:
    sentry = Sentry(["a.md", "misspelt.md"])
    sentry.look("fine", "a.md", "a.md", "leave it out")
    with pytest.raises(SpecError, match=r"checked names misspelt\.md"):
        sentry.refuse_unused()
