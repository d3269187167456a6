"""The page on meta-learning, ``docs/meta_learning.md``, made from result files."""
