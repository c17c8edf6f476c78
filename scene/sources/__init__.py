"""Where recordings come from: one file a format, and what is estimated where a format leaves it out (poses, depth, gravity)."""
