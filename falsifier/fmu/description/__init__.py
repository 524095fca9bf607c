"""What FMUs say of themselves, and what is in their files, without loading anything."""
