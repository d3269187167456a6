"""How a step is run many times: eagerly, or as one native loop."""
