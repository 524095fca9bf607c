"""One candidate in, one evaluation out: here, on other processes or on a cluster; and its confirmation."""
