"""The page on the tasks with sonars."""
