"""Several connected FMUs as one model: components, connections, order of stepping."""
