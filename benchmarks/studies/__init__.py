"""What the scripts beside this folder run: cases, and results that are kept."""
