"""Fitted materials in the formats of others: glTF 2.0, MaterialX, Mitsuba."""
