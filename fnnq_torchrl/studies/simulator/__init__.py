"""The page on the tasks with sonars, ``docs/simulator.md``, made from result files."""
