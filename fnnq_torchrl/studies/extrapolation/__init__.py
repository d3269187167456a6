"""The page on value functions where nothing was seen, ``docs/extrapolation.md``."""
