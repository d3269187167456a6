"""The page on the paper's claims, ``docs/reproduction.md``, made from result files."""
