"""The page on adaptive step sizes, ``docs/adaptive.md``, made from result files."""
