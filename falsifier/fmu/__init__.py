"""FMUs: what they say of themselves, how they are stepped, and the process they run in."""
