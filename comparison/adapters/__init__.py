"""Other libraries and file formats; each is imported only when it is used."""

from .matlab import export, export_mat

__all__ = ["export", "export_mat"]
