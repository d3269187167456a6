"""Gymnasium's environments as worlds. Gymnasium is imported only when such a world is used."""
