"""The errors of a step that the compiler refuses."""


class Unsupported(Exception):
    """An operation in the step for which this compiler has no translation."""


class RunsMixed(ValueError):
    """A step in which a run's next state depends on other runs or on the run's lane."""
