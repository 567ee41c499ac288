// One half of BlockKkt: from an end of the motion (the outer end, where the state is given) to the
// middle (the inner end, free but for a force y). Forward in time or backward, which only turns the sign of
// the half steps. See block_kkt.hpp for the recursion.
//
// Blocks: sigma has the state blocks, y = (sigma, qdd, input), rest = (sigma, input).
// Sizes are constants of the compiler for the usual number of axes (Axes > 0), else read at run time.
#pragma once

#include <array>

#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/block_product.hpp"

namespace exactarm::ocp {

constexpr long kKnotsBetweenChecks = 1024;  // for a signal: some 5 ms

template <int Axes, int MotorOrder>
class HalfSweep {
 public:
  // Knots first, first + direction, ..., `count` of them.
  HalfSweep(const Layout& layout, long first, long count, int direction);

  bool factorise(const StageDerivatives& derivatives, const Vector& diagonal);
  // Gradients for force y at the inner end (null: 0); right as in BlockKkt.
  void backward(const KktVector& right, const double* force);
  // Writes dz and lambda of its knots, the state of the inner end, and w (N x states): the gradient of the
  // cost to go at the front of each knot.
  void forward(const KktVector& right, KktVector* solution, double* inner);
  // Compliance of the inner end: d(state) = -compliance force.
  const Matrix& compliance() const { return compliance_; }
  // Of the reduced Hessian of this half alone, its middle free: how many eigenvalues are below zero.
  int negative_pivots() const { return negative_pivots_; }

 private:
  static constexpr int kStateBlocks = kLinkOrder + MotorOrder, kBlocks = kStateBlocks + 2;
  static constexpr int kN = Axes > 0 ? Axes : 0, kS = kStateBlocks * kN, kR = kS + kN, kW = kR + kN;
  using Square = Eigen::Matrix<double, Axes, Axes>;
  int n() const { return Axes > 0 ? Axes : axes_; }
  int states() const { return kStateBlocks * n(); }
  int rest() const { return states() + n(); }
  int width() const { return kBlocks * n(); }
  long knot(long position) const { return first_ + direction_ * position; }

  // What a knot keeps for the right-hand sides.
  struct Knot {
    double *value, *qdd_by_rest, *rest_by_qdd, *qdd_by_qdd, *inverse, *gain, *input_inverse;
    double *qdd_offset, *input_offset, *gradient, *qdd_gradient;
  };
  Knot at(long position);

  // quadratic_ = T_out' P T_out with the cost to go P behind the knot, then += T' H T.
  void carry_value(const double* value);
  void add_link_hessian(const StageDerivatives& derivatives, const double* diagonal, long k);
  void add_motor_hessian(const StageDerivatives& derivatives, const double* diagonal, long k);
  bool eliminate_qdd(const StageDerivatives& derivatives, long k, const Knot& here);
  bool eliminate_input(const Knot& here);
  template <class Block>
  bool invert_indefinite(Block& block);
  void propagate_compliance();
  const double* jump(const KktVector& right, long position, double& sign) const;
  void next_state(const double* sigma, const double* qdd, const double* input, double* x, double* out) const;

  int axes_;
  Layout layout_;
  long first_, count_;
  int direction_;
  // x block b = sum_c x_of_[b][c] y block c, s' block b = sum_c out_of_[b][c] y block c.
  double x_of_[kStateBlocks][kBlocks] = {}, out_of_[kStateBlocks][kBlocks] = {};
  // Begins at a multiple of a register wherever it lies: Eigen sums numbers before the first one in another
  // order, and with AVX2 a plan of five axes differed by it from run to run.
  using Memory = std::vector<double, Eigen::aligned_allocator<double>>;
  Memory memory_;
  long knot_size_;
  int negative_pivots_ = 0;
  // The entries of out_of_ that are not zero, in the order of c; `first`: of its c, or of its b.
  struct Term {
    int b, c;
    double factor;
    bool first;
  };
  std::vector<Term> terms_by_input_, terms_by_output_;
  Matrix half_, quadratic_, compliance_, covariance_;
  // Column-major scratch: rest x n (three of them), rest x rest, and what the compliance needs.
  Memory rest_transposed_, factor_, cross_, reduced_, product_, joint_, joint_transposed_, gain_transposed_,
      corner_;
  std::array<Square, 8> blocks_;
  Vector work_;
};

}  // namespace exactarm::ocp
