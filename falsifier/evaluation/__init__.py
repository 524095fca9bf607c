"""Evaluation of candidates, in this process, in others or on a cluster; confirmation of violations."""
