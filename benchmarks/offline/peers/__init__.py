"""The contenders of `offline_peers.py`, one file each.

Every file has `build(problem, mesh) -> solve`, and `solve(ζ_0)` returns the value V(ζ_0) that the
built solver finds. `game.py` states the problem that all of them solve.
"""
