"""The page on learning from prior knowledge, ``docs/prior.md``, made from result files."""
