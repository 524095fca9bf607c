"""Systems: golden figures and independent integrations against the bundled FMUs."""
