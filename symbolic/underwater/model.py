"""A vehicle's compiled earth-frame dynamics: f and g of (3), the plant in moving water, the trim."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import ArrayLike

from ..arrays import Array, Vector3
from ..compiled import Export, Kernel, dense_function, export
from ..errors import InputError
from ..game import Angles, Bound, Game, InverseDynamics, Problem, require_numbers
from . import dynamics, kinematics
from .vehicle import Vehicle

STATE_NAMES = (
    *("x", "y", "z", "phi", "theta", "psi"),
    *("x_dot", "y_dot", "z_dot", "phi_dot", "theta_dot", "psi_dot"),
)
STATE_UNITS = (*("m",) * 3, *("rad",) * 3, *("m/s",) * 3, *("rad/s",) * 3)
FORCE_NAMES = ("X", "Y", "Z", "K", "M", "N")
FORCE_UNITS = (*("N",) * 3, *("N m",) * 3)
PITCH_SENTENCE = (
    "the pitch is {} deg, but must stay inside ±90 deg, where the Euler angles are singular "
    "(Assumption 1); start closer to level"
)
PITCH_LIMIT = np.pi / 2  # rad; J is singular there (Assumption 1)
ANGLES = Angles(kinematics.PERIODS, kinematics.SAME_ATTITUDE)


class Model:
    """Compiled functions of a vehicle, each built when first used.

    Parameters
    ----------
    vehicle : its parameters
    current : known steady current in the earth frame [m/s]; part of f and of the trim
    compiled : False uses CasADi's virtual machine even where a C compiler exists

    Examples
    --------
    >>> model = Model(Vehicle.load("bluerov2-heavy"))
    >>> model.drift(zeta)          # f(ζ), shape (12,)
    >>> model.input_matrix(zeta)   # g(ζ), shape (12, 6)
    """

    def __init__(
        self, vehicle: Vehicle, current: Vector3 = (0.0, 0.0, 0.0), *, compiled: bool = True
    ) -> None:
        try:
            finite = np.isfinite(np.array(current, dtype=float))
        except (TypeError, ValueError):
            finite = np.zeros(0, dtype=bool)
        if finite.shape != (3,) or not finite.all():
            raise InputError(f"the current is {current}, but must be three finite numbers in m/s")
        self.vehicle = vehicle
        self.current = current
        self.zeta = SX.sym("zeta", 12)
        self.compiled = compiled
        self._exports: dict[str, Export] = {}

    def drift(self, zeta: ArrayLike) -> Array:
        """Return f(ζ) of (3), shape (12,), in the known current; the trim is not taken out.

        Raises
        ------
        InputError
            If `zeta` is not 12 finite numbers or |pitch| >= 90 degrees.
        """
        return self._drift(require_vehicle_state(zeta))[0]

    def input_matrix(self, zeta: ArrayLike) -> Array:
        """Return g(ζ) = (0, M_bar^-1) of (3), shape (12, 6); raises as `drift` does."""
        return self._input_matrix(require_vehicle_state(zeta))[0]

    @cached_property
    def u_trim(self) -> Array:
        """Steady earth-frame force [N, N m] with f(0) + g(0) u_trim = 0, shape (6,).

        It balances W - B, the moments of r_g and r_b and the drag of the known current. Earth-frame
        forces don't turn with the vehicle, so it holds at every heading unless there is a current.
        """
        zero = np.zeros(12)
        g = self.input_matrix(zero)
        return np.asarray(-np.linalg.solve(g[6:], self.drift(zero)[6:]))

    def problem(self, game: Game, scale: Array) -> Problem:
        """Return the station-keeping game, the trim taken out: f + g u_trim, so that f(0) = 0.

        Parameters
        ----------
        scale : (12,) half-widths of the envelope [m, rad, m/s, rad/s]
        """
        g = dynamics.input_matrix(self.vehicle, self.zeta)
        f = dynamics.drift(self.vehicle, self.zeta, self.current)
        a = SX.sym("acceleration", 6)
        v = dynamics.inverse_dynamics(self.vehicle, self.zeta, a, self.current)
        if np.any(self.u_trim):
            f = f + g @ DM(self.u_trim)
            v = v - DM(self.u_trim)
        return Problem(
            name=self.vehicle.name,
            zeta=self.zeta,
            drift=f,
            control_matrix=g,
            game=game,
            scale=scale,
            state_names=STATE_NAMES,
            state_units=STATE_UNITS,
            input_names=FORCE_NAMES,
            input_units=FORCE_UNITS,
            domain=(pitch_bound(self.zeta),),
            switching=dynamics.relative_velocity(self.zeta, self.current),
            inverse_dynamics=InverseDynamics(a, v),
            periods=kinematics.PERIODS,
            equivalence=kinematics.SAME_ATTITUDE,
        )

    @cached_property
    def plant(self) -> Kernel:
        """ζ_dot of the vehicle in moving water.

        Arguments: zeta (12,), tau_b and tau_d (6,) body wrenches [N, N m], water_velocity and
        water_acceleration (3,) in the earth frame [m/s, m/s^2]. The known current is not added.
        """
        tau_b, tau_d = SX.sym("tau_b", 6), SX.sym("tau_d", 6)
        v_c, a_c = SX.sym("water_velocity", 3), SX.sym("water_acceleration", 3)
        eta_ddot = dynamics.acceleration(self.vehicle, self.zeta, tau_b + tau_d, v_c, a_c)
        inputs = {"zeta": self.zeta, "tau_b": tau_b, "tau_d": tau_d}
        inputs |= {"water_velocity": v_c, "water_acceleration": a_c}
        return self._export("plant", inputs, {"zeta_dot": casadi.vertcat(self.zeta[6:], eta_ddot)})

    @cached_property
    def kinematics(self) -> Kernel:
        """J(η) of (1) from eta (6,): body velocities to η_dot; forces go back with its transpose."""
        eta = SX.sym("eta", 6)
        return self._export("kinematics", {"eta": eta}, {"J": kinematics.jacobian(eta)})

    @cached_property
    def earth_frame(self) -> Kernel:
        """M_bar, C_bar, D_bar, g_bar in still water from zeta (12,)."""
        terms = dynamics.earth_frame(self.vehicle, self.zeta[:6], self.zeta[6:])
        return self._export(
            "earth_frame",
            {"zeta": self.zeta},
            {
                "M_bar": terms.M_bar,
                "C_bar": terms.C_bar,
                "D_bar": terms.D_bar,
                "g_bar": terms.g_bar,
            },
        )

    @cached_property
    def drift_jacobian(self) -> Kernel:
        """∂f/∂ζ from zeta (12,), shape (12, 12)."""
        f = dynamics.drift(self.vehicle, self.zeta, self.current)
        return self._export(
            "drift_jacobian", {"zeta": self.zeta}, {"f_zeta": casadi.jacobian(f, self.zeta)}
        )

    @cached_property
    def input_matrix_jacobian(self) -> Kernel:
        """∂vec(g)/∂ζ from zeta (12,), shape (72, 12), vec stacking the columns of g."""
        g = casadi.vec(casadi.densify(dynamics.input_matrix(self.vehicle, self.zeta)))
        return self._export(
            "input_matrix_jacobian", {"zeta": self.zeta}, {"g_zeta": casadi.jacobian(g, self.zeta)}
        )

    def exports(self) -> Iterator[Export]:
        """Build every function and yield what became of it."""
        for name in ("_drift", "_input_matrix", "drift_jacobian", "input_matrix_jacobian"):
            getattr(self, name)
            yield self._exports[name.lstrip("_")]
        for name in ("plant", "kinematics", "earth_frame"):
            getattr(self, name)
            yield self._exports[name]

    @cached_property
    def _drift(self) -> Kernel:
        f = dynamics.drift(self.vehicle, self.zeta, self.current)
        return self._export("drift", {"zeta": self.zeta}, {"f": f})

    @cached_property
    def _input_matrix(self) -> Kernel:
        g = dynamics.input_matrix(self.vehicle, self.zeta)
        return self._export("input_matrix", {"zeta": self.zeta}, {"g": g})

    def _export(self, name: str, inputs: dict[str, SX], outputs: dict[str, SX]) -> Kernel:
        kernel, described = export(dense_function(name, inputs, outputs), compiled=self.compiled)
        self._exports[name] = described
        return kernel


def require_pitch(theta: float) -> None:
    """Raise InputError unless the pitch [rad] is inside ±90 degrees."""
    if abs(theta) >= PITCH_LIMIT:
        raise InputError(PITCH_SENTENCE.format(f"{np.degrees(theta):.1f}"))


def require_pitch_within(theta: float, limit: float) -> None:
    """Raise InputError where the pitch [rad] is beyond the limit [deg] of what is held."""
    if abs(np.degrees(theta)) > limit:
        raise InputError(
            f"the pitch is {np.degrees(theta):.1f} deg, but the controller holds a vehicle within "
            f"±{limit:g} deg: towards ±90 deg the Euler angles get singular (Assumption 1), and its "
            "forces grow without bound; bring the vehicle closer to level, or raise "
            "simulation.pitch_limit"
        )


def pitch_bound(zeta: SX) -> Bound:
    """Return the bound of the pitch of a vehicle's state, (π/2)^2 - θ^2 > 0."""
    return Bound(PITCH_LIMIT**2 - zeta[4] ** 2, PITCH_SENTENCE, 180.0 / np.pi * zeta[4])


def require_vehicle_state(zeta: ArrayLike) -> Array:
    """Return a vehicle's state as 12 finite numbers with the pitch inside ±90 degrees.

    Raises
    ------
    InputError
        One sentence about what is wrong.
    """
    state = require_numbers(zeta, STATE_NAMES)
    require_pitch(float(state[4]))
    return state


def vehicle_initial_state(zeta: ArrayLike) -> Array:
    """Return a vehicle's state that enters, its attitude written the short way.

    Raises
    ------
    InputError
        As `require_vehicle_state`, or for an angle of many turns, which is probably in degrees.
    """
    state = require_numbers(zeta, STATE_NAMES)
    ANGLES.require_near(state, STATE_NAMES, STATE_UNITS)
    return require_vehicle_state(ANGLES.start(state))
