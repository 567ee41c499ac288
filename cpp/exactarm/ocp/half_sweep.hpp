// One half of BlockKkt: from an end of the motion (the outer end, where the state is given) to the
// middle (the inner end, free but for a force y). Forward in time or backward, which only turns the sign of
// the half steps. See block_kkt.hpp for the recursion.
//
// Blocks: sigma has the state blocks, y = (sigma, qdd, input), rest = (sigma, input).
// Sizes are constants of the compiler for the usual number of axes (Axes > 0), else read at run time.
#pragma once

#include "exactarm/ocp/block_kkt.hpp"

namespace exactarm::ocp {

// c (rows x cols) += a (rows x inner) b (inner x cols), column major, no padding.
template <class Int>
inline void add_product(Int rows, Int inner, Int cols, const double* __restrict a, const double* __restrict b,
                        double* __restrict c) {
  for (int j = 0; j < cols; ++j)
    for (int l = 0; l < inner; ++l) {
      const double factor = b[j * inner + l];
      for (int i = 0; i < rows; ++i) c[j * rows + i] += a[l * rows + i] * factor;
    }
}

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

 private:
  static constexpr int kStateBlocks = kLinkOrder + MotorOrder, kBlocks = kStateBlocks + 2;
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

  void gather_hessian(const StageDerivatives& derivatives, const Vector& diagonal, long k);
  bool eliminate(const StageDerivatives& derivatives, long position);
  void propagate_compliance();
  const double* jump(const KktVector& right, long position, double& sign) const;
  void next_state(const double* sigma, const double* qdd, const double* input, double* x, double* out) const;

  int axes_;
  Layout layout_;
  long first_, count_;
  int direction_;
  // x block b = sum_c x_of_[b][c] y block c, s' block b = sum_c out_of_[b][c] y block c.
  double x_of_[kStateBlocks][kBlocks] = {}, out_of_[kStateBlocks][kBlocks] = {};
  std::vector<double> memory_;
  long knot_size_;
  Matrix hessian_, half_, quadratic_, compliance_, covariance_, joint_, cross_;
  Vector work_;
};

}  // namespace exactarm::ocp
