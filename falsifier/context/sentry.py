"""Refuses texts that hold or seem to hold a secret, except in files that the user allows."""

from collections.abc import Collection

from falsifier.core.secrets import line_of_held_secret, line_of_secret
from falsifier.errors import SpecError


class Sentry:
    """Looks at every text of a file before it is told, and notes what the user allowed.

    Attributes:
        notes: what was allowed, one sentence per text.
    """

    def __init__(self, checked: Collection[str]) -> None:
        self._checked = frozenset(checked)
        self.notes: list[str] = []
        self._unused = set(checked)

    def look(self, text: str, shown: str, file: str, otherwise: str) -> None:
        """Refuse a text that looks like a secret.

        Args:
            text: what is to be told, or what that is made of.
            shown: the place, for messages.
            file: the file, by the name that a user would give.
            otherwise: what to do if it is a secret.

        Raises:
            SpecError: naming file and line, never the line's text.
        """
        self._unused.discard(file)
        line = line_of_held_secret(text)
        if line is not None:
            raise SpecError(
                f"context {shown}: line {line} has the value of an environment variable that is named like a "
                f"key, token or password, so nothing is sent; {otherwise}"
            )
        line = line_of_secret(text)
        if line is None:
            return
        if file not in self._checked:
            raise SpecError(
                f"context {shown}: line {line} looks like a key, token or password, so nothing is sent; "
                f"{otherwise}; if it is none, allow this file with --context 'checked:{file}', or with "
                f"checked = ['{file}'] in the spec's [context]"
            )
        note = f"context {shown}: line {line} looks like a key, token or password, and was allowed"
        if note not in self.notes:
            self.notes.append(note)

    def refuse_unused(self) -> None:
        """Refuse names of checked files at which nothing was looked: they may be misspelt.

        Raises:
            SpecError: naming them.
        """
        if self._unused:
            raise SpecError(
                f"context: checked names {', '.join(sorted(self._unused))}, which is not read; use the "
                "file's name as in the message about it, or drop it"
            )
