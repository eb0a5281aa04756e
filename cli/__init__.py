"""The `stationkeep` command."""
