#include "exactarm/ocp/block_kkt.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <chrono>

#include "exactarm/ocp/transcription.hpp"
#include "random_states.hpp"

namespace exactarm::ocp {
namespace {

using testing::Random;

struct Case {
  Layout layout;
  StageDerivatives derivatives;
  Vector diagonal;
  KktVector right;
  explicit Case(const Layout& l) : layout(l), derivatives(l), right(l) {}
};

// Random stages: a well-conditioned mass matrix, springs, small second derivatives, positive weights.
Case random_case(Random& random, int axes, int motor_order, long knots) {
  Case c({axes, motor_order, knots});
  const int n = axes;
  StageDerivatives& d = c.derivatives;
  for (long k = 0; k < knots; ++k) {
    const auto square = [&](Vector& v, double size, bool symmetric, double identity) {
      Eigen::Map<Matrix> block(v.data() + k * n * n, n, n);
      for (int j = 0; j < n; ++j) block.col(j) = random.vector(n, size);
      if (symmetric) block = Matrix(0.5 * (block + block.transpose()));
      block.diagonal().array() += identity;
    };
    square(d.by_q, 0.1, false, 1.0);
    square(d.by_q_dot, 0.1, false, 0.0);
    square(d.by_q_ddot, 0.3, false, 5.0);
    square(d.q_q, 0.03, true, 0.0);
    square(d.q_q_dot, 0.03, false, 0.0);
    square(d.q_dot_q_dot, 0.03, true, 0.0);
    square(d.q_q_ddot, 0.03, false, 0.0);
  }
  d.by_theta = -Vector::Ones(knots * n) + random.vector(knots * n, 0.1);
  d.q_theta = random.vector(knots * n, 0.1);
  d.theta_theta = random.vector(knots * n, 0.1);
  c.diagonal = Vector::Constant(c.layout.unknowns(), 1.0) + random.vector(c.layout.unknowns(), 0.5);
  c.right.z = random.vector(c.right.z.size(), 1.0);
  c.right.stage = random.vector(c.right.stage.size(), 1.0);
  c.right.defect = random.vector(c.right.defect.size(), 1.0);
  // The ends are fixed and consistent.
  c.right.stage.head(n).setZero();
  c.right.stage.tail(n).setZero();
  return c;
}

// The same system, dense: stationarity of all unknowns that are not fixed, then the equations.
void dense_solve(const Case& c, KktVector& solution) {
  const Layout& l = c.layout;
  const int n = l.axes, w = l.width(), s = l.states();
  const long unknowns = l.unknowns(), stages = l.knots * n, defects = (l.knots - 1) * s;
  Matrix h = Matrix::Zero(unknowns, unknowns), j = Matrix::Zero(stages + defects, unknowns);
  h.diagonal() = c.diagonal;
  const StageDerivatives& d = c.derivatives;
  for (long k = 0; k < l.knots; ++k) {
    const auto block = [&](const Vector& v) { return Eigen::Map<const Matrix>(v.data() + k * n * n, n, n); };
    const long z = k * w;
    h.block(z, z, n, n) += block(d.q_q);
    h.block(z, z + n, n, n) += block(d.q_q_dot);
    h.block(z + n, z, n, n) += block(d.q_q_dot).transpose();
    h.block(z + n, z + n, n, n) += block(d.q_dot_q_dot);
    h.block(z, z + 2 * n, n, n) += block(d.q_q_ddot);
    h.block(z + 2 * n, z, n, n) += block(d.q_q_ddot).transpose();
    j.block(k * n, z, n, n) = block(d.by_q);
    j.block(k * n, z + n, n, n) = block(d.by_q_dot);
    j.block(k * n, z + 2 * n, n, n) = block(d.by_q_ddot);
    for (int i = 0; i < n; ++i) {
      const long theta = z + kTheta * n + i;
      h(z + i, theta) += d.q_theta[k * n + i];
      h(theta, z + i) += d.q_theta[k * n + i];
      h(theta, theta) += d.theta_theta[k * n + i];
      j(k * n + i, theta) = d.by_theta[k * n + i];
    }
    if (k + 1 == l.knots) break;
    for (int b = 0; b < l.state_blocks(); ++b)
      for (int i = 0; i < n; ++i) {
        const long row = stages + k * s + b * n + i, at = Layout::state_block(b) * n + i;
        j(row, z + w + at) = 1.0;
        j(row, z + at) = -1.0;
        j(row, z + at + n) = j(row, z + w + at + n) = -0.5;
      }
  }
  const long size = unknowns + stages + defects;
  Matrix kkt = Matrix::Zero(size, size);
  Vector right(size);
  kkt.topLeftCorner(unknowns, unknowns) = h;
  kkt.bottomLeftCorner(stages + defects, unknowns) = j;
  kkt.topRightCorner(unknowns, stages + defects) = j.transpose();
  right << -c.right.z, -c.right.stage, -c.right.defect;
  for (long k : {0L, l.knots - 1})
    for (int i = 0; i < w; ++i)
      if (i / n != kQDdot) {
        kkt.row(k * w + i).setZero();
        kkt(k * w + i, k * w + i) = 1.0;
        right[k * w + i] = 0.0;
      }
  const Vector answer = kkt.fullPivLu().solve(right);
  solution.z = answer.head(unknowns);
  solution.stage = answer.segment(unknowns, stages);
  solution.defect = answer.tail(defects);
}

TEST(BlockKkt, AgreesWithADenseSolve) {
  Random random(50);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int axes = sample % 3 == 0 ? 6 : 1 + sample % 4;
    const Case c = random_case(random, axes, 2 + sample % 2, kLeastKnots + sample % 5);
    auto kkt = make_block_kkt(c.layout, 1 + sample % 2);
    ASSERT_TRUE(kkt->factorise(c.derivatives, c.diagonal));
    KktVector blockwise(c.layout), dense(c.layout);
    ASSERT_TRUE(kkt->solve(c.right, blockwise));
    dense_solve(c, dense);
    const double z = dense.z.cwiseAbs().maxCoeff(), lambda = dense.stage.cwiseAbs().maxCoeff(),
                 pi = dense.defect.cwiseAbs().maxCoeff();
    EXPECT_LT((blockwise.z - dense.z).cwiseAbs().maxCoeff(), 1e-9 * z) << "sample " << sample;
    EXPECT_LT((blockwise.stage - dense.stage).cwiseAbs().maxCoeff(), 1e-9 * lambda) << "sample " << sample;
    EXPECT_LT((blockwise.defect - dense.defect).cwiseAbs().maxCoeff(), 1e-9 * pi) << "sample " << sample;
  }
}

// Whatever was allocated before, and so wherever the memory of a factorisation begins.
TEST(BlockKkt, GivesTheSameBitsWhereverItsMemoryLies) {
  Random random(53);
  for (int sample = 0; sample < 12; ++sample) {  // of axes that fill registers, and that do not
    const Case c = random_case(random, sample < 4 ? 6 : sample < 8 ? 5 : 9, 2 + sample % 2, 40);
    KktVector first(c.layout), again(c.layout);
    std::vector<std::unique_ptr<BlockKkt>> kept;  // so that the next one lies elsewhere
    std::vector<std::unique_ptr<char[]>> between;
    for (int turn = 0; turn < 24; ++turn) {
      kept.push_back(make_block_kkt(c.layout, 1));
      between.push_back(std::make_unique<char[]>(16 * (turn + 1)));
      KktVector& answer = turn == 0 ? first : again;
      ASSERT_TRUE(kept.back()->factorise(c.derivatives, c.diagonal));
      ASSERT_TRUE(kept.back()->solve(c.right, answer));
      if (turn == 0) continue;
      ASSERT_EQ(first.z, again.z) << "sample " << sample << ", turn " << turn;
      ASSERT_EQ(first.stage, again.stage);
      ASSERT_EQ(first.defect, again.defect);
    }
  }
}

TEST(BlockKkt, RefusesAnIndefiniteReducedHessian) {
  Random random(51);
  Case c = random_case(random, 6, 2, 40);
  c.diagonal.setConstant(-1.0);
  EXPECT_FALSE(make_block_kkt(c.layout, 1)->factorise(c.derivatives, c.diagonal));
}

TEST(BlockKkt, TimeGrowsLinearly) {
  Random random(52);
  double seconds[2];
  for (int size = 0; size < 2; ++size) {
    const Case c = random_case(random, 6, 2, size == 0 ? 1000 : 8000);
    auto kkt = make_block_kkt(c.layout, 2);
    KktVector solution(c.layout);
    seconds[size] = 1e9;
    double factor = 1e9;
    for (int repeat = 0; repeat < 4; ++repeat) {
      const auto begin = std::chrono::steady_clock::now();
      ASSERT_TRUE(kkt->factorise(c.derivatives, c.diagonal));
      const auto middle = std::chrono::steady_clock::now();
      ASSERT_TRUE(kkt->solve(c.right, solution));
      const auto end = std::chrono::steady_clock::now();
      factor = std::min(factor, std::chrono::duration<double>(middle - begin).count());
      seconds[size] = std::min(seconds[size], std::chrono::duration<double>(end - begin).count());
    }
    std::printf("%ld knots: factorise %.2f ms, solve %.2f ms\n", c.layout.knots, 1e3 * factor,
                1e3 * (seconds[size] - factor));
  }
  EXPECT_LT(seconds[1], 8 * 3 * seconds[0]);
}

}  // namespace
}  // namespace exactarm::ocp
