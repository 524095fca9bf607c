"""The same equations once more, written and integrated in another way."""
