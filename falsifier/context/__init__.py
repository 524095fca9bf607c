"""What an engineer would read about a model: Simulink files, sources and documents."""
