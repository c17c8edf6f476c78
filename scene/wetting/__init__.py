"""Where the water is: maps of the ground, and the level of water on them at a given wetness."""
