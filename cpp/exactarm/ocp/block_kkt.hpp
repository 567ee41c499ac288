// The Newton system of the transcription, solved stage by stage: unknowns dz_k, multipliers lambda_k of
// the equation of motion and pi_k of the defects,
//   min sum_k dz_k' H_k dz_k / 2 + g_k' dz_k
//   s.t. J_k dz_k = -r_k,   (x - f/2)_{k+1} - (x + f/2)_k = -d_k,   dz = 0 at both ends
// The trapezoidal rule couples neighbours only through s_k = x_k + f_k / 2, so that with the interface
// value sigma in front of a knot the knot itself has two inputs, qdd and the motor input:
//   x = sigma + f/2,   s' = 2 x - sigma.
// qdd follows from J_k; what is left is a Riccati recursion with 4n (5n) states and n inputs. From both
// ends a half is swept: Riccati from the middle outwards with a free middle, the answer of the middle to
// a force there (its compliance, by a covariance recursion inwards), and the two halves are joined by
// one dense system. So a fixed end state costs nothing in conditioning, and the halves run in parallel.
// Rao, Wright and Rawlings (1998) for the recursion inside an interior-point method.
//
// Work and memory grow linearly with the knots; after the construction nothing is allocated.
#pragma once

#include <memory>

#include "exactarm/ocp/stage_model.hpp"

namespace exactarm::ocp {

// One right-hand side: N x width, N x n, (N - 1) x states.
struct KktVector {
  explicit KktVector(const Layout& layout);
  Vector z, stage, defect;
};

class BlockKkt {
 public:
  virtual ~BlockKkt() = default;
  // diagonal: added to the Hessian of the constraints in `derivatives`, N x width. False when the
  // reduced Hessian of some knot is not positive definite.
  virtual bool factorise(const StageDerivatives& derivatives, const Vector& diagonal) = 0;
  // Of the halves alone, their middle free; the whole has none when factorise() was true.
  virtual int negative_pivots() const = 0;
  // right = (g, r, d); solution = (dz, lambda, pi). False when the halves cannot be joined.
  virtual bool solve(const KktVector& right, KktVector& solution) = 0;
};

std::unique_ptr<BlockKkt> make_block_kkt(const Layout& layout, int threads);

}  // namespace exactarm::ocp
