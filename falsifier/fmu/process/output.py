"""What an FMU's process prints: recorded up to a limit, however much it is."""

import os

from falsifier.core import operating_system
from falsifier.core.printable import printable

_MOST_BYTES = 1 << 20
# The end of long output says most about what went wrong.
_SHOWN_BYTES = 64 << 10
_DROPPED = "(further output was dropped)"


class Output:
    """A file for a process's output, with a position that it shares with this process."""

    def __init__(self) -> None:
        self._file = operating_system.sealed_file(_MOST_BYTES)

    def fileno(self) -> int:
        """Descriptor of the file, for the process that prints."""
        return self._file.fileno()

    def take(self, until: int | None = None) -> tuple[str, ...]:
        """Return the lines printed since the last call; only the last of much output.

        Args:
            until: position where they end, if the process goes on printing; it may say anything.
        """
        position = os.lseek(self.fileno(), 0, os.SEEK_CUR)
        if not position:
            return ()
        # The process may have moved the position, which would otherwise be the number of bytes.
        size = min(position, _MOST_BYTES if until is None else until, _MOST_BYTES)
        text = operating_system.read_at(self.fileno(), min(size, _SHOWN_BYTES), max(0, size - _SHOWN_BYTES))
        os.lseek(self.fileno(), 0, os.SEEK_SET)
        lines = tuple(printable(text.decode("utf-8", "replace")).splitlines())
        return lines if size < _MOST_BYTES else (*lines, _DROPPED)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
