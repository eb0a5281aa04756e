"""Integration with error control that always ends: scipy's methods with a limit on the calls.

`import scipy` here and elsewhere loads its parts when they are first used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeVar

import casadi
import numpy as np
import scipy
from casadi import MX, SX

from .arrays import Array
from .errors import RunError

E = TypeVar("E", SX, MX)


def runge_kutta_step(rate: Callable[[E], E], y: E, h: E | float) -> E:
    """Return y after one step of the classical fourth-order Runge-Kutta method, as an expression."""
    k_1 = rate(y)
    k_2 = rate(y + h / 2 * k_1)
    k_3 = rate(y + h / 2 * k_2)
    k_4 = rate(y + h * k_3)
    return y + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def dormand_prince_step(rate: Callable[[MX], MX], y: MX, h: MX) -> tuple[MX, MX, MX]:
    """Return y after one step of DOP853, and the two error estimates per unit of h, as expressions.

    The method of order 8 of Dormand and Prince with its embedded ones of order 5 and 3 (Hairer, Nørsett
    and Wanner 1993, sec. II.10), scipy's coefficients; for a rate that does not depend on time.
    """
    method = scipy.integrate.DOP853
    slopes = [rate(y)]
    for row in method.A[1 : method.n_stages]:
        slopes.append(rate(y + h * _combined(row, slopes)))
    end = y + h * _combined(method.B, slopes)
    slopes.append(rate(end))
    return end, _combined(method.E5, slopes), _combined(method.E3, slopes)


def _combined(coefficients: Array, slopes: list[MX]) -> MX:
    """Return Σ c_i k_i over the slopes that there are, without the zeros."""
    terms = [c * k for c, k in zip(coefficients.tolist(), slopes, strict=False) if c != 0.0]
    total: MX = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def dormand_prince_error(h: MX, error_5: MX, error_3: MX, scale: MX) -> MX:
    """Return the error of a step of DOP853 relative to `scale` (n,); the step is accepted below 1.

    |h| e_5^2 / sqrt(n (e_5^2 + e_3^2 / 100)) with the norms of both scaled estimates; 0 where both are.
    """
    fifth, third = casadi.sumsqr(error_5 / scale), casadi.sumsqr(error_3 / scale)
    size = casadi.fmax(fifth + 0.01 * third, np.finfo(float).tiny)
    return h * fifth / casadi.sqrt(size * scale.numel())


def integrate(
    rhs: Callable[[float, Array], Array],
    start: Array,
    times: Array,
    *,
    rtol: float,
    atol: Array | float,
    method: Literal["DOP853", "RK45"] = "DOP853",
    first_step: float | None = None,
    max_calls: int = 1_000_000,
) -> Array:
    """Return the solution of y_dot = rhs(t, y) at times[1:], shape (len(times) - 1, n).

    Parameters
    ----------
    start : (n,) state at times[0]
    times : ascending [s]
    rtol, atol : relative and absolute tolerance of a step
    max_calls : of `rhs`; a policy or plant that has become too stiff ends here instead of never

    Raises
    ------
    RunError
        If the integration fails, anything is not finite, or the calls are used up.
    """
    calls = 0

    def counted(t: float, y: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > max_calls:
            raise RunError(f"the integration became too stiff near t = {t:.2f} s")
        return rhs(t, y)

    span = (float(times[0]), float(times[-1]))
    answer = scipy.integrate.solve_ivp(
        counted, span, start, method, t_eval=times[1:], rtol=rtol, atol=atol, first_step=first_step
    )
    if not answer.success or not np.all(np.isfinite(answer.y)):
        raise RunError(f"the integration failed between t = {span[0]:.2f} and {span[1]:.2f} s")
    return np.asarray(answer.y.T)


def phi_functions(A: Array) -> tuple[Array, Array, Array, Array]:
    """Return φ_0(A) to φ_3(A), each (n, n), from one exponential (Sidje 1998, sec. 2)."""
    n = len(A)
    chain = np.kron(np.diag(np.ones(3), 1), np.eye(n))
    chain[:n, :n] = A
    rows = scipy.linalg.expm(chain)[:n]
    phi_0, phi_1, phi_2, phi_3 = np.hsplit(rows, 4)
    return phi_0, phi_1, phi_2, phi_3


def doubled_phi(phi: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """Return φ_0(2A) to φ_3(2A) from those of A: φ_k(2A) = (φ_0 φ_k + Σ_{j=1}^k φ_j / (k-j)!) / 2^k."""
    phi_0, phi_1, phi_2, phi_3 = phi
    return (
        phi_0 @ phi_0,
        (phi_0 @ phi_1 + phi_1) / 2.0,
        (phi_0 @ phi_2 + phi_1 + phi_2) / 4.0,
        (phi_0 @ phi_3 + phi_1 / 2.0 + phi_2 + phi_3) / 8.0,
    )
