"""Points and pictures to surfaces with the pictures on them, stage by stage; `build` runs them all."""
