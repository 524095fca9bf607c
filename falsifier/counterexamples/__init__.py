"""What was found: stored, simplified, explained, looked around and exported."""
