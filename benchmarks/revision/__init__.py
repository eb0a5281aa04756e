"""The parts of `revisions.py`: environments, what is run in them, what is compared and timed."""
