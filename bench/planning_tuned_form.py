"""The planning problem in CasADi, Ipopt and MUMPS as well tuned as we could make it, a peer of
bench/planning_peers.py.

    unknowns a knot  (q, h qd, h² qdd, phi, h thetad, h² thetadd), output-side rad
    stage            (tau(q, qd, qdd) - kappa(phi + q_offset - q)) / k1 = 0        inverse dynamics, no D^{-1}
    between knots    the trapezoidal rule; theta = Xi(phi) inserted, so that it is no unknown

Derivatives are those of the functions of one knot, written as sparse blocks; all callbacks of Ipopt are C
code, compiled with gcc -O3 -march=native before the clock runs. Start on the reference by flatness, objective
scaled, barrier at its last value from the first step on (the start lies within all bounds), MUMPS without
permutation and with the pivot threshold of our own path; its orderings PORD, METIS, SCOTCH and automatic take
the same time, AMF and AMD 1.7 and 8 times as long.
"""

import subprocess
import tempfile

import casadi as ca
import numpy as np

from casadi_arm import gear, inverse_dynamics, springs

SCALE = 1e9
BLOCKS = 6
OPTIONS = {
    "mumps_permuting_scaling": 0, "mumps_pivtol": 1e-2, "mu_init": 1e-11, "bound_push": 1e-8,
    "bound_frac": 1e-8,
    "bound_mult_init_method": "mu-based", "constr_mult_init_max": 0.0, "barrier_tol_factor": 1e3,
    "bound_relax_factor": 0.0,
    "nlp_scaling_method": "none", "tol": 1e-6, "dual_inf_tol": 1e-4, "constr_viol_tol": 1e-10,
    "compl_inf_tol": 1e-10,
    "acceptable_iter": 0, "print_level": 0, "sb": "yes",
}


class Tuned:
    """The compiled program of one path; solve() as often as wanted."""

    def __init__(self, model, q_desired, flat_theta, step, nu, options=None):
        self.n, self.knots = model.axes, len(q_desired)
        self.start, self.low, self.high = _start_and_bounds(model, q_desired, flat_theta, step)
        functions = _functions(model, q_desired, step, nu)
        self.folder = tempfile.TemporaryDirectory()
        chosen = {f"ipopt.{key}": value for key, value in (OPTIONS | (options or {})).items()}
        chosen |= {"print_time": False, "no_nlp_grad": True, "calc_lam_p": False}
        self.solver = _compiled(functions, self.folder.name, chosen)

    def solve(self):
        """The unknowns (N, blocks n) of one solution."""
        answer = self.solver(x0=self.start.ravel(), lbx=self.low.ravel(), ubx=self.high.ravel(), lbg=0, ubg=0)
        return np.array(answer["x"]).reshape(self.knots, -1)


def _compiled(functions, folder, options):
    """Ipopt on the functions as C code of one library."""
    code = ca.CodeGenerator("program.c")
    for function in functions:
        code.add(function)
    code.generate(f"{folder}/")
    subprocess.run(["gcc", "-O3", "-march=native", "-fPIC", "-shared", "program.c", "-o", "program.so"],
                   cwd=folder, check=True)
    program, *rest = [ca.external(function.name(), f"{folder}/program.so") for function in functions]
    x, p = ca.MX.sym("x", program.sparsity_in(0)), ca.MX.sym("p", 0)
    f, g = program(x, p)
    derivatives = dict(zip(("grad_f", "jac_g", "hess_lag"), rest))
    return ca.nlpsol("solver", "ipopt", {"x": x, "p": p, "f": f, "g": g}, options | derivatives)


def _functions(model, q_desired, step, nu):
    """f with g, and their derivatives, from the functions of one knot."""
    n, knots = model.axes, len(q_desired)
    width, states = 6 * n, 4 * n
    z, wanted = ca.SX.sym("z", width), ca.SX.sym("wanted", n)
    stage_force, gap_force, factor = ca.SX.sym("l", n), ca.SX.sym("pi", n), ca.SX.sym("factor")
    q, qd, qdd, phi, _, thetadd = ca.vertsplit(z, n)
    k1 = ca.DM([joint.spring_linear for joint in model.joints])
    residual = (inverse_dynamics(model)(q, qd / step, qdd / step**2)
                - springs(model, phi + ca.DM(model.offsets) - q)) / k1
    theta = gear(model, phi)
    weights = ca.DM(nu * (model.ratios / step**2) ** 2)
    cost = SCALE * (ca.sumsqr(q - wanted) + ca.dot(weights, thetadd**2))
    slope = ca.jacobian(theta, phi)  # diagonal
    by_z = ca.jacobian(residual, z)
    curvature = ca.triu(ca.hessian(factor * cost + ca.dot(stage_force, residual) + ca.dot(gap_force, theta),
                                   z)[0])
    stage = ca.Function("stage", [z], [residual, theta])
    first = ca.Function("first", [z], [ca.vertcat(*by_z.nonzeros()), ca.diag(slope)])
    second = ca.Function("second", [z, wanted, factor, stage_force, gap_force],
                         [ca.vertcat(*curvature.nonzeros())])
    price = ca.Function("price", [z, wanted], [cost])
    price_first = ca.Function("price_first", [z, wanted], [ca.gradient(cost, z)])

    x, p = ca.MX.sym("x", width * knots), ca.MX.sym("p", 0)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n * knots + states * (knots - 1))
    Z, target = ca.reshape(x, width, knots), ca.DM(q_desired.T)
    r, th = stage.map(knots)(Z)
    part = lambda k: Z[k * n:(k + 1) * n, :]
    rows = ca.vertcat(part(0), part(1), th, part(4))
    rates = ca.vertcat(part(1), part(2), part(4), part(5))
    gaps = rows[:, 1:] - rows[:, :-1] - 0.5 * (rates[:, 1:] + rates[:, :-1])
    g = ca.vertcat(ca.vec(r), ca.vec(gaps))
    f = ca.sum2(price.map(knots)(Z, target))
    grad_f = ca.vec(price_first.map(knots)(Z, target))

    stage_values, slopes = first.map(knots)(Z)
    block = by_z.sparsity()
    stage_jacobian = ca.MX(_repeated(block, knots), ca.vec(stage_values))
    jacobian = ca.vertcat(stage_jacobian, _gap_jacobian(n, knots, slopes))
    L = ca.reshape(lam_g[:n * knots], n, knots)
    pi = ca.reshape(lam_g[n * knots:], states, knots - 1)[2 * n:3 * n, :]
    edge = ca.MX(n, 1)
    force = ca.horzcat(edge, pi) - ca.horzcat(pi, edge)
    seconds = second.map(knots)(Z, target, ca.repmat(lam_f, 1, knots), L, force)
    hessian = ca.MX(_repeated(curvature.sparsity(), knots), ca.vec(seconds))
    return (
        ca.Function("nlp", [x, p], [f, g], ["x", "p"], ["f", "g"]),
        ca.Function("nlp_grad_f", [x, p], [f, grad_f], ["x", "p"], ["f", "grad_f_x"]),
        ca.Function("nlp_jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        ca.Function("nlp_hess_l", [x, p, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"],
                    ["triu_hess_gamma_x_x"]),
    )


def _repeated(block, knots):
    """Sparsity of a block diagonal of equal blocks; its non-zeros are those of the blocks one after the
    other."""
    column, row = (np.array(part) for part in (block.colind(), block.row()))
    columns = np.concatenate([k * len(row) + column[:-1] for k in range(knots)] + [[knots * len(row)]])
    rows = np.concatenate([k * block.size1() + row for k in range(knots)])
    return ca.Sparsity(knots * block.size1(), knots * block.size2(), columns.tolist(), rows.tolist())


def _gap_jacobian(n, knots, slopes):
    """Constant but for d theta / d phi."""
    value, rate, angle = np.zeros((4, BLOCKS)), np.zeros((4, BLOCKS)), np.zeros((4, BLOCKS))
    value[0, 0] = value[1, 1] = value[3, 4] = 1.0
    rate[0, 1] = rate[1, 2] = rate[2, 4] = rate[3, 5] = 1.0
    angle[2, 3] = 1.0
    row = list(range(knots - 1))
    side = lambda offset: ca.DM(ca.Sparsity.triplet(knots - 1, knots, row, [offset + k for k in row]), 1.0)
    every = lambda pattern: ca.sparsify(ca.DM(np.kron(pattern, np.eye(n))))
    constant = ca.kron(side(1), every(value - 0.5 * rate)) - ca.kron(side(0), every(value + 0.5 * rate))
    moving = ca.kron(side(1) - side(0), every(angle))
    # Non-zeros lie column by column: the columns of phi of one knot after the other.
    column = np.array(moving.sparsity().get_col())
    slope = ca.vec(slopes)[((column // (BLOCKS * n)) * n + column % (BLOCKS * n) - 3 * n).tolist()]
    return ca.sparsify(constant) + ca.MX(moving.sparsity(), ca.DM(moving.nonzeros()) * slope)


def _start_and_bounds(model, q_desired, theta, step):
    """(N, blocks n) each: the flat motion, both ends at rest and fixed but for qdd."""
    n = model.axes
    rates = lambda x, k: np.gradient(rates(x, k - 1), axis=0) if k else x
    phi = np.column_stack([_output_angle(joint, theta[:, i]) for i, joint in enumerate(model.joints)])
    start = np.concatenate([q_desired, rates(q_desired, 1), rates(q_desired, 2), phi, rates(theta, 1),
                            rates(theta, 2)], axis=1)
    start[np.ix_([0, -1], list(range(n, 3 * n)) + list(range(4 * n, 6 * n)))] = 0.0
    column = lambda field: np.array([getattr(joint, field) for joint in model.joints])
    free = np.full(n, np.inf)
    ends = [[_output_angle(joint, np.array([value]))[0]
             for joint, value in zip(model.joints, column(field) - model.offsets)]
            for field in ("q_min", "q_max")]
    rate, second = step * column("q_dot_max"), step**2 * column("q_ddot_max")
    low = np.tile(np.concatenate([column("q_min"), -rate, -free, ends[0], -rate, -second]), (len(start), 1))
    high = np.tile(np.concatenate([column("q_max"), rate, free, ends[1], rate, second]), (len(start), 1))
    fixed = [i for i in range(6 * n) if not 2 * n <= i < 3 * n]
    for end in (0, -1):
        low[end, fixed] = high[end, fixed] = start[end, fixed]
    return start, low, high


def _output_angle(joint, theta):
    """Xi^{-1} on the output side by Newton's method."""
    if joint.cw is None:
        return theta.copy()
    phi = theta.copy()
    for _ in range(12):
        terms = list(zip(joint.cw.order, joint.cw.a, joint.cw.b))
        value = phi + sum((a * np.sin(w * phi) + b * (np.cos(w * phi) - 1.0)) / w for w, a, b in terms)
        phi = phi - (value - theta) / (1.0
                                       + sum(a * np.cos(w * phi) - b * np.sin(w * phi) for w, a, b in terms))
    return phi
