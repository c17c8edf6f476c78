"""What every floor of the house stands on: errors, argument checks, safe files, progress, settings, commands."""
