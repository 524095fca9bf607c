"""The FMU's messages of all simulations, in one file."""

from pathlib import Path

from falsifier.search.events import Evaluated, Event


class FmuLog:
    """Listener that writes the messages of each simulation; the file is replaced when the run starts.

    Args:
        path: file to write.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("", encoding="utf-8")

    def __call__(self, event: Event) -> None:
        """Append the messages of a simulation."""
        if not isinstance(event, Evaluated):
            return
        evaluation = event.evaluation
        outcome = (
            evaluation.status if evaluation.status == "ok" else f"{evaluation.status}: {evaluation.reason}"
        )
        lines = [f"simulation {event.index + 1}: {outcome}", *(f"  {line}" for line in evaluation.log)]
        with self._path.open("a", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")
