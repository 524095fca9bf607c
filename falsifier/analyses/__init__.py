"""Questions about a problem or a run that are no search: coverage, assurance, margins, lint."""
