"""What is done with a counterexample: store, replay, shrink, explain, map its surroundings, export."""
