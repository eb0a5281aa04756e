"""Tasks in processes of this machine or of a cluster, and folders that one of them holds."""

from .cluster import run_on_cluster
from .lock import locked
from .pool import Event, S, T, Work, default_workers, run_tasks

__all__ = ["Event", "S", "T", "Work", "default_workers", "locked", "run_on_cluster", "run_tasks"]
