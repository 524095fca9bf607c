"""Language models: typed prompts, typed replies, and one narrow door to every provider."""
