"""Worlds made of single environments of other libraries, one for each run."""
