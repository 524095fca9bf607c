"""Everything shown to users: text, progress, notebooks, figures, reports."""
