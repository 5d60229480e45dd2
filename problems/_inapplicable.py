"""Why a method does not apply: the reasons several problems share."""

import varcalc as vc

PATHWISE = "a first integral is lost where a constraint acts along the curve"

SECOND_ORDER = {vc.FirstIntegral: "a first integral of a second-order Lagrangian is no quadrature"}
SEVERAL_FUNCTIONS = {vc.FirstIntegral: "one first integral does not determine several unknown functions"}
NOT_IGNORABLE = {vc.FirstIntegral: "neither x nor y is ignorable"}
WAYPOINT = {vc.FirstIntegral: "the first integral jumps at the waypoint"}
INEQUALITY = {
    vc.Collocation: "collocates an equation, and an inequality does not say where it is one",
    vc.FirstIntegral: PATHWISE,
    vc.Shooting: "integrates one equation throughout, and an inequality does not say where it changes",
}
HOLONOMIC = {
    vc.FirstIntegral: PATHWISE,
    vc.Shooting: "integrates the unconstrained Euler-Lagrange equation",
}
