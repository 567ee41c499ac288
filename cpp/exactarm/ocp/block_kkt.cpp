#include "exactarm/ocp/block_kkt.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "exactarm/base/parallel.hpp"
#include "exactarm/ocp/half_sweep.hpp"

namespace exactarm::ocp {
namespace {

constexpr long kLeastKnotsForTwo = 256;  // below, waking a thread takes longer than half of the sweep

// Begins at a multiple of the widest register, and with it every matrix inside: where Eigen's sums change
// from single numbers to registers depends on that, and a plan would differ by 1e-12 from run to run.
template <int Axes, int MotorOrder>
class alignas(64) TwoHalves : public BlockKkt {
 public:
  TwoHalves(const Layout& layout, int threads)
      : layout_(layout),
        threads_(threads),
        middle_((layout.knots - 2) / 2),
        left_(layout, 1, middle_, 1),
        right_(layout, layout.knots - 2, layout.knots - 2 - middle_, -1) {
    for (Vector* v : {&force_, &opposite_, &left_end_, &right_end_, &scale_, &turned_})
      v->setZero(layout.states());
    joined_.setZero(layout.states(), layout.states());
  }

  bool factorise(const StageDerivatives& derivatives, const Vector& diagonal) override {
    derivatives_ = &derivatives;
    bool left = false, right = false;
    both([&] { left = left_.factorise(derivatives, diagonal); },
         [&] { right = right_.factorise(derivatives, diagonal); });
    if (!left || !right) return false;
    joined_ = left_.compliance() + right_.compliance();
    // States differ by powers of ten in how far a force moves them.
    scale_ = joined_.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
    if (!scale_.allFinite()) return false;
    joined_ = scale_.asDiagonal() * joined_ * scale_.asDiagonal();
    negative_ = left_.negative_pivots() + right_.negative_pivots();
    if (negative_ == 0) {
      cholesky_.compute(joined_);
      return cholesky_.info() == Eigen::Success;
    }
    // Halves that are not convex alone: the whole is when the fixed middle takes each such direction away.
    eigen_.compute(joined_);
    return (eigen_.eigenvalues().array() < 0.0).count() == negative_;
  }

  int negative_pivots() const override { return negative_; }

  bool solve(const KktVector& right, KktVector& solution) override {
    const int s = layout_.states();
    both([&] { left_.backward(right, nullptr); left_.forward(right, nullptr, left_end_.data()); },
         [&] { right_.backward(right, nullptr); right_.forward(right, nullptr, right_end_.data()); });
    // left - C_l y - d = right + C_r y
    const long defect = middle_;
    force_ = scale_.cwiseProduct(left_end_ - right_end_ - right.defect.segment(defect * s, s));
    join(force_);
    force_ = scale_.cwiseProduct(force_);
    if (!force_.allFinite()) return false;
    opposite_ = -force_;
    solution.z.setZero();
    both(
        [&] {
          left_.backward(right, force_.data());
          left_.forward(right, &solution, left_end_.data());
        },
        [&] {
          right_.backward(right, opposite_.data());
          right_.forward(right, &solution, right_end_.data());
        });
    solution.defect.segment(defect * s, s) = opposite_;
    end_multipliers(right, solution, 0, 0);
    end_multipliers(right, solution, layout_.knots - 1, layout_.knots - 2);
    return solution.z.allFinite();
  }

 private:
  static constexpr int kStates = Axes > 0 ? (kLinkOrder + MotorOrder) * Axes : Eigen::Dynamic;
  using States = Eigen::Matrix<double, kStates, kStates>;

  template <class Left, class Right>
  void both(const Left& left, const Right& right) {
    parallel_both(layout_.knots < kLeastKnotsForTwo ? 1 : threads_, left, right);
  }

  void join(Vector& gap) {
    if (negative_ == 0) {
      cholesky_.solveInPlace(gap);
      return;
    }
    turned_.noalias() = eigen_.eigenvectors().transpose() * gap;
    turned_ = turned_.cwiseQuotient(eigen_.eigenvalues());
    gap.noalias() = eigen_.eigenvectors() * turned_;
  }

  // At an end only qdd is free: by_q_ddot' lambda = pi of the defect's rate row / 2 - g.
  void end_multipliers(const KktVector& right, KktVector& solution, long knot, long defect) {
    const int n = layout_.axes, s = layout_.states();
    const Eigen::Map<const Eigen::Matrix<double, Axes, Axes>> by_q_ddot(
        derivatives_->by_q_ddot.data() + knot * n * n, n, n);
    const Eigen::Matrix<double, Axes, 1> force = 0.5 * solution.defect.segment(defect * s + n, n) -
                         right.z.segment(knot * layout_.width() + kQDdot * n, n);
    // The mass matrix over the stiffness: symmetric but for the division by each axis' own stiffness.
    solution.stage.segment(knot * n, n) = by_q_ddot.transpose().partialPivLu().solve(force);
  }

  Layout layout_;
  int threads_;
  long middle_;
  HalfSweep<Axes, MotorOrder> left_, right_;
  Vector force_, opposite_, left_end_, right_end_, scale_, turned_;
  States joined_;
  int negative_ = 0;
  Eigen::LLT<States> cholesky_;
  Eigen::SelfAdjointEigenSolver<States> eigen_;
  const StageDerivatives* derivatives_ = nullptr;
};

}  // namespace

KktVector::KktVector(const Layout& layout)
    : z(Vector::Zero(layout.unknowns())),
      stage(Vector::Zero(layout.knots * layout.axes)),
      defect(Vector::Zero((layout.knots - 1) * layout.states())) {}

std::unique_ptr<BlockKkt> make_block_kkt(const Layout& layout, int threads) {
  if (layout.axes == 6 && layout.motor_order == 2) return std::make_unique<TwoHalves<6, 2>>(layout, threads);
  if (layout.axes == 6) return std::make_unique<TwoHalves<6, 3>>(layout, threads);
  if (layout.motor_order == 2) return std::make_unique<TwoHalves<Eigen::Dynamic, 2>>(layout, threads);
  return std::make_unique<TwoHalves<Eigen::Dynamic, 3>>(layout, threads);
}

}  // namespace exactarm::ocp
