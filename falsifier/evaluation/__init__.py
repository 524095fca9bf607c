"""Evaluation of candidates, in this process or in others; confirmation of violations."""
